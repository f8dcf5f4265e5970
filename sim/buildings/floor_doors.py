"""Walls between the rooms of a floor, and doors so that every room can be reached."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sim.buildings.floor_rooms import CELL_M, CORRIDOR, OUTSIDE, FloorLabels, Labels
from sim.buildings.plan import Material
from sim.buildings.walls import Door, Wall

_JAMB_M = 0.25
"""Wall left at least beside a door."""
_AROUND_LEAF_M = 0.8
"""Way to be left beyond the tip of an open leaf."""
_LARGE_ROOM_M2 = 35.0


@dataclass(frozen=True)
class DoorHabits:
    """How the doors of one building are."""

    width_m: tuple[float, float]
    """Narrowest and widest of the usual ones."""
    extra: float
    """Probability of a door between two neighbouring rooms."""
    leaf: float
    """Probability that a door has a leaf, which stands ajar."""
    closed: float
    """Probability of a closed door in a wall along a corridor: a shallow niche."""


@dataclass(frozen=True)
class Border:
    """A straight piece of the border between two labels."""

    start: tuple[float, float]
    """x_m, y_m of the end with smaller coordinates."""
    end: tuple[float, float]
    """x_m, y_m of the other end."""
    left: int
    """Label to the left of the way from start to end."""
    right: int
    """Label to the right."""

    @property
    def length_m(self) -> float:
        """Length of the piece."""
        return self.end[0] - self.start[0] + self.end[1] - self.start[1]

    def other(self, label: int) -> int:
        """The label on the other side."""
        return self.right if label == self.left else self.left


def trace_borders(labels: Labels) -> list[Border]:
    """All borders between different labels, as straight pieces, in a fixed order."""
    borders = [_upright(b) for b in _vertical(labels.T)]
    return borders + _vertical(labels)


def build_border_walls(
    borders: list[Border], thickness_m: tuple[float, float], glass: float, halls: set[int], rng: np.random.Generator
) -> list[Wall]:
    """A wall on every border, of thickness (inner, outer); some walls to corridors and halls are of glass."""
    walls = []
    for border in borders:
        sides = {border.left, border.right}
        outer = OUTSIDE in sides
        is_glass = (
            bool(rng.random() < glass) and not outer and bool(sides & (halls | {CORRIDOR})) and border.length_m > 2.0
        )
        material = Material.GLASS if is_glass else Material.WALL
        walls.append(Wall(np.array(border.start), np.array(border.end), thickness_m[outer], material))
    return walls


def place_doors(
    floor: FloorLabels, borders: list[Border], habits: DoorHabits, rng: np.random.Generator
) -> tuple[list[Door], set[int]]:
    """Doors that connect the rooms.

    Returns:
        The doors, and the labels that can be reached; the others are shafts.
    """
    ways = {CORRIDOR, *range(2, 2 + floor.num_halls)} & set(np.unique(floor.labels).tolist())
    inner = [b for b in borders if OUTSIDE not in (b.left, b.right)]
    doors = [_opening(b, rng) for b in inner if b.left in ways and b.right in ways and b.length_m > 1.6]
    reached, grown = set(ways), True
    while grown:
        grown = False
        for label in sorted({x for b in inner for x in (b.left, b.right)} - reached):
            options = [
                b for b in inner if label in (b.left, b.right) and b.other(label) in reached and _fits(b, habits)
            ]
            # Ways first: a room that touches a corridor has its door there.
            options = [b for b in options if b.other(label) in ways] or options
            if options:
                large = np.count_nonzero(floor.labels == label) * CELL_M**2 > _LARGE_ROOM_M2
                for k in rng.permutation(len(options))[: 2 if large and rng.random() < 0.6 else 1]:
                    doors.append(_door(options[k], label, habits, rng))
                reached.add(label)
                grown = True
    for border in inner:
        sides = {border.left, border.right}
        if sides <= reached and not sides & ways and _fits(border, habits) and rng.random() < habits.extra:
            doors.append(_door(border, border.left, habits, rng))
        elif sides & ways and not sides <= ways and border.length_m > 3.0 and rng.random() < habits.closed:
            doors.extend(_niche(border, doors, rng))
    return [door if _leaf_has_room(door, floor.labels) else replace(door, open_rad=None) for door in doors], reached


def _vertical(labels: Labels) -> list[Border]:
    """Borders along x = const: the label left of the way up is that of the column before."""
    borders = []
    for col in range(1, labels.shape[1]):
        before, after = labels[:, col - 1], labels[:, col]
        pair = np.where(before != after, before * 100_000 + after + 1, 0)
        cuts = np.nonzero(np.diff(np.concatenate([[0], pair, [0]])))[0]
        for low, high in pairwise(cuts):
            if pair[low]:
                start, end = (col * CELL_M, low * CELL_M), (col * CELL_M, high * CELL_M)
                borders.append(Border(start, end, int(before[low]), int(after[low])))
    return borders


def _upright(border: Border) -> Border:
    """A border of the transposed labels, back in place: x and y swap, and so do left and right."""
    return Border(border.start[::-1], border.end[::-1], border.right, border.left)


def _fits(border: Border, habits: DoorHabits) -> bool:
    return border.length_m >= habits.width_m[0] + 2.0 * _JAMB_M


def _leaf_has_room(door: Door, labels: Labels) -> bool:
    """Whether an open leaf, and a way around its tip, stay in the room into which it opens."""
    if not door.open_rad:
        return True
    x, y = door.x_m / CELL_M, door.y_m / CELL_M
    upright = labels[int(y + 0.5), int(x - 0.5)] != labels[int(y + 0.5), int(x + 0.5)]
    along = np.array([0.0, 1.0]) if upright else np.array([1.0, 0.0])
    turn = -1.0 if door.hinge_at_end else 1.0
    cosine, sine = np.cos(turn * door.open_rad), np.sin(turn * door.open_rad)
    hinge = np.array([door.x_m, door.y_m]) - turn * door.width_m / 2.0 * along
    direction = turn * np.array([cosine * along[0] - sine * along[1], sine * along[0] + cosine * along[1]])
    reach = np.arange(0.3, door.width_m + _AROUND_LEAF_M, CELL_M / 2.0)
    cols, rows = np.floor((hinge + reach[:, None] * direction) / CELL_M).astype(int).T
    if min(rows.min(), cols.min()) < 0 or rows.max() >= labels.shape[0] or cols.max() >= labels.shape[1]:
        return False
    return len(np.unique(labels[rows, cols])) == 1


def _at(border: Border, position_m: float) -> tuple[float, float]:
    share = position_m / border.length_m
    return (
        border.start[0] + share * (border.end[0] - border.start[0]),
        border.start[1] + share * (border.end[1] - border.start[1]),
    )


def _door(border: Border, room: int, habits: DoorHabits, rng: np.random.Generator) -> Door:
    """A door that opens into a room, more often near a corner than in the middle of the wall."""
    most = border.length_m - 2.0 * _JAMB_M
    width = min(float(rng.uniform(*habits.width_m)), most)
    if border.length_m > 5.0 and rng.random() < 0.2:
        width = min(float(rng.uniform(1.4, 1.9)), most)
    room_m = border.length_m - width - 2.0 * _JAMB_M
    share = rng.choice([rng.uniform(0.0, 0.15), rng.uniform(0.85, 1.0), rng.uniform(0.0, 1.0)])
    x, y = _at(border, _JAMB_M + width / 2.0 + share * max(room_m, 0.0))
    open_rad = None
    if width < 1.3 and rng.random() < habits.leaf:
        open_rad = float(np.radians(rng.uniform(68.0, 120.0))) * (1.0 if room == border.left else -1.0)
    return Door(x, y, width, open_rad, bool(rng.random() < 0.5))


def _opening(border: Border, rng: np.random.Generator) -> Door:
    """A wide gap between a hall and a corridor."""
    width = border.length_m - 0.4 if rng.random() < 0.5 else rng.uniform(0.4, 0.8) * border.length_m
    return Door(*_at(border, border.length_m / 2.0), max(float(width), 1.1))


def _niche(border: Border, doors: list[Door], rng: np.random.Generator) -> list[Door]:
    """A closed door, if there is a place for it that keeps clear of the other doors."""
    x, y = _at(border, float(rng.uniform(0.8, border.length_m - 0.8)))
    clear = all(abs(d.x_m - x) + abs(d.y_m - y) > d.width_m / 2.0 + 0.8 for d in doors)
    return [Door(x, y, 0.9, 0.0)] if clear else []
