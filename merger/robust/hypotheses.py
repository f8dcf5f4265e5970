"""The motions that come into question for one pair of maps: found by dense search, refined, compared, ranked."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.dense_search import DenseSearchConfig
from merger.robust.pair_probability import ProbabilityConfig, log_odds_of, score_motion
from merger.robust.verification import Evidence, VerificationConfig, measure_evidence
from merger.robust.wall_alignment import AlignmentConfig, align_all
from merger.robust.wall_kernels import score_walls
from merger.robust.wall_structure import WallStructure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class HypothesesConfig:
    """Settings of the pairwise step.

    Raises:
        ValueError: a setting is out of its range.
    """

    dense: DenseSearchConfig = field(default_factory=DenseSearchConfig)
    """The dense search."""
    quick: AlignmentConfig = field(default_factory=lambda: AlignmentConfig((0.8, 0.6, 0.5, 0.4, 0.3), num_points=250))
    """The refinement of every peak."""
    fine: AlignmentConfig = field(
        default_factory=lambda: AlignmentConfig((0.5, 0.4, 0.3, 0.3, 0.2, 0.2, 0.2), num_points=1200)
    )
    """The refinement of those that are kept."""
    verification: VerificationConfig = field(default_factory=VerificationConfig)
    """How maps are compared."""
    probability: ProbabilityConfig = field(default_factory=ProbabilityConfig)
    """What the comparison means."""
    num_kept: int = 5
    """Motions of a pair that stay in play, at least 1."""
    num_quick_points: int = 500
    """Wall points that are compared before that, at least 10."""
    same_m: float = 0.7
    """Motions that differ by less, and by less than ``same_deg``, are the same, metres, > 0."""
    same_deg: float = 6.0
    """See ``same_m``; degrees, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.num_kept < 1:
            raise ValueError(f"num_kept must be >= 1, got {self.num_kept}")
        if self.num_quick_points < 10:
            raise ValueError(f"num_quick_points must be >= 10, got {self.num_quick_points}")
        if not (self.same_m > 0.0 and self.same_deg > 0.0):
            raise ValueError(f"same_m and same_deg must be > 0, got {self.same_m} and {self.same_deg}")


@dataclass(frozen=True)
class Hypothesis:
    """One motion that comes into question for a pair."""

    T_target_source: Array
    """(3, 3) motion between the frames ``map``, metres."""
    evidence: Evidence
    """What the maps say about it."""
    score_m: float
    """Rank among the motions of the pair (see `score_motion`)."""
    log_odds: float
    """Log-odds that it is right, its rivals considered."""
    rival_score_m: float
    """Score of the best of its rivals, 0 without one."""


def find_hypotheses(
    target: WallStructure,
    source: WallStructure,
    peaks: Sequence[Array],
    config: HypothesesConfig,
) -> tuple[Hypothesis, ...]:
    """Refine, compare and rank motions of one pair.

    Args:
        target: The map that stays.
        source: The map that moves.
        peaks: (3, 3) coarse motions ``T_target_source``.
        config: The settings.

    Returns:
        At most ``num_kept`` different motions, best first.
    """
    quick = align_all(target, source, peaks, config.quick)
    scores = _score_quickly(target, source, quick, config)
    ranked = [quick[index] for index in np.argsort(-scores, kind="stable")]
    fine = align_all(target, source, _distinct(ranked, source, config), config.fine)
    return judge_motions(target, source, _distinct(fine, source, config), config)


def judge_motions(
    target: WallStructure, source: WallStructure, motions: Sequence[Array], config: HypothesesConfig
) -> tuple[Hypothesis, ...]:
    """Compare different motions of one pair, each against the best of the others; best first."""
    evidence = [measure_evidence(target, source, T, config.verification) for T in motions]
    scores = [score_motion(item, config.probability) for item in evidence]
    judged = []
    for index, T in enumerate(motions):
        rival = max((score for other, score in enumerate(scores) if other != index), default=0.0)
        log_odds = log_odds_of(evidence[index], rival, config.probability)
        judged.append(Hypothesis(T, evidence[index], scores[index], log_odds, rival))
    return tuple(sorted(judged, key=lambda item: -item.score_m))


def is_same_motion(T: Array, T_other: Array, center_map: Array, config: HypothesesConfig) -> bool:
    """Whether two motions of a source put its centre, (2,) metres in its frame ``map``, and its axes alike."""
    apart_m = np.linalg.norm((T - T_other)[:2, :2] @ center_map + (T - T_other)[:2, 2])
    angle = float(se2.angle_of(se2.invert(T) @ T_other))
    return bool(apart_m < config.same_m and abs(angle) < np.radians(config.same_deg))


def _distinct(motions: Sequence[Array], source: WallStructure, config: HypothesesConfig) -> list[Array]:
    """The first ``num_kept`` motions, best first, that differ from those before them."""
    center_map = source.center_map
    kept: list[Array] = []
    for T in motions:
        if not any(is_same_motion(T, other, center_map, config) for other in kept):
            kept.append(T)
        if len(kept) == config.num_kept:
            break
    return kept


def _score_quickly(
    target: WallStructure, source: WallStructure, motions: Sequence[Array], config: HypothesesConfig
) -> Array:
    """(K,) scores of motions (see `score_motion`) from some of the wall points."""
    if len(motions) == 0 or len(target.walls.points) == 0 or len(source.walls.points) == 0:
        return np.zeros(len(motions))
    limits = (config.verification.near_m, config.verification.far_m, config.verification.facing)
    a, b, T = target.view(config.num_quick_points), source.view(config.num_quick_points), np.stack(motions)
    T = target.T_field_map @ T @ source.T_map_field
    forward = score_walls(T, b.sample, a.walls, a.fields, *limits)
    backward = score_walls(se2.invert(T), a.sample, b.walls, b.fields, *limits)
    near, conflict = (0.5 * (one + other) for one, other in zip(forward, backward, strict=True))
    return np.asarray(near - config.probability.conflict_weight * conflict)
