"""The rows of the scores: of one method on one dataset, of each map in it, of each pair."""

import math
from dataclasses import dataclass

STAGES = ("features", "pairs", "tree", "averaging", "compositing")
"""Stages whose times a result states."""


@dataclass(frozen=True)
class Score:
    """Scores of one result; what does not apply is NaN. Each is defined where it is computed."""

    status: str
    """``ok``, ``failed`` or ``skipped``."""
    reason: str | None
    """Why it is not ok."""
    num_maps: int
    """Maps given."""
    num_placed: int = 0
    """See `metrics.Placement`."""
    num_wrong: int = 0
    """See `metrics.Placement`."""
    success: bool = False
    """See `metrics.Placement`."""
    max_error_m: float = math.nan
    """See `metrics.Placement`."""
    max_error_deg: float = math.nan
    """See `metrics.Placement`."""
    median_error_m: float = math.nan
    """See `metrics.Placement`."""
    median_error_deg: float = math.nan
    """See `metrics.Placement`."""
    objective_initial: float = math.nan
    """`objective.score_objective` of the coarse motions, cells^2."""
    objective: float = math.nan
    """`objective.score_objective` of the fine motions, cells^2."""
    objective_floor: float = math.nan
    """`objective.score_objective` of the true motions of all maps, cells^2."""
    edge_precision: float = math.nan
    """See `pair_metrics.PairScores`."""
    edge_recall: float = math.nan
    """See `pair_metrics.PairScores`."""
    edge_precision_initial: float = math.nan
    """See `pair_metrics.PairScores`."""
    edge_recall_initial: float = math.nan
    """See `pair_metrics.PairScores`."""
    num_edges: int = 0
    """See `pair_metrics.PairScores`."""
    num_edges_initial: int = 0
    """See `pair_metrics.PairScores`."""
    num_components: int = 0
    """See `metrics.Placement`."""
    relation_error_m: float = math.nan
    """See `relation_metrics.RelationError`."""
    relation_error_deg: float = math.nan
    """See `relation_metrics.RelationError`."""
    num_relations: int = 0
    """See `relation_metrics.RelationError`."""
    acceptance: float = math.nan
    """`grid_metrics.acceptance_index`."""
    acceptance_count: int = 0
    """`grid_metrics.acceptance_index`."""
    iou_occupied: float = math.nan
    """`grid_metrics.iou` of occupied cells."""
    iou_free: float = math.nan
    """`grid_metrics.iou` of free cells."""
    brier: float = math.nan
    """`calibration.brier_score` of the maps' confidences."""
    runtime_s: float = math.nan
    """Wall time of the method."""
    runtime_overhead_s: float = math.nan
    """Wall time for which the row keeps its worker from the next one, less the method's (``runtime_s``) and the making
    of its dataset: starting and ending processes, reading maps, copying them for a command, writing and keeping the
    answer, the reference workload, and scoring, unless a core is spare on which that is done while the next method
    runs. What comes once a sweep is not in it: starting the program and its servers, and drawing the report, which says
    how long that took."""
    runtime_ratio: float = math.nan
    """Processor time of the method, all its threads and processes, over that of the reference workload (2 ms), run by
    the bench in the same ten seconds: what other programs do meanwhile hardly changes it; waiting does not count."""
    runtime_features_s: float = math.nan
    """Stated time of the stage."""
    runtime_pairs_s: float = math.nan
    """Stated time of the stage."""
    runtime_tree_s: float = math.nan
    """Stated time of the stage."""
    runtime_averaging_s: float = math.nan
    """Stated time of the stage."""
    runtime_compositing_s: float = math.nan
    """Stated time of the stage."""
    peak_memory_mb: float = math.nan
    """Largest resident memory of the method's process, MiB."""


@dataclass(frozen=True)
class MapScore:
    """One map of one result."""

    map: str
    """Name."""
    placed: bool
    """Whether the method placed it."""
    component: int
    """Its component."""
    error_m: float
    """See `metrics.placement_errors`."""
    error_deg: float
    """See `metrics.placement_errors`."""
    wrong: bool
    """See `metrics.placement_errors`."""
    confidence: float
    """Stated probability of being right."""
    reason: str | None
    """Why it is not placed."""


@dataclass(frozen=True)
class PairScore:
    """One pair of one result; of a method that names any pair, each that it does not name is one without a match."""

    target: str
    """Map that stays."""
    source: str
    """Map that moves."""
    status: str
    """What the method says."""
    overlap_true: float
    """True overlap, the larger direction."""
    error_m: float
    """See `pair_metrics.pair_errors`."""
    error_deg: float
    """See `pair_metrics.pair_errors`."""
    right: bool
    """See `pair_metrics.is_right`."""
    num_matches: float
    """As stated."""
    num_inliers: float
    """As stated."""
    agreement: float
    """As stated."""
