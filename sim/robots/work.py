"""Who starts where, and what each robot has to do: the world's waypoints, or a share of the building."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from sim.buildings.grid_paths import search_nearest
from sim.buildings.world import World
from sim.robots.coverage import CoverageConfig, plan_tours, spread_places
from sim.robots.errands import Errands, route_errands, tour_errands
from sim.robots.routing import Router

Array = npt.NDArray[np.float64]

_APART_RADII = 2.2
"""Two robots start so many radii apart, at least."""
_OPEN_M = 0.6
"""Clearance of a place where a robot starts that the world has no start for, if the building has such places."""


def place_robots(world: World, router: Router, num_robots: int, radius_m: float) -> Array:
    """Where robots start: the world's own starts, and then always the open place farthest from all others.

    Args:
        world: The building.
        router: The floor that the robots reach.
        num_robots: How many, >= 1.
        radius_m: Of each.

    Returns:
        (num_robots, 3) x_m, y_m, theta_rad.

    Raises:
        ValueError: they have no room.
    """
    starts = [np.asarray(pose, dtype=np.float64) for pose in world.starts[:num_robots]]
    clearance = router.space.clearance_m.ravel()
    passable = router.passable.ravel()
    open_floor = passable & (clearance >= min(_OPEN_M, float(clearance[passable].max())))
    apart_m = _APART_RADII * radius_m
    for k in range(1, len(starts)):
        near = [j for j in range(k) if math.hypot(*(starts[j] - starts[k])[:2]) < apart_m]
        if near:
            raise ValueError(
                f"world '{world.name}': starts {near[0]} and {k} must be {apart_m:.2f} m apart for two robots"
            )
    while len(starts) < num_robots:
        cost, _ = search_nearest(router.graph, np.array([router.node_at(s[:2]) for s in starts]))
        farthest = np.argmax(np.where(open_floor & np.isfinite(cost), cost, -1.0))
        place = np.array([*router.point_of(np.array(farthest)), 0.0])
        if np.hypot(*(np.array(starts) - place)[:, :2].T).min() < apart_m:
            raise ValueError(
                f"num_robots must be at most {len(starts)} in world '{world.name}', where no more robots can start "
                f"{apart_m:.2f} m apart, got {num_robots}"
            )
        starts.append(place)
    return np.array(starts)


def share_work(
    world: World,
    router: Router,
    starts: Array,
    coverage: CoverageConfig,
    rngs: Sequence[np.random.Generator],
    *,
    endless: bool,
) -> list[Errands]:
    """What each robot visits.

    Args:
        world: The building.
        router: The floor that the robots reach.
        starts: (K, 3) where they start.
        coverage: How they share the building, unless it has waypoints.
        rngs: A stream of each robot.
        endless: Whether they go on for ever.

    Raises:
        ValueError: a waypoint cannot be reached.
    """
    if world.waypoints:
        routes = [world.waypoints[k % len(world.waypoints)] for k in range(len(starts))]
        return [route_errands(_route_nodes(world, router, route), endless) for route in routes]
    roadmap = spread_places(router, world.rooms, starts, coverage.spacing_m)
    tours = plan_tours(roadmap, len(starts), coverage, rngs[0])
    return [tour_errands(roadmap, k, tour, rngs[k] if endless else None) for k, tour in enumerate(tours)]


def _route_nodes(world: World, router: Router, route: Array) -> list[int]:
    """The nodes of a world's (M, 2) waypoints; refuses one that robots cannot reach."""
    rows, cols = router.space.cells_of(route).T
    for (x, y), reachable in zip(route, router.passable[rows, cols], strict=True):
        if not reachable:
            raise ValueError(f"world '{world.name}': the waypoint ({x:g}, {y:g}) cannot be reached by the robots")
    return [router.node_at(point) for point in route]
