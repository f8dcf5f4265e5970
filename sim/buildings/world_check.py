"""Is a building one in which robots can work? Closed, with free starts, and with rooms that can be reached."""

import math

import cv2
import numpy as np
import numpy.typing as npt

from sim.buildings.free_space import FreeSpace, measure_free_space
from sim.buildings.plan import Plan, Room

Array = npt.NDArray[np.float64]

SMALLEST_ROBOT_RADIUS_M = 0.15
"""A world must be passable for a robot of this radius; larger ones are checked when they are to drive."""
_LARGEST_M2 = 100_000.0
"""Area of the box around a building for which there is memory: its floor is kept in cells of 2 cm."""
_OUTLINE_RESOLUTION_M = 0.05
"""Holes in the outline are found down to about two of these."""


def check_plan(plan: Plan, segments: Array, radius_m: float = SMALLEST_ROBOT_RADIUS_M) -> None:
    """Check a building for a robot.

    Args:
        plan: The building.
        segments: (N, 2, 2) its surfaces in metres.
        radius_m: Radius of the robot, by default of the smallest.

    Raises:
        ValueError: the building is too large, there is no start, a start or a room's point is inside a wall, the
            outline is open, or a room cannot be reached; the message names the world and the place.
    """
    check_size(plan.name, segments)
    if len(plan.starts) == 0:
        raise ValueError(f"world '{plan.name}': no place where a robot can start")
    for k in np.nonzero(_inside_solids(plan))[0]:
        place = _place(plan.starts[k])
        raise ValueError(f"world '{plan.name}': start {k} at {place} is inside a wall or a piece of furniture")
    _check_outline(plan.name, segments, plan.starts)
    check_reach(plan.name, measure_free_space(segments), plan.rooms, plan.starts, radius_m)


def check_size(name: str, points: Array) -> None:
    """Refuse a building, given by (..., 2) points in metres, that is too large to be looked at.

    Raises:
        ValueError: its box is too large.
    """
    width_m, depth_m = np.ptp(points.reshape(-1, 2), axis=0)
    if width_m * depth_m > _LARGEST_M2:
        raise ValueError(
            f"world '{name}': a building of {width_m:g} x {depth_m:g} m is too large: at most {_LARGEST_M2:g} m² in all"
        )


def check_reach(name: str, space: FreeSpace, rooms: tuple[Room, ...], starts: Array, radius_m: float) -> None:
    """Check that a robot of this radius stands free at all (K, 3) starts and reaches every room from them.

    Raises:
        ValueError: it does not; the message names the start or the room.
    """
    rows, cols = space.cells_of(starts[:, :2]).T
    for k, start in enumerate(starts):
        if space.clearance_m[rows[k], cols[k]] <= radius_m:
            raise ValueError(
                f"world '{name}': start {k} at {_place(start)} is inside a wall or too close to one for a robot "
                f"of radius {radius_m:g} m"
            )
    reached = space.reachable(starts[0], radius_m)
    for room in rooms:
        row, col = space.cells_of(np.array([room.x_m, room.y_m]))
        if not reached[row, col]:
            raise ValueError(
                f"world '{name}': room '{room.name}' at ({room.x_m:.2f}, {room.y_m:.2f}) cannot be reached "
                f"{_by(radius_m)}: it is walled in, or every way is too narrow"
            )
    for k, start in enumerate(starts):
        if not reached[rows[k], cols[k]]:
            raise ValueError(
                f"world '{name}': start {k} at {_place(start)} cannot be reached from start 0 {_by(radius_m)}"
            )


def _check_outline(name: str, segments: Array, starts: Array) -> None:
    """Flood the drawn surfaces from each start; the flood must not come out of the building."""
    low = segments.min(axis=(0, 1)) - 4.0 * _OUTLINE_RESOLUTION_M
    size = np.ceil((segments.max(axis=(0, 1)) - low) / _OUTLINE_RESOLUTION_M).astype(int) + 4
    drawn = np.zeros((size[1], size[0]), dtype=np.uint8)
    # Whole pixels: lines drawn between parts of pixels may have holes that a flood gets through.
    cv2.polylines(drawn, list(np.floor((segments - low) / _OUTLINE_RESOLUTION_M).astype(np.int32)), False, 1)
    for k, start in enumerate(starts):
        x, y = ((start[:2] - low) / _OUTLINE_RESOLUTION_M).astype(int)
        if not (0 <= x < size[0] and 0 <= y < size[1]):
            raise ValueError(f"world '{name}': start {k} at {_place(start)} is outside the building")
        flooded = drawn.copy()
        cv2.floodFill(flooded, None, (int(x), int(y)), 2)
        if flooded[0, 0] == 2:
            raise ValueError(f"world '{name}': the outline is open: from start {k} at {_place(start)} one gets outside")


def _inside_solids(plan: Plan) -> npt.NDArray[np.bool_]:
    """(K,) whether each start lies inside a solid."""
    inside = np.zeros(len(plan.starts), dtype=np.bool_)
    for solid in plan.solids:
        low, high = solid.polygon.min(axis=0), solid.polygon.max(axis=0)
        for k in np.nonzero(((plan.starts[:, :2] >= low) & (plan.starts[:, :2] <= high)).all(axis=1))[0]:
            along = np.roll(solid.polygon, -1, axis=0) - solid.polygon
            offset = plan.starts[k, :2] - solid.polygon
            inside[k] |= bool((along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0] >= 0.0).all())
    return inside


def _place(start: Array) -> str:
    return f"({start[0]:.2f}, {start[1]:.2f}, {math.degrees(start[2]):.0f} deg)"


def _by(radius_m: float) -> str:
    return f"by a robot of radius {radius_m:g} m"
