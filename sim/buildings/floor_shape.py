"""The shape of a building: its footprint, its corridors and halls, as rectangles on a lattice of 0.1 m.

Every style is a different idea of how people get about: a spine, wings that meet, a loop of corridors around a
block, a comb, a ladder of loops, a ring around a courtyard, a hall with rooms around it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

Rect = tuple[float, float, float, float]
"""x0, y0, x1, y1 in metres."""


class Style(StrEnum):
    """How the corridors run."""

    ANY = "any"
    """One of the others, by chance."""
    SPINE = "spine"
    """One corridor, rooms on both sides; it may end before the building does."""
    ANGLE = "angle"
    """Two wings that meet as an L or a T."""
    HORSESHOE = "horseshoe"
    """Three wings: a U or an H."""
    COURTYARD = "courtyard"
    """Four wings around a courtyard."""
    LOOP = "loop"
    """A loop of corridors around a block of rooms."""
    LADDER = "ladder"
    """A loop with cross corridors: two loops or more."""
    COMB = "comb"
    """A corridor with branches that end blindly."""
    HALL = "hall"
    """A hall with rooms around it."""


@dataclass(frozen=True)
class FloorShape:
    """A building without rooms; rectangles of one list may overlap."""

    footprint: list[Rect]
    """What is inside."""
    corridors: list[Rect]
    """Ways; connected with each other, or through the halls."""
    halls: list[Rect]
    """Open halls, which count as ways, too."""


def draw_shape(style: Style, size_m: tuple[float, float], corridor_m: float, rng: np.random.Generator) -> FloorShape:
    """Draw a shape at random.

    Args:
        style: How the corridors run.
        size_m: Width and depth of the whole building.
        corridor_m: Width of the corridors.
        rng: Of this building.
    """
    if style is Style.ANY:
        style = list(_DRAWERS)[int(rng.integers(len(_DRAWERS)))]
    return _DRAWERS[style](size_m[0], size_m[1], corridor_m, rng)


def _spine(w: float, h: float, c: float, rng: np.random.Generator) -> FloorShape:
    h = min(h, 18.0 + c)
    y = _near(h / 2.0, h * 0.12, rng) - c / 2.0
    x0 = rng.choice([0.0, rng.uniform(3.0, 6.0)])
    x1 = w - rng.choice([0.0, rng.uniform(3.0, 6.0)])
    hall = [(x1 - rng.uniform(4.0, 8.0), y - rng.uniform(0.0, 3.0), x1, y + c)] if rng.random() < 0.4 else []
    return FloorShape([(0.0, 0.0, w, h)], [(x0, y, x1, y + c)], hall)


def _angle(w: float, h: float, c: float, rng: np.random.Generator) -> FloorShape:
    depth = min(rng.uniform(9.0, 14.0), 0.6 * min(w, h))
    y = depth * rng.uniform(0.35, 0.6) - c / 2.0
    left = rng.choice([0.0, rng.uniform(0.25, 0.75) * (w - depth)])
    x = left + depth * rng.uniform(0.4, 0.6) - c / 2.0
    corridors = [(min(x, 0.0 if left else x), y, w, y + c), (x, y, x + c, h - rng.choice([0.0, 4.0]))]
    return FloorShape([(0.0, 0.0, w, depth), (left, 0.0, left + depth, h)], corridors, [])


def _horseshoe(w: float, h: float, c: float, rng: np.random.Generator) -> FloorShape:
    depth = min(rng.uniform(8.5, 12.0), 0.4 * w)
    base = rng.choice([0.0, (h - depth) * rng.uniform(0.3, 0.7)])
    y, x0, x1 = base + depth / 2.0 - c / 2.0, depth / 2.0 - c / 2.0, w - depth / 2.0 - c / 2.0
    low = y if base == 0.0 else 0.0
    h1 = h * rng.uniform(0.7, 1.0)
    wings = [(0.0, base, w, base + depth), (0.0, 0.0 if base else base, depth, h), (w - depth, 0.0, w, h1)]
    return FloorShape(wings, [(x0, y, x1 + c, y + c), (x0, low, x0 + c, h), (x1, low, x1 + c, h1)], [])


def _courtyard(w: float, h: float, c: float, rng: np.random.Generator) -> FloorShape:
    depth = min(rng.uniform(7.0, 11.0), 0.36 * min(w, h))
    wings = [(0.0, 0.0, w, depth), (0.0, h - depth, w, h), (0.0, 0.0, depth, h), (w - depth, 0.0, w, h)]
    inset = depth * rng.uniform(0.45, 0.75)
    return FloorShape(wings, _ring(inset, inset, w - inset, h - inset, c), [])


def _loop(w: float, h: float, c: float, rng: np.random.Generator) -> FloorShape:
    inset = min(rng.uniform(4.0, 6.5), 0.26 * min(w, h))
    corridors = _ring(inset, inset, w - inset, h - inset * rng.uniform(0.7, 1.3), c)
    return FloorShape([(0.0, 0.0, w, h)], corridors, [])


def _ladder(w: float, h: float, c: float, rng: np.random.Generator) -> FloorShape:
    inset = min(rng.uniform(3.6, 6.0), 0.24 * min(w, h))
    corridors = _ring(inset, inset, w - inset, h - inset, c)
    for k in range(1, count := int(rng.integers(2, 4))):
        x = inset + (w - 2.0 * inset) * k / count + rng.uniform(-1.0, 1.0)
        corridors.append((x, inset, x + c, h - inset))
    return FloorShape([(0.0, 0.0, w, h)], corridors, [])


def _comb(w: float, h: float, c: float, rng: np.random.Generator) -> FloorShape:
    y = rng.uniform(4.0, min(6.0, 0.4 * h))
    corridors, footprint = [(0.0, y, w, y + c)], [(0.0, 0.0, w, y + c + 4.0)]
    teeth = max(2, int(w / rng.uniform(11.0, 15.0)))
    for k in range(teeth):
        x = w * (k + 0.5) / teeth + rng.uniform(-0.8, 0.8)
        top = h * rng.uniform(0.75, 1.0)
        corridors.append((x, y, x + c, top - rng.choice([0.0, 3.5])))
        half = min(w / teeth / 2.0, rng.uniform(5.0, 8.0))
        footprint.append((max(x - half, 0.0), 0.0, min(x + c + half, w), top))
    return FloorShape(footprint, corridors, [])


def _hall(w: float, h: float, c: float, rng: np.random.Generator) -> FloorShape:
    w, h = min(w, rng.uniform(16.0, 30.0)), min(h, rng.uniform(14.0, 24.0))
    left, low, right, top = (rng.choice([0.0, rng.uniform(3.5, 6.0)]) for _ in range(4))
    left = left if left + right else 4.5
    hall = (left, low, w - right, h - top)
    corridors = [(w * 0.5 - c / 2.0, 0.0, w * 0.5 + c / 2.0, low + 0.5)] if low else []
    return FloorShape([(0.0, 0.0, w, h)], corridors, [hall])


def _ring(x0: float, y0: float, x1: float, y1: float, c: float) -> list[Rect]:
    return [(x0, y0, x1, y0 + c), (x0, y1 - c, x1, y1), (x0, y0, x0 + c, y1), (x1 - c, y0, x1, y1)]


def _near(value: float, spread: float, rng: np.random.Generator) -> float:
    return value + float(rng.uniform(-spread, spread))


_DRAWERS: dict[Style, Callable[[float, float, float, np.random.Generator], FloorShape]] = {
    Style.SPINE: _spine,
    Style.ANGLE: _angle,
    Style.HORSESHOE: _horseshoe,
    Style.COURTYARD: _courtyard,
    Style.LOOP: _loop,
    Style.LADDER: _ladder,
    Style.COMB: _comb,
    Style.HALL: _hall,
}
