"""What is known of one method on one dataset, computed: its row of the scores, and those of its maps and pairs."""

import itertools
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.cell import Outcome
from bench.scoring import calibration, grid_metrics, metrics, pair_metrics, relation_metrics
from bench.scoring.prediction import PredictedPair, Prediction
from bench.scoring.score_rows import STAGES, MapScore, PairScore, Score
from bench.scoring.yardstick import Yardstick


def score_result(
    yardstick: Yardstick, prediction: Prediction, outcome: Outcome
) -> tuple[Score, list[MapScore], list[PairScore]]:
    """Score one answer against the truth of its dataset."""
    truth = yardstick.truth
    errors = metrics.placement_errors(truth.T_world_map, prediction.placed, prediction.component, prediction.T_ref_map)
    pairs = pair_metrics.score_pairs(prediction, truth.T_world_map, truth.overlap)
    relations = relation_metrics.score_relations(prediction, truth.T_world_map, truth.overlap)
    grids = grid_metrics.score_grids(yardstick.grid, errors.T_world_ref @ prediction.T_ref_map)
    stages: dict[str, Any] = {f"runtime_{s}_s": prediction.stages_s.get(s, math.nan) for s in STAGES}
    judged = np.isfinite(errors.error_m)
    fields: dict[str, Any] = {}
    for record in (metrics.score_placement(prediction, errors), pairs, relations, grids):
        fields |= vars(record)
    score = Score(
        status=outcome.status,
        reason=outcome.reason,
        **fields,
        objective_initial=yardstick.objective(prediction.T_ref_map_initial, prediction.component),
        objective=yardstick.objective(prediction.T_ref_map, prediction.component),
        objective_floor=yardstick.objective_floor,
        brier=calibration.brier_score(prediction.confidence[judged], ~errors.wrong[judged]),
        runtime_s=outcome.wall_s,
        runtime_ratio=outcome.cpu_s / outcome.reference_s,
        peak_memory_mb=outcome.peak_memory_mb,
        **stages,
    )
    return score, _map_scores(prediction, errors), _pair_scores(prediction, truth.T_world_map, truth.overlap)


def score_failure(num_maps: int, outcome: Outcome) -> Score:
    """The row of a method that gave no answer: nothing placed, no success, and the reason."""
    return Score(
        outcome.status, outcome.reason, num_maps, runtime_s=outcome.wall_s, peak_memory_mb=outcome.peak_memory_mb
    )


def _map_scores(prediction: Prediction, errors: metrics.PlacementErrors) -> list[MapScore]:
    return [
        MapScore(
            map=name,
            placed=bool(prediction.placed[k]),
            component=int(prediction.component[k]),
            error_m=float(errors.error_m[k]),
            error_deg=float(errors.error_deg[k]),
            wrong=bool(errors.wrong[k]),
            confidence=float(prediction.confidence[k]),
            reason=prediction.reasons[k],
        )
        for k, name in enumerate(prediction.names)
    ]


def _pair_scores(
    prediction: Prediction, T_world_map: npt.NDArray[np.float64], overlap: npt.NDArray[np.float64]
) -> list[PairScore]:
    pairs = [*prediction.pairs, *_unnamed_pairs(prediction)]
    rows = []
    for pair, (error_m, error_deg) in zip(pairs, pair_metrics.errors_of_pairs(pairs, T_world_map), strict=True):
        rows.append(
            PairScore(
                target=prediction.names[pair.target],
                source=prediction.names[pair.source],
                status=pair.status,
                overlap_true=float(max(overlap[pair.target, pair.source], overlap[pair.source, pair.target])),
                error_m=error_m,
                error_deg=error_deg,
                right=pair_metrics.within_bounds(error_m, error_deg),
                num_matches=pair.num_matches,
                num_inliers=pair.num_inliers,
                agreement=pair.agreement,
            )
        )
    return rows


def _unnamed_pairs(prediction: Prediction) -> list[PredictedPair]:
    """Pairs on which a method that names others is silent: it found nothing there, and recall is of all pairs."""
    named = {frozenset((pair.target, pair.source)) for pair in prediction.pairs}
    every = itertools.combinations(range(len(prediction.names)), 2)
    silent = [(i, j) for i, j in every if named and frozenset((i, j)) not in named]
    return [PredictedPair(i, j, "no_match", None, None, math.nan, math.nan, math.nan) for i, j in silent]
