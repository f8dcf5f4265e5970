"""What each robot is to see: places spread over the reachable floor, put into tours, shared out among the robots."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.optimize import linear_sum_assignment
from scipy.sparse.csgraph import dijkstra

from sim.buildings.grid_paths import search, search_nearest
from sim.buildings.plan import Room
from sim.robots.routing import Router
from sim.robots.tour import shorten_tour

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_FEWEST_PLACES = 3
"""Places of every robot's part, its start perhaps among them: nobody stands idle."""


@dataclass(frozen=True)
class CoverageConfig:
    """How robots cover a building."""

    spacing_m: float = 2.5
    """Every reachable place lies at most about so far, by way of the floor, from a place that is visited; > 0.3."""
    shared: float = 0.25
    """Share of each robot's tour that also belongs to the next robot's, in [0, 1]."""
    passes: int = 1
    """How often everything is covered, each time in another order, 1 to 100."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        if not 0.3 < self.spacing_m < 100.0:
            raise ValueError(f"spacing_m must be in (0.3, 100) m, got {self.spacing_m}")
        if not 0.0 <= self.shared <= 1.0:
            raise ValueError(f"shared must be in [0, 1], got {self.shared}")
        if not 1 <= self.passes <= 100:
            raise ValueError(f"passes must be in [1, 100], got {self.passes}")


@dataclass(frozen=True)
class Roadmap:
    """Places to visit and how far they are from each other."""

    nodes: Indices
    """(V,) nodes of the router."""
    distance_m: Array
    """(V, V) cost of the way between two places."""


def spread_places(router: Router, rooms: tuple[Room, ...], starts: Array, spacing_m: float) -> Roadmap:
    """Spread places over the floor: the starts, the rooms, then the most open place not yet covered, and so on.

    Args:
        router: The reachable floor.
        rooms: Rooms that must be visited.
        starts: (K, 3) where robots start; they come first among the places.
        spacing_m: Distance by way of the floor within which a place counts as covered.

    Returns:
        The places, at least one.
    """
    given = [*starts[:, :2], *(np.array([room.x_m, room.y_m]) for room in rooms)]
    nodes = list(dict.fromkeys(router.node_at(point) for point in given))
    # Costs exceed metres near walls: a little more reach keeps small rooms from getting many places.
    reach = 1.5 * spacing_m
    covered = np.isfinite(search_nearest(router.graph, np.array(nodes), reach)[0])
    clearance = np.where(router.passable, router.space.clearance_m, -1.0).ravel()
    for node in np.argsort(-np.round(clearance, 1), kind="stable")[: np.count_nonzero(router.passable)]:
        if not covered[node]:
            covered |= np.isfinite(search(router.graph, int(node), reach)[0])
            nodes.append(int(node))
    chosen = np.array(nodes, dtype=np.int64)
    return Roadmap(chosen, _distances(router, chosen))


def plan_tours(roadmap: Roadmap, num_robots: int, config: CoverageConfig, rng: np.random.Generator) -> list[Indices]:
    """Share the places out among robots, and order them.

    Robot k starts at place k. One tour of all places is cut into parts of equal length, each part is lengthened
    into the next one by the shared share, and every robot takes the part that suits its start.

    Args:
        roadmap: The places; the first ``num_robots`` are the robots' starts.
        num_robots: K.
        config: How much is shared, how many passes.
        rng: Makes the later passes differ from the first.

    Returns:
        K arrays of indices of places, in the order of the visits, the start not included.
    """
    distance = roadmap.distance_m
    whole = shorten_tour(distance, np.arange(len(distance)))
    parts = _cut(distance, whole, num_robots, config.shared)
    cost = np.array([[distance[k, part].min() for part in parts] for k in range(num_robots)])
    _, chosen = linear_sum_assignment(cost)
    return [_passes(distance, k, parts[chosen[k]], config.passes, rng) for k in range(num_robots)]


def more_visits(roadmap: Roadmap, tour: Indices, rng: np.random.Generator) -> Indices:
    """Another pass over a tour's places, in another order, from where the tour ended."""
    return _passes(roadmap.distance_m * rng.uniform(0.6, 1.4), int(tour[-1]), np.unique(tour), 1, rng)


def _distances(router: Router, nodes: Indices) -> Array:
    """Ways between places, by the borders of the areas that are nearest to each: one search instead of one a place."""
    reached, source = search_nearest(router.graph, nodes)
    index = np.full(router.passable.size, -1)
    index[nodes] = np.arange(len(nodes))
    edges = router.graph.tocoo()
    i, j = edges.coords
    border = (source[i] != source[j]) & np.isfinite(reached[i]) & np.isfinite(reached[j])
    i, j, weight = i[border], j[border], edges.data[border]
    length = reached[i] + weight + reached[j]
    a, b = index[source[i]], index[source[j]]
    order = np.lexsort((length, b, a))
    pairs, first = np.unique(np.stack([a, b], axis=-1)[order], axis=0, return_index=True)
    near = sparse.csr_array((length[order][first], (pairs[:, 0], pairs[:, 1])), shape=(len(nodes), len(nodes)))
    return np.asarray(dijkstra(near), dtype=np.float64)


def _cut(distance: Array, tour: Indices, num_parts: int, shared: float) -> list[Indices]:
    """Cut a round tour into parts of equal length, each lengthened into the next one, and the shortest still more."""
    if num_parts == 1:
        return [tour]
    legs = distance[tour, np.roll(tour, -1)]
    ends = np.cumsum(legs) / legs.sum()
    part = np.minimum((np.concatenate([[0.0], ends[:-1]]) * num_parts).astype(np.int64), num_parts - 1)
    parts = []
    for k in range(num_parts):
        num_own, num_following = np.count_nonzero(part == k), np.count_nonzero(part == (k + 1) % num_parts)
        length = max(num_own + round(shared * num_following), _FEWEST_PLACES)
        parts.append(np.roll(tour, -int(np.searchsorted(part, k)))[:length])
    return parts


def _passes(distance: Array, start: int, part: Indices, passes: int, rng: np.random.Generator) -> Indices:
    """Visits of one robot: the shortest order first, then orders that a distorted idea of distance gives."""
    visits: list[Indices] = []
    for k in range(passes):
        distort = rng.uniform(0.7, 1.3, distance.shape) if k else np.ones(distance.shape)
        here = start if k == 0 else int(visits[-1][-1])
        others = part[part != here]
        order = np.concatenate([[here], others if len(others) else [start]])
        visits.append(shorten_tour(distance * np.sqrt(distort * distort.T), order)[1:])
    return np.concatenate(visits)
