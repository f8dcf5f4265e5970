"""Are the relative motions right? Scores of pairs, before and after the method's confirmation, against truth."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.scoring import metrics
from bench.scoring.prediction import PredictedPair, Prediction
from merger import se2

Array = npt.NDArray[np.float64]

RIGHT_WITHIN_M = 0.5
"""A pair's motion is right within it, metres."""
RIGHT_WITHIN_DEG = 3.0
"""A pair's motion is right within it, degrees."""
OVERLAPPING_FROM = 0.2
"""Pairs whose true overlap, in the better direction, is at least this ought to be found."""

_NO_MOTION = np.full((3, 3), np.nan)


@dataclass(frozen=True)
class PairScores:
    """Precision and recall of relative motions."""

    edge_precision: float
    """Share of the *reliable* motions that are right, 0 to 1; NaN where there is none."""
    edge_recall: float
    """Share of the pairs overlapping by 0.2 or more with a right reliable motion, 0 to 1; NaN where no pair does."""
    edge_precision_initial: float
    """As `edge_precision`, over all motions that were found, before confirmation."""
    edge_recall_initial: float
    """As `edge_recall`, over all motions that were found, before confirmation."""
    num_edges: int
    """Reliable motions."""
    num_edges_initial: int
    """Motions found, reliable or rejected."""


def pair_errors(pair: PredictedPair, T_world_map: Array) -> tuple[float, float]:
    """Error of a pair's motion against ``inv(T_world_target) @ T_world_source``: metres, degrees; NaN without one."""
    return errors_of_pairs([pair], T_world_map)[0]


def errors_of_pairs(pairs: Sequence[PredictedPair], T_world_map: Array) -> list[tuple[float, float]]:
    """`pair_errors` of many pairs at once."""
    if not pairs:
        return []
    target, source = np.array([(pair.target, pair.source) for pair in pairs]).T
    motions = [_NO_MOTION if pair.T_target_source is None else pair.T_target_source for pair in pairs]
    T_true = se2.invert(T_world_map[target]) @ T_world_map[source]
    error_m, error_deg = metrics.motion_errors(T_true, np.array(motions))
    return list(zip(error_m.tolist(), error_deg.tolist(), strict=True))


def is_right(pair: PredictedPair, T_world_map: Array) -> bool:
    """Whether the pair has a motion within 0.5 m and 3 degrees of the true one; false without a motion."""
    return within_bounds(*pair_errors(pair, T_world_map))


def within_bounds(error_m: float, error_deg: float) -> bool:
    """Whether these errors, metres and degrees, are those of a right motion; false for NaN."""
    return error_m <= RIGHT_WITHIN_M and error_deg <= RIGHT_WITHIN_DEG


def score_pairs(prediction: Prediction, T_world_map: Array, overlap: Array) -> PairScores:
    """Precision and recall of a result's pairs; all NaN where the method names no pair.

    Args:
        prediction: The method's answer.
        T_world_map: (N, 3, 3) true poses of the maps.
        overlap: (N, N) true overlap; a pair counts as overlapping by the larger of its two directions.
    """
    errors = errors_of_pairs(prediction.pairs, T_world_map)
    judged = [(pair, within_bounds(*error)) for pair, error in zip(prediction.pairs, errors, strict=True)]
    found = [(pair, right) for pair, right in judged if pair.T_target_source is not None]
    reliable = [(pair, right) for pair, right in found if pair.status == "reliable"]
    if not prediction.pairs:
        return PairScores(math.nan, math.nan, math.nan, math.nan, 0, 0)
    wanted = overlapping_pairs(overlap)
    return PairScores(
        edge_precision=_precision(reliable),
        edge_recall=_recall(reliable, wanted),
        edge_precision_initial=_precision(found),
        edge_recall_initial=_recall(found, wanted),
        num_edges=len(reliable),
        num_edges_initial=len(found),
    )


def overlapping_pairs(overlap: Array) -> set[tuple[int, int]]:
    """Pairs (i, j), i < j, of an (N, N) overlap whose larger direction is at least 0.2."""
    rows, cols = np.nonzero(np.triu(np.maximum(overlap, overlap.T), k=1) >= OVERLAPPING_FROM)
    return {(int(i), int(j)) for i, j in zip(rows, cols, strict=True)}


def _precision(pairs: list[tuple[PredictedPair, bool]]) -> float:
    return sum(right for _, right in pairs) / len(pairs) if pairs else math.nan


def _recall(pairs: list[tuple[PredictedPair, bool]], wanted: set[tuple[int, int]]) -> float:
    right = {(min(pair.target, pair.source), max(pair.target, pair.source)) for pair, is_right in pairs if is_right}
    return len(wanted & right) / len(wanted) if wanted else math.nan
