"""The hot loop of the alignment: walls pull the walls near them onto themselves, in both directions at once."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.wall_kernels import (
    View,
    Walls,
    distances_of,
    find_cells,
    move_points,
    split_numbers,
    turned_product,
)

Array = npt.NDArray[np.float64]

_FACING = 0.3
"""Walls whose free sides' product is below minus this are opposite faces, which do not attract each other."""
_ALONG = 0.1
"""A wall pins a motion along itself with this share of its weight, which keeps the system regular."""


class _Meetings(NamedTuple):
    """The (M,) walls of one map that lie near walls of another, motion by motion."""

    motion: npt.NDArray[np.intp]
    """Number of the motion, rising."""
    place: Array
    """(2, M) where the walls are moved, metres, the other map's frame ``field``."""
    foot: Array
    """(2, M) the walls they meet."""
    normal: Array
    """(2, M) whose normals."""
    across: Array
    """Weight of the residual along the normal, metres of wall: zero at the cut-off (Tukey)."""
    along: Array
    """Weight of the residual along the wall."""


def refine_motions(T_start: Array, target: View, source: View, cutoffs_m: tuple[float, ...], tolerance: float) -> Array:
    """Gauss-Newton steps on the point-to-wall residuals of both directions, the cut-off falling.

    Args:
        T_start: (K, 3, 3) starts, ``T_target_source`` between the frames ``field``; each is refined by itself.
        target: The map that stays.
        source: The map that moves.
        cutoffs_m: Cut-off of each step, metres.
        tolerance: A step shorter than this, at the last cut-off, ends the work.

    Returns:
        (K, 3, 3) refined motions.
    """
    T = T_start.copy()
    moving = np.arange(len(T))
    for cutoff_m in cutoffs_m:
        A, b = sum_equations(T[moving], target, source, cutoff_m)
        steps = _solve_damped(A, b)
        T[moving] = _exponential(steps) @ T[moving]
        if cutoff_m == cutoffs_m[-1]:
            moving = moving[np.abs(steps).max(axis=1) >= tolerance]
            if len(moving) == 0:
                break
    return T


def sum_equations(T: Array, target: View, source: View, cutoff_m: float) -> tuple[Array, Array]:
    """Normal equations ``A v = b`` of both directions, for ``exp(v) @ T`` about the origin of the target's ``field``.

    Args:
        T: (K, 3, 3) motions ``T_target_source`` between the frames ``field``.
        target: The map that stays.
        source: The map that moves.
        cutoff_m: Walls farther apart have no say, metres.

    Returns:
        (K, 3, 3) A and (K, 3) b; weights are metres of wall.
    """
    A, b = _accumulate(_meet(T, source.sample, target, cutoff_m), len(T), at_wall=False)
    T_source_target = se2.invert(T)
    A_source, b_source = _accumulate(_meet(T_source_target, target.sample, source, cutoff_m), len(T), at_wall=True)
    # exp(v) T moves the source's walls by exp(Ad v) in the source's own frame.
    J = se2.adjoint(T_source_target)
    J_T = np.swapaxes(J, 1, 2)
    return A + J_T @ A_source @ J, b + (J_T @ b_source[:, :, None])[:, :, 0]


def sum_equations_onto(T: Array, walls: Sequence[Walls], other: View, cutoff_m: Array) -> tuple[Array, Array]:
    """Normal equations ``A v = b`` of the walls of several maps on one other map, for ``exp(v) @ T``.

    Args:
        T: (K, 3, 3) motions of the K maps into the other, frames ``field``.
        walls: Their walls.
        other: The other map.
        cutoff_m: (K,) walls farther apart have no say, metres.

    Returns:
        (K, 3, 3) A and (K, 3) b of this one direction; weights are metres of wall.
    """
    return _accumulate(_meet_many(T, walls, other, cutoff_m), len(T), at_wall=False)


def sum_gaps_onto(T: Array, walls: Sequence[Walls], other: View, cutoff_m: Array) -> tuple[Array, Array]:
    """How far the walls of several maps are from those of one other map, across these.

    Args:
        T: See `sum_equations_onto`.
        walls: See `sum_equations_onto`.
        other: See `sum_equations_onto`.
        cutoff_m: (K,) walls farther apart do not meet, metres.

    Returns:
        (K,) sums of weight times squared distance, m^3, and (K,) of the weights, metres.
    """
    met = _meet_many(T, walls, other, cutoff_m)
    gaps = ((met.place - met.foot) * met.normal).sum(axis=0)
    squares, weights = (np.bincount(met.motion, values, len(T)) for values in (met.across * gaps**2, met.across))
    return squares.astype(np.float64), weights.astype(np.float64)


