"""Order sensitivity: does the answer depend on the order in which the maps are named?"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.scoring import metrics
from bench.scoring.prediction import Prediction
from merger import se2


@dataclass(frozen=True)
class OrderSensitivity:
    """How much answers to one dataset differ between orders of its maps."""

    same_placed: bool
    """Whether every order places the same maps in the same components."""
    difference_m: float
    """Largest translation by which the relation of two maps differs between two orders, metres."""
    difference_deg: float
    """Largest rotation, degrees."""


def compare_orders(predictions: Sequence[Prediction]) -> OrderSensitivity:
    """Order sensitivity of a method on one dataset.

    Every answer is compared with the first. Over all pairs of maps that both place in one component, the relation
    ``inv(T_ref_i) @ T_ref_j`` of one answer is compared with that of the other: the largest length (metres, 0 to
    infinity) and angle (degrees, 0 to 180) of their difference. It needs no truth and no common reference. NaN
    with fewer than two answers or without a pair of maps.
    """
    differences: list[tuple[float, float]] = []
    for other in predictions[1:]:
        i, j = np.nonzero(_together(predictions[0]) & _together(other))
        if len(i):
            relations = [se2.invert(p.T_ref_map[i]) @ p.T_ref_map[j] for p in (predictions[0], other)]
            error_m, error_deg = metrics.motion_errors(*relations)
            differences.append((float(error_m.max()), float(error_deg.max())))
    same = all((_together(p) == _together(predictions[0])).all() for p in predictions)
    if not differences:
        return OrderSensitivity(same, math.nan, math.nan)
    return OrderSensitivity(same, max(d[0] for d in differences), max(d[1] for d in differences))


def _together(prediction: Prediction) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """(N, N) whether two different maps are placed in one component."""
    placed = prediction.placed[:, None] & prediction.placed[None]
    same = prediction.component[:, None] == prediction.component[None]
    return np.asarray(placed & same & ~np.eye(len(prediction.placed), dtype=bool))
