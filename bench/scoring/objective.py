"""'Obj.', the paper's error criterion (Tables 1 and 2), and its floor.

The paper takes it from its reference [Zhu16], whose text is not to be had. Implemented is the reading that the
authors' other work makes most plausible; its value under the *true* motions, the floor, stands beside it wherever it is
shown, because a figure at the floor ranks nothing: methods are ranked by pose error against truth.
"""

import functools
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.scoring.nearest_other import nearest_other_m
from merger import se2

Array = npt.NDArray[np.float64]

LAMBDA = 2.0
"""Exponent that rewards overlap in TrICP's objective (Eq. 3)."""
MIN_OVERLAP = 0.1
"""Smallest overlap that is tried; a smaller share of a map says nothing about it."""


def map_objective(distances_cells: Array) -> float:
    """Trimmed mean squared distance of one map's edge points, in cells^2 (Eq. 3 at its best overlap).

    ``min over xi in [0.1, 1] of mean of the xi*n smallest d^2, divided by xi^(1 + lambda)``, lambda = 2; 0 to infinity;
    NaN without points.

    Args:
        distances_cells: (n,) distance of each edge point to the nearest edge point of the other maps, cells.
    """
    if distances_cells.size == 0:
        return math.nan
    squared = np.sort(distances_cells) ** 2
    counts, divisors, first = _trims(squared.size)
    return float((np.cumsum(squared)[first:] / counts / divisors).min())


def score_objective(
    edges_map: Sequence[Array], resolutions_m: Sequence[float], T_ref_map: Array, component: npt.NDArray[np.int64]
) -> float:
    """'Obj.': the mean of `map_objective` over the placed maps that have company; cells^2, 0 to infinity, NaN if none.

    A map's points are compared with the union of the other maps' points of the same component. A cell is
    the map's own.

    Args:
        edges_map: N arrays (n, 2) of edge points, metres in each map's own frame.
        resolutions_m: N sides of a cell, metres.
        T_ref_map: (N, 3, 3) motions; a map whose motion is NaN takes no part.
        component: (N,) number of each map's component.
    """
    values: list[float] = []
    known = np.isfinite(T_ref_map).all(axis=(1, 2))
    for number in np.unique(component[known]):
        members = np.flatnonzero(known & (component == number)).tolist()
        points = [se2.transform_points(T_ref_map[k], edges_map[k]) for k in members]
        owner = np.repeat(np.arange(len(members)), [len(p) for p in points])
        distances_m = nearest_other_m(np.concatenate(points), owner)
        for position, k in enumerate(members):
            own = distances_m[owner == position]
            if np.isfinite(own).any():
                values.append(map_objective(own / resolutions_m[k]))
    return float(np.mean(values)) if values else math.nan


@functools.lru_cache(maxsize=256)
def _trims(size: int) -> tuple[npt.NDArray[np.int64], Array, int]:
    """The counts of points that may be kept, ``xi^(1 + lambda)`` of each, and how many smaller counts there are."""
    counts = np.arange(1, size + 1)
    xi = counts / size
    first = int(np.argmax(xi >= MIN_OVERLAP))
    return counts[first:], xi[first:] ** (1.0 + LAMBDA), first