def _meet(T: Array, walls: Walls, other: View, cutoff_m: float) -> _Meetings:
    """Find which walls (K, 3, 3) T moves to within the cut-off of another map's walls, and weigh them."""
    x, y = (values.ravel() for values in move_points(T, walls.points))
    cells = find_cells(x, y, other.fields)
    near = np.flatnonzero(distances_of(other.fields, cells) < cutoff_m)
    motion, point = split_numbers(near, len(walls.points))
    met = other.walls.columns_of(other.fields.nearest.ravel().take(cells.take(near)))
    place = np.stack([x.take(near), y.take(near)])
    return _weigh(T, motion, place, (walls.columns_of(point), met), cutoff_m)


def _meet_many(T: Array, walls: Sequence[Walls], other: View, cutoff_m: Array) -> _Meetings:
    """The same for K maps, each moved by its own motion, with its own cut-off: in one call on long arrays."""
    first = np.cumsum([0, *(len(item.table) for item in walls)])
    moved = [move_points(one, item.points) for one, item in zip(T[:, None], walls, strict=True)]
    x, y = (np.concatenate([places[axis][0] for places in moved]) for axis in (0, 1))
    cells = find_cells(x, y, other.fields)
    near = np.flatnonzero(distances_of(other.fields, cells) < np.repeat(cutoff_m, np.diff(first)))
    met = other.walls.columns_of(other.fields.nearest.ravel().take(cells.take(near)))
    ends = near.searchsorted(first)
    parts = zip(walls, first, pairwise(ends), strict=False)
    own = np.hstack([item.columns_of(near[start:end] - number) for item, number, (start, end) in parts])
    place, motion = np.stack([x.take(near), y.take(near)]), np.repeat(np.arange(len(T)), np.diff(ends))
    return _weigh(T, motion, place, (own, met), cutoff_m.take(motion))


def _weigh(
    T: Array, motion: npt.NDArray[np.intp], place: Array, tables: tuple[Array, Array], cutoff_m: Array | float
) -> _Meetings:
    """Weigh (M,) walls at ``place`` by those they meet, given the tables of both (see `Walls`)."""
    own, met = tables
    c, s = T[0, :2, 0] if len(T) == 1 else T[:, :2, 0].T.take(motion, axis=1)
    facing = turned_product(c, s, own[4], own[5], met[4], met[5])
    same = np.abs(turned_product(c, s, own[2], own[3], met[2], met[3]))
    line = own[6] * met[6]
    dx, dy = place - met[:2]
    kernel = np.maximum(1.0 - (dx * dx + dy * dy) * (1.0 / cutoff_m**2), 0.0)
    kernel[facing < -_FACING] = 0.0
    across = own[7] * kernel * kernel * (1.0 - line * (1.0 - same))
    return _Meetings(motion, place, met[:2], met[2:4], across, across * (1.0 - (1.0 - _ALONG) * line))


def _accumulate(met: _Meetings, count: int, at_wall: bool) -> tuple[Array, Array]:
    """Normal equations, (K, 3, 3) and (K, 3), in the frame in which walls meet; K is ``count``.

    With ``at_wall`` the other map's walls are those that move.
    """
    (px, py), (nx, ny) = met.foot if at_wall else met.place, met.normal
    dx, dy = met.foot - met.place if at_wall else met.place - met.foot
    rows = np.empty((4, len(nx), 2))  # each wall's residual across and, beside it, the one along
    rows[0, :, 0], rows[1, :, 0], rows[2, :, 0], rows[3, :, 0] = nx, ny, ny * px - nx * py, dx * nx + dy * ny
    rows[0, :, 1], rows[1, :, 1], rows[2, :, 1], rows[3, :, 1] = -ny, nx, nx * px + ny * py, dy * nx - dx * ny
    weighted = (rows * np.stack([met.across, met.along], axis=-1)).reshape(4, -1)
    flat = rows.reshape(4, -1)
    ends = (2 * np.searchsorted(met.motion, np.arange(count + 1))).tolist()
    sums = np.array([flat[:, start:end] @ weighted[:, start:end].T for start, end in pairwise(ends)])
    return sums[:, :3, :3], -sums[:, :3, 3]


def _solve_damped(A: Array, b: Array) -> Array:
    """The (K, 3) steps of (K, 3, 3) A and (K, 3) b; what nothing pins stays."""
    trace = np.trace(A, axis1=1, axis2=2)
    damping = np.array([1e-3, 1e-3, 1e-2]) + 1e-9 * trace[:, None]
    return np.linalg.solve(A + damping[:, :, None] * np.eye(3), b[:, :, None])[:, :, 0]


def _exponential(v: Array) -> Array:
    """Rigid motions near ``exp(v)``: the same to first order, which is all a Gauss-Newton step needs."""
    return se2.make_motion(v[:, 0], v[:, 1], v[:, 2])
