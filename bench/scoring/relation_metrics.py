"""Relative-relation error (Kuemmerle et al. 2009): how well neighbours lie to each other, whatever the frame."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.scoring import metrics, pair_metrics
from bench.scoring.prediction import Prediction
from merger import se2

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RelationError:
    """Mean error of the relations between overlapping maps."""

    relation_error_m: float
    """Mean translation, metres."""
    relation_error_deg: float
    """Mean rotation, degrees."""
    num_relations: int
    """Relations compared."""


def score_relations(prediction: Prediction, T_world_map: Array, overlap: Array) -> RelationError:
    """Relative-relation error of a placement.

    ``delta_ij = inv(T_ref_i) @ T_ref_j`` is compared with its true value over the pairs of maps whose true overlap is
    at least 0.2 and that are placed in one component: the mean length (metres, 0 to infinity) and mean absolute angle
    (degrees, 0 to 180) of ``inv(delta_true) @ delta``. NaN where no such pair is placed. It needs no common
    frame, so that one wrong link costs only the relations across it.

    Args:
        prediction: The method's answer.
        T_world_map: (N, 3, 3) true poses.
        overlap: (N, N) true overlap.
    """
    pairs = [
        (i, j)
        for i, j in sorted(pair_metrics.overlapping_pairs(overlap))
        if prediction.placed[i] and prediction.placed[j] and prediction.component[i] == prediction.component[j]
    ]
    if not pairs:
        return RelationError(math.nan, math.nan, 0)
    i, j = np.array(pairs).T
    delta = se2.invert(prediction.T_ref_map[i]) @ prediction.T_ref_map[j]
    error_m, error_deg = metrics.motion_errors(se2.invert(T_world_map[i]) @ T_world_map[j], delta)
    return RelationError(float(error_m.mean()), float(error_deg.mean()), len(pairs))
