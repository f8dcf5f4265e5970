"""What rooms are for, and the furniture that belongs into them."""

from dataclasses import dataclass
from enum import StrEnum

from sim.buildings import furniture
from sim.buildings.furniture import PieceMaker


class RoomKind(StrEnum):
    """What a room is for; it decides the furniture."""

    EMPTY = "empty"
    OFFICE = "office"
    MEETING = "meeting"
    LAB = "lab"
    STORAGE = "storage"
    LOUNGE = "lounge"
    HALL = "hall"
    CORRIDOR = "corridor"


@dataclass(frozen=True)
class Recipe:
    """A sort of furniture."""

    maker: PieceMaker
    """Makes a piece."""
    per_10_m2: float
    """Pieces on 10 m2 of floor."""
    against_wall: bool = True
    """Whether it stands with its back to a wall."""


@dataclass(frozen=True)
class Furnishing:
    """The furniture of one kind of room."""

    recipes: tuple[Recipe, ...]
    """Placed in this order."""
    bays: float
    """Probability that one of its walls has a row of equal piers, as between windows."""
    clutter_per_10_m2: float
    """Small things that lie about."""


_TRIM = Recipe(furniture.pilaster, 0.8)
_BIN = Recipe(furniture.plant, 0.3)
FURNISHINGS: dict[RoomKind, Furnishing] = {
    RoomKind.EMPTY: Furnishing((), 0.0, 0.0),
    RoomKind.OFFICE: Furnishing(
        (
            Recipe(furniture.desk, 1.7),
            Recipe(furniture.bookshelf, 0.5),
            Recipe(furniture.cabinet, 0.7),
            _TRIM,
            Recipe(furniture.boxes, 0.25),
            Recipe(furniture.stool_group, 0.2, False),
            _BIN,
        ),
        0.6,
        3.0,
    ),
    RoomKind.MEETING: Furnishing(
        (Recipe(furniture.table, 0.7, False), Recipe(furniture.cabinet, 0.4), _TRIM, _BIN), 0.6, 1.0
    ),
    RoomKind.LAB: Furnishing(
        (
            Recipe(furniture.bench, 0.9),
            Recipe(furniture.table, 0.3, False),
            Recipe(furniture.machine, 0.5),
            Recipe(furniture.bookshelf, 0.3),
            Recipe(furniture.stool_group, 0.3, False),
            _TRIM,
            Recipe(furniture.boxes, 0.4),
        ),
        0.5,
        4.0,
    ),
    RoomKind.STORAGE: Furnishing(
        (Recipe(furniture.bookshelf, 1.6), Recipe(furniture.boxes, 1.6), Recipe(furniture.cabinet, 0.8), _TRIM),
        0.2,
        4.0,
    ),
    RoomKind.LOUNGE: Furnishing(
        (
            Recipe(furniture.sofa, 0.7),
            Recipe(furniture.stool_group, 0.5, False),
            Recipe(furniture.machine, 0.3),
            _TRIM,
            _BIN,
        ),
        0.7,
        1.5,
    ),
    RoomKind.HALL: Furnishing(
        (
            Recipe(furniture.pillar, 0.12, False),
            Recipe(furniture.partition, 0.35, False),
            Recipe(furniture.stool_group, 0.2, False),
            Recipe(furniture.cabinet, 0.3),
            Recipe(furniture.sofa, 0.1),
            _TRIM,
            _BIN,
        ),
        0.7,
        2.0,
    ),
    RoomKind.CORRIDOR: Furnishing(
        (
            Recipe(furniture.pilaster, 0.8),
            Recipe(furniture.bookshelf, 0.2),
            Recipe(furniture.cabinet, 0.25),
            Recipe(furniture.machine, 0.1),
            _BIN,
        ),
        0.2,
        0.8,
    ),
}
"""Furniture by the kind of room."""
