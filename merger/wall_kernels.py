"""Hot loops of the robust method: how the walls of one map fall onto another (numba)."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""Values of `Fields.state`."""

NUM_SUMS = 8
"""Length of what `compare_walls` returns."""


class Walls(NamedTuple):
    """Wall points of one map, frame ``field``."""

    points: Array
    """(N, 2) places, metres."""
    normals: Array
    """(N, 2) unit normals, sign arbitrary."""
    facing: Array
    """(N, 2) direction to the free side, of length 0 (free all round, or nowhere) to 1 (one side wholly free)."""
    linearity: Array
    """(N,) 0..1: how much the wall about a point is a line, 0 for a lone point or a corner."""
    lengths_m: Array
    """(N,) wall length that each point stands for, metres."""


class Fields(NamedTuple):
    """What a map answers at any place, frame ``field``."""

    distance_m: npt.NDArray[np.float32]
    """(H, W) distance of each cell's centre to the nearest wall, metres."""
    nearest: npt.NDArray[np.int32]
    """(H, W) number of the nearest wall point."""
    state: npt.NDArray[np.uint8]
    """(H, W) `UNKNOWN`, `FREE` or `OCCUPIED`."""
    resolution_m: float
    """Cell side, metres."""


@njit(cache=True, nogil=True)
def refine_motion(  # noqa: PLR0917 # numba takes no keyword-only arguments
    T_start: Array,
    source: Walls,
    target: Walls,
    source_all: Walls,
    target_all: Walls,
    source_fields: Fields,
    target_fields: Fields,
    cutoffs_m: Array,
    tolerance: float,
) -> Any:
    """Gauss-Newton steps on the point-to-wall residuals of both directions, the cut-off falling.

    Args:
        T_start: (3, 3) start, ``T_target_source`` between the frames ``field``.
        source: Points of the source that are compared.
        target: Points of the target that are compared.
        source_all: All points of the source, which its fields name.
        target_all: All points of the target, which its fields name.
        source_fields: Fields of the source.
        target_fields: Fields of the target.
        cutoffs_m: (K,) cut-off of each step, metres.
        tolerance: A step shorter than this, at the last cut-off, ends the work.

    Returns:
        (3, 3) refined motion.
    """
    T: Any = T_start.copy()
    for k in range(len(cutoffs_m)):
        A, b = np.zeros((3, 3)), np.zeros(3)
        add_equations(T, source, target_all, target_fields, cutoffs_m[k], False, A, b)
        T_source_target: Any = _invert(T)
        add_equations(T_source_target, target, source_all, source_fields, cutoffs_m[k], True, A, b)
        step = _solve_damped(A, b)
        T = _exponential(step) @ T
        if cutoffs_m[k] == cutoffs_m[-1] and np.abs(step).max() < tolerance:
            break
    return T


@njit(cache=True, nogil=True)
def add_equations(  # noqa: PLR0917 # numba takes no keyword-only arguments
    T: Array, walls: Walls, to: Walls, fields: Fields, cutoff_m: float, flip: bool, A: Array, b: Array
) -> None:
    """Add the residuals of one map's walls against another's to the upper half of A (3, 3) and to b (3,).

    The unknown is v in ``exp(v) @ T_target_source``, about the origin of the target's frame ``field``. With ``flip``
    the walls belong to the target, and T maps the target into the source. A wall pins a motion along its normal, and
    along itself with a small share that keeps the system regular. Weights, in metres of wall, fall to zero at the
    cut-off (Tukey).
    """
    for k in range(len(walls.points)):
        x, y = _transform(T, walls.points[k])
        row, col = _cell(x, y, fields)
        if row < 0 or fields.distance_m[row, col] >= cutoff_m:
            continue
        n = fields.nearest[row, col]
        dx, dy = x - to.points[n, 0], y - to.points[n, 1]
        u = (dx * dx + dy * dy) / (cutoff_m * cutoff_m)
        if u >= 1.0 or _turned_product(T, walls.facing[k], to.facing[n]) < -0.3:
            continue  # too far, or the opposite face of a wall
        line = walls.linearity[k] * to.linearity[n]
        same = abs(_turned_product(T, walls.normals[k], to.normals[n]))
        weight = walls.lengths_m[k] * (1.0 - u) * (1.0 - u) * (1.0 - line * (1.0 - same))
        nx, ny = to.normals[n, 0], to.normals[n, 1]
        px, py = x, y
        if flip:  # residual, place and normal in the target's frame
            dx, dy = -(T[0, 0] * dx + T[1, 0] * dy), -(T[0, 1] * dx + T[1, 1] * dy)
            nx, ny = T[0, 0] * nx + T[1, 0] * ny, T[0, 1] * nx + T[1, 1] * ny
            px, py = walls.points[k, 0] + dx, walls.points[k, 1] + dy
        _add(A, b, px, py, nx, ny, dx * nx + dy * ny, weight)
        _add(A, b, px, py, -ny, nx, -dx * ny + dy * nx, weight * (1.0 - 0.9 * line))


