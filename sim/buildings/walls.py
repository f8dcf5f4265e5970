"""Walls with two faces, cut open by doors, some of which have a leaf that stands ajar."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.buildings.plan import Array, Material, Solid, strip

_LEAF_THICKNESS_M = 0.04
_REACH_M = 0.05
"""A door belongs to a wall if its point lies at most this far outside the wall."""
_SHORTEST_PIECE_M = 0.02


@dataclass(frozen=True)
class Wall:
    """A straight wall by its centre line."""

    start: Array
    """(2,) one end, metres."""
    end: Array
    """(2,) the other end, metres."""
    thickness_m: float
    """Between its two faces."""
    material: Material = Material.WALL
    """WALL or GLASS."""


@dataclass(frozen=True)
class Door:
    """A gap in the walls that pass through a point."""

    x_m: float
    """Centre of the gap."""
    y_m: float
    """Centre of the gap."""
    width_m: float
    """Width of the gap along the wall."""
    open_rad: float | None = None
    """Angle of the leaf: 0 is closed, positive opens to the left of the wall's direction; None: no leaf."""
    hinge_at_end: bool = False
    """The leaf hangs at the end of the gap that is farther along the wall."""


def build_walls(walls: Sequence[Wall], doors: Sequence[Door]) -> list[Solid]:
    """Cut the doors into the walls and hang the leaves.

    Raises:
        ValueError: a door lies on no wall; the message says which and where.
    """
    solids: list[Solid] = []
    used = [False] * len(doors)
    for wall in walls:
        length_m = float(np.hypot(*(wall.end - wall.start)))
        gaps = []
        for k, door in enumerate(doors):
            middle = _position_on(wall, length_m, door)
            if middle is not None:
                gaps.append((middle - door.width_m / 2.0, middle + door.width_m / 2.0))
                if door.open_rad is not None and not used[k]:
                    solids.append(_leaf(wall, length_m, middle, door))
                used[k] = True
        solids.extend(_pieces(wall, length_m, gaps))
    if not all(used):
        k = used.index(False)
        raise ValueError(f"doors[{k}] at ({doors[k].x_m:g}, {doors[k].y_m:g}) lies on no wall")
    return solids


def _position_on(wall: Wall, length_m: float, door: Door) -> float | None:
    """Distance of the door's centre along a wall, or None if it is not in that wall."""
    along = (wall.end - wall.start) / length_m
    offset = np.array([door.x_m, door.y_m]) - wall.start
    position = float(offset @ along)
    beside = abs(float(along[0] * offset[1] - along[1] * offset[0]))
    return position if beside <= wall.thickness_m / 2.0 + _REACH_M and 0.0 <= position <= length_m else None


def _pieces(wall: Wall, length_m: float, gaps: list[tuple[float, float]]) -> list[Solid]:
    """What the gaps leave of a wall; its own ends reach half a thickness further, so that corners are closed."""
    along = (wall.end - wall.start) / length_m
    overhang = wall.thickness_m / 2.0
    solids, position = [], -overhang
    for low, high in [*sorted(gaps), (length_m + overhang, length_m + overhang)]:
        if low - position > _SHORTEST_PIECE_M:
            ends = wall.start + np.array([[position], [low]]) * along
            solids.append(Solid(strip(ends[0], ends[1], wall.thickness_m), wall.material))
        position = max(position, high)
    return solids


def _leaf(wall: Wall, length_m: float, middle_m: float, door: Door) -> Solid:
    """The leaf of a door, turned about its hinge at one end of the gap."""
    along = (wall.end - wall.start) / length_m
    turn = -1.0 if door.hinge_at_end else 1.0
    hinge = wall.start + (middle_m - turn * (door.width_m / 2.0 - _LEAF_THICKNESS_M / 2.0)) * along
    angle = (door.open_rad or 0.0) * turn
    cosine, sine = math.cos(angle), math.sin(angle)
    direction = turn * np.array([cosine * along[0] - sine * along[1], sine * along[0] + cosine * along[1]])
    tip = hinge + (door.width_m - _LEAF_THICKNESS_M) * direction
    return Solid(strip(hinge, tip, _LEAF_THICKNESS_M), Material.DOOR)
