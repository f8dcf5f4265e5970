"""Distance of every point to the nearest point of another group, for all groups at once (numba).

A k-d tree of "all the others" would have to be built anew for each group. Here all points are sorted once into square
bins, row by row, so small that the few around a point hold some twenty: a window around a point is a few runs of
sorted points, which are compared without a branch. Points with none near look at rings of blocks of bins, past blocks
that hold nothing but their own group, until no nearer point can follow.
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Bins = tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], Array]
"""Where each bin begins; the numbers of the points, bin by bin; the one group of each block, or a mark."""
Layout = tuple[int, int, float]
"""Rows and columns of bins, and the side of a bin, metres."""

_POINTS_PER_BIN = 0.5
_BLOCK = 6
"""Bins along a side of a block."""
_EMPTY, _MIXED = -1.0, -2.0


def nearest_other_m(points: Array, group: Integers) -> Array:
    """Distance of each point to the nearest point of another group.

    Args:
        points: (N, 2) finite points of all groups in one frame, metres.
        group: (N,) number of each point's group, at least 0.

    Returns:
        (N,) distances, metres; infinity where there is no other group.
    """
    if len(points) == 0 or (group == group[0]).all():
        return np.full(len(points), math.inf)
    low, high = (np.array([pick(points[:, 0]), pick(points[:, 1])]) for pick in (np.min, np.max))
    size = np.maximum(high - low, 1e-9)
    side = max(math.sqrt(size[0] * size[1] * _POINTS_PER_BIN / len(points)), float(size.max()) / len(points))
    cols, rows = (int(n) + 1 for n in size // side)
    return np.asarray(_search(points - low, group, (rows, cols, side)))


@njit(cache=True, nogil=True)
def _search(points: Array, group: Integers, layout: Layout) -> Array:
    rows, cols, side = layout
    starts, order, owners = _sort_into_bins(points, group, layout)
    x, y = points[order, 0], points[order, 1]
    groups = group[order].astype(np.float64)  # as wide as what is compared beside it
    distances = np.empty(len(points))
    for k in range(len(points)):
        best = np.inf
        for radius in (side, _BLOCK * side):
            near = min(radius, math.sqrt(best))
            first, last = max(int((x[k] - near) / side), 0), min(int((x[k] + near) / side), cols - 1)
            for row in range(max(int((y[k] - near) / side), 0), min(int((y[k] + near) / side), rows - 1) + 1):
                run = starts[row * cols + first], starts[row * cols + last + 1]
                best = _scan_run((x, y, groups), k, run, best)
            if best <= radius * radius:
                break
        else:
            best = _search_blocks((x, y, groups), k, (starts, owners), layout, best)
        distances[order[k]] = math.sqrt(best)
    return distances


@njit(cache=True, nogil=True)
def _sort_into_bins(points: Array, group: Integers, layout: Layout) -> Bins:
    rows, cols, side = layout
    bins, order = np.empty(len(points), dtype=np.int32), np.empty(len(points), dtype=np.int32)
    starts = np.zeros(rows * cols + 2, dtype=np.int32)  # one ahead: what is filled moves on to where it ends
    owners = np.full((rows // _BLOCK + 1, cols // _BLOCK + 1), _EMPTY)
    for k in range(len(points)):
        row, col = min(int(points[k, 1] / side), rows - 1), min(int(points[k, 0] / side), cols - 1)
        bins[k] = row * cols + col
        starts[bins[k] + 2] += 1
        owner = owners[row // _BLOCK, col // _BLOCK]
        owners[row // _BLOCK, col // _BLOCK] = group[k] if owner == _EMPTY or owner == group[k] else _MIXED
    for k in range(2, len(starts)):
        starts[k] += starts[k - 1]
    for k in range(len(points)):
        order[starts[bins[k] + 1]] = k
        starts[bins[k] + 1] += 1
    return starts[:-1], order, owners


@njit(cache=True, nogil=True)
def _search_blocks(
    points: tuple[Array, Array, Array], k: int, bins: tuple[npt.NDArray[np.int32], Array], layout: Layout, best: float
) -> float:
    """The least squared distance of point k to another group, or infinity; ``best`` is the least so far."""
    (x, y, groups), (starts, owners), (rows, cols, side) = points, bins, layout
    wide = side * _BLOCK
    row, col = int(y[k] / wide), int(x[k] / wide)
    for ring in range(max(owners.shape) + 1):
        if ring > 0 and best <= ((ring - 1) * wide) ** 2:  # nothing of this ring is nearer
            break
        for r in range(max(row - ring, 0), min(row + ring, owners.shape[0] - 1) + 1):
            step = 1 if abs(r - row) == ring else max(2 * ring, 1)
            for c in range(col - ring, col + ring + 1, step):
                if not 0 <= c < owners.shape[1] or owners[r, c] == _EMPTY or owners[r, c] == groups[k]:
                    continue
                dx = max(c * wide - x[k], x[k] - (c + 1) * wide, 0.0)
                dy = max(r * wide - y[k], y[k] - (r + 1) * wide, 0.0)
                if dx * dx + dy * dy < best:
                    for inner in range(r * _BLOCK, min((r + 1) * _BLOCK, rows)):
                        first, end = inner * cols + c * _BLOCK, inner * cols + min((c + 1) * _BLOCK, cols)
                        best = _scan_run(points, k, (starts[first], starts[end]), best)
    return best


@njit(inline="always")
def _scan_run(points: tuple[Array, Array, Array], k: int, run: tuple[int, int], best: float) -> float:
    """The least of ``best`` and the squared distances of point k to those of a run that belong to another group."""
    x, y, groups = points
    for m in range(run[0], run[1]):
        dx, dy = x[m] - x[k], y[m] - y[k]
        squared = dx * dx + dy * dy
        best = min(best, squared if groups[m] != groups[k] else np.inf)
    return best
