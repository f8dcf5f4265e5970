"""Distance of every point to the nearest point of another group, for all groups at once (numba).

A k-d tree of "all the others" would have to be built anew for each group. Here all points are sorted into square bins
once; a search looks at rings of bins around a point until no nearer point can follow. Only points with none within a
few rings are looked up in trees.
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.spatial import cKDTree

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_POINTS_PER_BIN = 8.0
_RINGS = 16


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
    starts, order = _sort_into_bins(points - low, (rows, cols, side))
    distances = np.empty(len(points))
    distances[order] = _search((points - low)[order], group[order], starts, (rows, cols, side))
    for number in np.unique(group[np.isinf(distances)]):
        far = np.isinf(distances) & (group == number)
        tree = cKDTree(points[group != number], balanced_tree=False, compact_nodes=False)
        distances[far] = tree.query(points[far])[0]
    return distances


@njit(cache=True, nogil=True)
def _search(points: Array, group: Integers, starts: Integers, layout: tuple[int, int, float]) -> Array:
    rows, cols, side = layout
    distances = np.empty(len(points))
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        col, row = min(int(x / side), cols - 1), min(int(y / side), rows - 1)
        margin = min(x - col * side, (col + 1) * side - x, y - row * side, (row + 1) * side - y)
        best = np.inf
        found = False
        for ring in range(_RINGS):
            reach = max(margin, 0.0) + (ring - 1) * side  # nothing of this ring is nearer
            found = (ring > 0 and best <= reach * reach) or ring > max(rows, cols)
            if found:
                break
            for r in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
                step = 1 if abs(r - row) == ring else max(2 * ring, 1)
                for c in range(col - ring, col + ring + 1, step):
                    if 0 <= c < cols:
                        for m in range(starts[r * cols + c], starts[r * cols + c + 1]):
                            if group[m] != group[k]:
                                dx, dy = points[m, 0] - x, points[m, 1] - y
                                best = min(best, dx * dx + dy * dy)
        distances[k] = math.sqrt(best) if found else np.inf
    return distances


@njit(cache=True, nogil=True)
def _sort_into_bins(points: Array, layout: tuple[int, int, float]) -> tuple[Integers, Integers]:
    """Where each bin begins, and the numbers of the points, bin by bin."""
    rows, cols, side = layout
    bins = np.empty(len(points), dtype=np.int64)
    starts = np.zeros(rows * cols + 1, dtype=np.int64)
    for k in range(len(points)):
        col, row = min(int(points[k, 0] / side), cols - 1), min(int(points[k, 1] / side), rows - 1)
        bins[k] = row * cols + col
        starts[bins[k] + 1] += 1
    starts = np.cumsum(starts)
    place, order = starts[:-1].copy(), np.empty(len(points), dtype=np.int64)
    for k in range(len(points)):
        order[place[bins[k]]] = k
        place[bins[k]] += 1
    return starts, order