@njit(cache=True, nogil=True)
def compare_walls(  # noqa: PLR0917 # numba takes no keyword-only arguments
    T: Array, walls: Walls, to: Walls, fields: Fields, near_m: float, far_m: float, tight_m: float, facing: float
) -> Any:
    """Sum up how one map's walls fall on another map.

    Args:
        T: (3, 3) motion of the walls' map into the other, frames ``field``.
        walls: The walls.
        to: The other map's walls.
        fields: The other map's fields.
        near_m: Nearer walls agree.
        far_m: Walls in free space farther from any wall than this conflict.
        tight_m: Width of the kernel that measures tightness.
        facing: Walls whose free sides' product is below minus this are opposite faces.

    Returns:
        (8,) metres: near, opposed, conflict, loose, tight; and xx, xy, yy of the sum of outer products of the
        normals of near walls, each times its length, in the walls' own frame.
    """
    sums = np.zeros(NUM_SUMS)
    for k in range(len(walls.points)):
        x, y = _transform(T, walls.points[k])
        row, col = _cell(x, y, fields)
        if row < 0:
            continue
        distance, length = fields.distance_m[row, col], walls.lengths_m[k]
        if distance > near_m:
            sums[2] += length * (distance > far_m and fields.state[row, col] == FREE)
            sums[3] += length * (distance <= far_m and fields.state[row, col] != UNKNOWN)
        elif _turned_product(T, walls.facing[k], to.facing[fields.nearest[row, col]]) < -facing:
            sums[1] += length
        else:
            sums[0] += length
            sums[4] += length * np.exp(-0.5 * (distance / tight_m) ** 2)
            line, nx, ny = walls.linearity[k], walls.normals[k, 0], walls.normals[k, 1]
            sums[5] += length * (line * nx * nx + 0.5 * (1.0 - line))
            sums[6] += length * line * nx * ny
            sums[7] += length * (line * ny * ny + 0.5 * (1.0 - line))
    return sums


@njit(cache=True, nogil=True)
def count_free(T: Array, points: Array, fields: Fields) -> int:
    """Number of (N, 2) points that T (3, 3) puts into free cells."""
    count = 0
    for k in range(len(points)):
        x, y = _transform(T, points[k])
        row, col = _cell(x, y, fields)
        count += row >= 0 and fields.state[row, col] == FREE
    return count


@njit(cache=True, nogil=True)
def _solve_damped(A: Array, b: Array) -> Any:
    """The step of the upper half of A (3, 3) and b (3,); what nothing pins stays."""
    trace = A[0, 0] + A[1, 1] + A[2, 2]
    for d in range(3):
        A[d, d] += (1e-3 if d < 2 else 1e-2) + 1e-9 * trace
        for e in range(d):
            A[d, e] = A[e, d]
    return np.linalg.solve(A, b)


@njit(cache=True, nogil=True)
def _transform(T: Array, point: Array) -> tuple[float, float]:
    return (
        T[0, 0] * point[0] + T[0, 1] * point[1] + T[0, 2],
        T[1, 0] * point[0] + T[1, 1] * point[1] + T[1, 2],
    )


@njit(cache=True, nogil=True)
def _turned_product(T: Array, a: Array, b: Array) -> float:
    """Scalar product of T's rotation of (2,) a with (2,) b."""
    return float((T[0, 0] * a[0] + T[0, 1] * a[1]) * b[0] + (T[1, 0] * a[0] + T[1, 1] * a[1]) * b[1])


@njit(cache=True, nogil=True)
def _cell(x: float, y: float, fields: Fields) -> tuple[int, int]:
    """Row and column of a place; (-1, -1) outside."""
    row, col = int(np.floor(y / fields.resolution_m)), int(np.floor(x / fields.resolution_m))
    if row < 0 or col < 0 or row >= fields.state.shape[0] or col >= fields.state.shape[1]:
        return -1, -1
    return row, col


@njit(cache=True, nogil=True)
def _add(  # noqa: PLR0917 # numba takes no keyword-only arguments
    A: Array, b: Array, px: float, py: float, nx: float, ny: float, residual: float, weight: float
) -> None:
    """Add one scalar residual ``residual + (n, n x p) v`` to the normal equations."""
    turn = -nx * py + ny * px
    A[0, 0] += weight * nx * nx
    A[0, 1] += weight * nx * ny
    A[0, 2] += weight * nx * turn
    A[1, 1] += weight * ny * ny
    A[1, 2] += weight * ny * turn
    A[2, 2] += weight * turn * turn
    b[0] -= weight * nx * residual
    b[1] -= weight * ny * residual
    b[2] -= weight * turn * residual


@njit(cache=True, nogil=True)
def _invert(T: Array) -> Any:
    R = T[:2, :2].T.copy()
    inverse = np.eye(3)
    inverse[:2, :2] = R
    inverse[:2, 2] = -(R @ T[:2, 2].copy())
    return inverse


@njit(cache=True, nogil=True)
def _exponential(v: Array) -> Any:
    """A rigid motion near ``exp(v)``: the same to first order, which is all a Gauss-Newton step needs."""
    c, s = np.cos(v[2]), np.sin(v[2])
    return np.array([[c, -s, v[0]], [s, c, v[1]], [0.0, 0.0, 1.0]])
