"""The hot loop of the alignment: walls pull the walls near them onto themselves, in both directions at once."""

from typing import Any

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.wall_kernels import (
    View,
    Walls,
    columns_of,
    distances_of,
    find_cells,
    move_points,
    split_numbers,
    turned_product,
)

Array = npt.NDArray[np.float64]

_FACING = 0.3
"""Walls whose free sides' product is below minus this are opposite faces, which do not attract each other."""


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
    A, b = _one_way(T, source.sample, target, cutoff_m, at_wall=False)
    T_source_target = se2.invert(T)
    A_source, b_source = _one_way(T_source_target, target.sample, source, cutoff_m, at_wall=True)
    # exp(v) T moves the source's walls by exp(Ad v) in the source's own frame.
    J = se2.adjoint(T_source_target)
    J_T = np.swapaxes(J, 1, 2)
    return A + J_T @ A_source @ J, b + (J_T @ b_source[:, :, None])[:, :, 0]


def _one_way(T: Array, walls: Walls, other: View, cutoff_m: float, at_wall: bool) -> tuple[Array, Array]:
    """Normal equations of one map's walls, moved by (K, 3, 3) T, onto another map, in the other map's frame ``field``.

    A wall pins a motion along its normal, and along itself with a small share that keeps the system regular.
    Weights, in metres of wall, fall to zero at the cut-off (Tukey). With ``at_wall`` the other map's walls are those
    that move.
    """
    x, y = (values.ravel() for values in move_points(T, walls.points))
    cells = find_cells(x, y, other.fields)
    near = np.flatnonzero(distances_of(other.fields, cells) < cutoff_m)
    motion, point = split_numbers(near, len(walls.points))
    to = other.fields.nearest.ravel()[cells[near]]
    px, py = other.walls.points[:, 0][to], other.walls.points[:, 1][to]
    dx, dy = x[near] - px, y[near] - py
    nx, ny = other.walls.normals[:, 0][to], other.walls.normals[:, 1][to]
    weight, along = _weights(T, walls, other.walls, (motion, point, to), (dx * dx + dy * dy) / (cutoff_m * cutoff_m))
    if at_wall:
        dx, dy = -dx, -dy
    else:
        px, py = x[near], y[near]
    rows = _accumulate((dx, dy), (px, py), (nx, ny), weight, along)
    sums = np.stack([np.bincount(motion, row, len(T)) for row in rows], axis=-1, dtype=np.float64)
    return sums[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3), sums[:, 6:]


def _accumulate(
    apart: tuple[Array, Array], place: tuple[Array, Array], normal: tuple[Array, Array], weight: Array, along: Array
) -> tuple[Array, ...]:
    """Summands of xx, xy, xt, yy, yt, tt of A, and of x, y, t of b, t the turn about the origin.

    Args:
        apart: How far walls are apart, metres.
        place: Where.
        normal: The direction of the first residual; the second one's is turned by a quarter turn.
        weight: Weight of the first residual.
        along: Weight of the second one.
    """
    (dx, dy), (px, py), (nx, ny) = apart, place, normal
    across_r, along_r = dx * nx + dy * ny, dy * nx - dx * ny
    across_t, along_t = ny * px - nx * py, nx * px + ny * py
    across_n, across_m = weight * nx, weight * ny
    along_n, along_m = along * nx, along * ny
    return (
        across_n * nx + along_m * ny,
        across_n * ny - along_m * nx,
        across_n * across_t - along_m * along_t,
        across_m * ny + along_n * nx,
        across_m * across_t + along_n * along_t,
        weight * across_t * across_t + along * along_t * along_t,
        along_m * along_r - across_n * across_r,
        -across_m * across_r - along_n * along_r,
        -weight * across_t * across_r - along * along_t * along_r,
    )


def _weights(
    T: Array, walls: Walls, to: Walls, numbers: tuple[npt.NDArray[np.integer[Any]], ...], u: Array
) -> tuple[Array, Array]:
    """Weight of each residual across and along its wall; u is the squared distance in squared cut-offs."""
    motion, point, other = numbers
    c, s = T[:, 0, 0][motion], T[:, 1, 0][motion]
    facing = turned_product(c, s, *columns_of(walls.facing, point), *columns_of(to.facing, other))
    same = np.abs(turned_product(c, s, *columns_of(walls.normals, point), *columns_of(to.normals, other)))
    line = walls.linearity[point] * to.linearity[other]
    kernel = np.where(facing < -_FACING, 0.0, np.maximum(1.0 - u, 0.0))
    weight = walls.lengths_m[point] * kernel * kernel * (1.0 - line * (1.0 - same))
    return weight, weight * (1.0 - 0.9 * line)


def _solve_damped(A: Array, b: Array) -> Array:
    """The (K, 3) steps of (K, 3, 3) A and (K, 3) b; what nothing pins stays."""
    trace = np.trace(A, axis1=1, axis2=2)
    damping = np.array([1e-3, 1e-3, 1e-2]) + 1e-9 * trace[:, None]
    return np.linalg.solve(A + damping[:, :, None] * np.eye(3), b[:, :, None])[:, :, 0]


def _exponential(v: Array) -> Array:
    """Rigid motions near ``exp(v)``: the same to first order, which is all a Gauss-Newton step needs."""
    return se2.make_motion(v[:, 0], v[:, 1], v[:, 2])
