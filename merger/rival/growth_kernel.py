"""Two matches grow into the largest set of places that agree: the loop of the modified RANSAC [Blanco13] (numba)."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

_Array = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def grow_set(
    points_target: _Array, points_source: _Array, pair: npt.NDArray[np.int64], noise_m: float, gate: float
) -> Any:
    """Add the two free points that most probably are one place, fit again, and so on until none passes the gate.

    The offset of two points has the covariance ``noise^2 ((2 + 1/n) I + p p^T / d)``: both are noisy, and so is the
    motion fitted to n matches; p is the source point, turned, seen from the centre of the matched ones and rotated by
    90 degrees, and d the sum of the squares of these around their centre.

    Note: MRPT looks at the three target points nearest to each source point; here it is all within the gate.

    Args:
        points_target: (N, 2) points of the map that stays, metres, in ascending order of x.
        points_source: (M, 2) points of the map that moves.
        pair: (2, 2) the first matches ``(target, source)``, of points that are apart.
        noise_m: Standard deviation of a coordinate.
        gate: Largest squared Mahalanobis distance of a match.

    Returns:
        (K, 2) matches ``(target, source)`` in the order in which they were added, each point in one at most.
    """
    matches = np.empty((min(len(points_target), len(points_source)), 2), np.int64)
    free_target = np.ones(len(points_target), np.bool_)
    free_source = np.ones(len(points_source), np.bool_)
    sums = np.zeros(8)
    i, j, count = pair[0, 0], pair[0, 1], 0
    while i >= 0:
        matches[count, 0], matches[count, 1] = i, j
        free_target[i] = free_source[j] = False
        count += 1
        _add(sums, points_target[i], points_source[j])
        if count == 1:
            i, j = pair[1, 0], pair[1, 1]
        else:
            i, j = _find_best(points_target, points_source, (free_target, free_source), _fit(sums), (noise_m, gate))
    return matches[:count]


@njit(cache=True, nogil=True)
def _add(sums: _Array, target: _Array, source: _Array) -> None:
    """Add a match to the sums that `_fit` needs."""
    sums[0] += 1.0
    sums[1:3] += target
    sums[3:5] += source
    sums[5] += source[0] * target[0] + source[1] * target[1]
    sums[6] += source[0] * target[1] - source[1] * target[0]
    sums[7] += source[0] ** 2 + source[1] ** 2


@njit(cache=True, nogil=True)
def _fit(sums: _Array) -> Any:
    """Count, cosine and sine, shift of x and y, turned centre of the source, its sum of squares around the centre."""
    count = sums[0]
    tx, ty, sx, sy = sums[1:5] / count
    cosine = sums[5] - count * (sx * tx + sy * ty)
    sine = sums[6] - count * (sx * ty - sy * tx)
    length = math.hypot(cosine, sine)
    c, s = cosine / length, sine / length
    cx, cy = c * sx - s * sy, s * sx + c * sy
    return count, c, s, tx - cx, ty - cy, cx, cy, sums[7] - count * (sx * sx + sy * sy)


@njit(cache=True, nogil=True)
def _find_best(
    points_target: _Array,
    points_source: _Array,
    free: Any,
    fit: Any,
    limits: tuple[float, float],
) -> Any:
    """Numbers of the free target and source point that most probably are one place; -1 without any."""
    free_target, free_source = free
    count, c, s, x0, y0, cx, cy, spread = fit
    noise_m, gate = limits
    best, best_i, best_j = -np.inf, -1, -1
    for j in range(len(points_source)):
        if not free_source[j]:
            continue
        x, y = points_source[j]
        px, py = cy - s * x - c * y, c * x - s * y - cx  # from the centre, rotated by 90 degrees
        arm = px * px + py * py
        along = noise_m**2 * (2.0 + 1.0 / count)
        across = along + noise_m**2 * arm / spread
        x, y, reach = py + cx + x0, cy - px + y0, math.sqrt(gate * across)
        for i in range(np.searchsorted(points_target[:, 0], x - reach), len(points_target)):
            dx, dy = points_target[i, 0] - x, points_target[i, 1] - y
            if dx > reach:
                break
            if free_target[i] and abs(dy) <= reach:
                part = (px * dx + py * dy) ** 2 / arm if arm > 0.0 else 0.0
                squared = (dx * dx + dy * dy - part) / along + part / across
                value = -0.5 * (squared + math.log(across))
                if squared <= gate and value > best:
                    best, best_i, best_j = value, i, j
    return best_i, best_j
