"""Pieces of furniture as a lidar at knee height sees them: legs, drawers, columns and bodies, not table tops.

A piece stands in a frame of its own: x along the wall behind it, y away from the wall, its back at y = 0, centred
at x = 0. Its footprint is what it occupies for whoever places the next piece.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.buildings.plan import Array, Material, Solid, box, disc

_LEG_M = 0.05
_PANEL_M = 0.03


@dataclass(frozen=True)
class Piece:
    """A piece of furniture in its own frame."""

    width_m: float
    """Footprint along the wall."""
    depth_m: float
    """Footprint away from the wall."""
    solids: tuple[Solid, ...]
    """What the lidar sees of it."""


def place(piece: Piece, x_m: float, y_m: float, angle_rad: float) -> list[Solid]:
    """The solids of a piece whose frame lies at this pose in ``world``."""
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    R_T = np.array([[cosine, sine], [-sine, cosine]])
    return [Solid(s.polygon @ R_T + (x_m, y_m), s.material) for s in piece.solids]


def footprint(piece: Piece, x_m: float, y_m: float, angle_rad: float, margin_m: float) -> Array:
    """(4, 2) corners in ``world`` of the floor that a placed piece takes, widened on three sides by a margin."""
    half = piece.width_m / 2.0 + margin_m
    corners = np.array([[-half, 0.0], [half, 0.0], [half, piece.depth_m + margin_m], [-half, piece.depth_m + margin_m]])
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    return np.asarray(corners @ np.array([[cosine, sine], [-sine, cosine]]) + (x_m, y_m))


def _solid(polygon: Array, material: Material = Material.FURNITURE) -> Solid:
    return Solid(polygon, material)


def _leg(x: float, y: float) -> Solid:
    return _solid(disc(x, y, _LEG_M / 2.0, 3))


def _cuboid(rng: np.random.Generator, widths: tuple[float, float], depths: tuple[float, float]) -> Piece:
    width, depth = rng.uniform(*widths), rng.uniform(*depths)
    return Piece(width, depth + 0.03, (_solid(box(0.0, 0.03 + depth / 2.0, (width, depth))),))


def _chair(rng: np.random.Generator, x: float, y: float) -> list[Solid]:
    """An office chair (a column and the edge of a seat) or four legs, turned anyhow."""
    x, y, angle = x + rng.normal(0.0, 0.1), y + rng.normal(0.0, 0.06), rng.uniform(0.0, math.pi)
    if rng.random() < 0.6:
        seat = [_solid(disc(x, y, rng.uniform(0.16, 0.24), 6))] if rng.random() < 0.5 else []
        return seat or [_solid(disc(x, y, 0.04, 4))]
    corners = box(x, y, (0.4, 0.4), angle)
    return [_leg(float(cx), float(cy)) for cx, cy in corners]


def desk(rng: np.random.Generator) -> Piece:
    """A desk with drawers or a cabinet below, legs, often a computer, and a chair."""
    width, depth = rng.uniform(1.2, 1.8), rng.uniform(0.65, 0.85)
    side = rng.choice([-1.0, 1.0])
    solids = [_solid(box(side * (width / 2.0 - 0.23), 0.05 + depth / 2.0, (0.42, depth - 0.15)))]
    solids += [_leg(-side * (width / 2.0 - 0.05), y) for y in (0.06, depth - 0.05)]
    if rng.random() < 0.4:
        solids.append(_solid(box(0.0, 0.08, (width - 0.1, _PANEL_M))))
    if rng.random() < 0.5:
        solids.append(
            _solid(box(-side * (width / 2.0 - 0.22), 0.3, (0.2, 0.45), rng.normal(0.0, 0.1)), Material.CLUTTER)
        )
    if rng.random() < 0.85:
        solids += _chair(rng, rng.normal(0.0, 0.15), depth + 0.25)
    return Piece(width, depth + 0.55, tuple(solids))


def cabinet(rng: np.random.Generator) -> Piece:
    """A cupboard or filing cabinet."""
    return _cuboid(rng, (0.4, 1.3), (0.4, 0.6))


def bookshelf(rng: np.random.Generator) -> Piece:
    """A shelf, wide and flat."""
    return _cuboid(rng, (0.8, 2.6), (0.25, 0.4))


def bench(rng: np.random.Generator) -> Piece:
    """A laboratory bench: cupboards below one part, legs below the rest, stools before it."""
    width, depth = rng.uniform(2.0, 3.6), rng.uniform(0.6, 0.8)
    closed = width * rng.uniform(0.3, 1.0)
    solids = [_solid(box(-width / 2.0 + closed / 2.0, 0.03 + depth / 2.0, (closed, depth)))]
    solids += [_leg(width / 2.0 - 0.05, y) for y in (0.08, depth - 0.05)]
    for _ in range(int(rng.integers(0, 3))):
        solids.append(_solid(disc(rng.uniform(-0.4, 0.4) * width, depth + 0.25, 0.15, 6)))
    return Piece(width, depth + 0.45, tuple(solids))


def table(rng: np.random.Generator) -> Piece:
    """A meeting table on legs or two columns, with chairs on both sides."""
    width, depth, seats = rng.uniform(1.4, 3.2), rng.uniform(0.8, 1.2), 0.5
    solids: list[Solid] = []
    if rng.random() < 0.6:
        solids += [_leg(x, y) for x in (-width / 2.0 + 0.08, width / 2.0 - 0.08) for y in (seats, seats + depth)]
    else:
        solids += [_solid(box(x, seats + depth / 2.0, (0.12, 0.5))) for x in (-width / 3.0, width / 3.0)]
    for y in (seats - 0.15, seats + depth + 0.15):
        for x in np.arange(-width / 2.0 + 0.35, width / 2.0 - 0.2, 0.7):
            if rng.random() < 0.85:
                solids += _chair(rng, float(x), y)
    return Piece(width + 0.2, depth + 2.0 * seats, tuple(solids))


def sofa(rng: np.random.Generator) -> Piece:
    """A sofa or an armchair."""
    return _cuboid(rng, (0.8, 2.1), (0.75, 0.95))


def machine(rng: np.random.Generator) -> Piece:
    """A copier, a refrigerator, a rack."""
    return _cuboid(rng, (0.5, 0.9), (0.55, 0.8))


def plant(rng: np.random.Generator) -> Piece:
    """A flower pot or a waste bin."""
    radius = rng.uniform(0.12, 0.24)
    return Piece(2.0 * radius, 2.0 * radius + 0.05, (_solid(disc(0.0, radius + 0.05, radius, 8), Material.CLUTTER),))


def boxes(rng: np.random.Generator) -> Piece:
    """One to three cartons put down without care."""
    solids = []
    for k in range(int(rng.integers(1, 4))):
        size = (rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.4))
        place_x = (k - 1) * 0.35 + rng.normal(0.0, 0.05)
        solids.append(_solid(box(place_x, 0.35, size, rng.normal(0.0, 0.4)), Material.CLUTTER))
    return Piece(1.2, 0.65, tuple(solids))


def pillar(rng: np.random.Generator) -> Piece:
    """A round or square column that carries the roof."""
    size = rng.uniform(0.3, 0.6)
    polygon = disc(0.0, size / 2.0, size / 2.0) if rng.random() < 0.5 else box(0.0, size / 2.0, (size, size))
    return Piece(size, size, (_solid(polygon, Material.WALL),))


def partition(rng: np.random.Generator) -> Piece:
    """A free-standing screen with a desk on each side: the island of an open-plan office."""
    front, back = desk(rng), desk(rng)
    width = max(front.width_m, back.width_m)
    depth = front.depth_m + back.depth_m
    solids = place(front, 0.0, back.depth_m, 0.0) + place(back, 0.0, back.depth_m, math.pi)
    solids.append(_solid(box(0.0, back.depth_m, (width, _PANEL_M * 1.5))))
    return Piece(width, depth, tuple(solids))


PieceMaker = Callable[[np.random.Generator], Piece]
"""Makes a piece; two calls with equal generators give equal pieces."""


def pilaster(rng: np.random.Generator) -> Piece:
    """What makes walls uneven: a pilaster, a radiator, a pipe duct."""
    width, depth = rng.uniform(0.2, 1.2), rng.uniform(0.06, 0.18)
    return Piece(width, depth, (_solid(box(0.0, depth / 2.0, (width, depth)), Material.WALL),))


def oddment(rng: np.random.Generator) -> Piece:
    """Something small that lies about: a bag, a fan, a cable drum, a stack of paper, a leg of something."""
    size = float(min(0.05 + rng.exponential(0.07), 0.35))
    if size < 0.1 or rng.random() < 0.3:
        polygon = disc(0.0, size / 2.0, size / 2.0, 4)
    else:
        polygon = box(0.0, size / 2.0, (size, size * rng.uniform(0.3, 1.0)), rng.uniform(-0.6, 0.6))
    return Piece(size, size, (_solid(polygon, Material.CLUTTER),))


def pier(rng: np.random.Generator) -> Piece:
    """A pier between two windows, or the body of a radiator: rows of them make the bays of an outer wall."""
    width, depth = rng.uniform(0.15, 0.5), rng.uniform(0.1, 0.35)
    return Piece(width, depth, (_solid(box(0.0, depth / 2.0, (width, depth)), Material.WALL),))


def stool_group(rng: np.random.Generator) -> Piece:
    """A small table on legs with a few chairs around it."""
    width, depth = rng.uniform(0.7, 1.2), rng.uniform(0.6, 0.9)
    solids = [_leg(x, 0.4 + y) for x in (-width / 2.0, width / 2.0) for y in (0.0, depth)]
    for x, y in ((-width / 2.0 - 0.2, 0.8), (width / 2.0 + 0.2, 0.8), (0.0, 0.2), (0.0, depth + 0.6)):
        if rng.random() < 0.6:
            solids += _chair(rng, x, y)
    return Piece(width + 0.8, depth + 0.9, tuple(solids))
