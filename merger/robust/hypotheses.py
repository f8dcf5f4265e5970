"""The motions that come into question for one pair of maps: found by dense search, refined, compared, ranked."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.dense_search import DenseSearchConfig
from merger.robust.pair_probability import ProbabilityConfig, exclude_one_another, log_odds_of, score_motion
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
    glance: AlignmentConfig = field(default_factory=lambda: AlignmentConfig((0.8, 0.6), num_points=250))
    """The first steps of every peak."""
    quick: AlignmentConfig = field(default_factory=lambda: AlignmentConfig((0.5, 0.4, 0.3), num_points=250))
    """The next steps of those that look best after them."""
    fine: AlignmentConfig = field(default_factory=lambda: AlignmentConfig((0.4, 0.3, 0.2, 0.2, 0.2), num_points=1200))
    """The refinement of those that are kept."""
    verification: VerificationConfig = field(default_factory=VerificationConfig)
    """How maps are compared."""
    probability: ProbabilityConfig = field(default_factory=ProbabilityConfig)
    """What the comparison means."""
    num_promising: int = 10
    """Motions of a pair that take the quick steps, at least 1. After a glance the right one was among the best two."""
    num_kept: int = 5
    """Motions of a pair that stay in play, at least 1."""
    min_share: float = 0.2
    """But for the best two, motions whose score is below this share of the best one's are dropped, in [0, 1]."""
    num_quick_points: int = 500
    """Wall points that are compared before that, at least 10."""
    same_m: float = 0.7
    """Motions that differ by less, and by less than ``same_deg``, are the same, metres, > 0."""
    same_deg: float = 6.0
    """See ``same_m``; degrees, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if min(self.num_promising, self.num_kept) < 1:
            raise ValueError("num_promising and num_kept must be >= 1")
        if not 0.0 <= self.min_share <= 1.0:
            raise ValueError(f"min_share must be in [0, 1], got {self.min_share}")
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
    glanced = align_all(target, source, peaks, config.glance)
    promising = select_motions(target, source, glanced, config.num_promising, config)
    quick = align_all(target, source, promising, config.quick)
    kept = select_motions(target, source, quick, config.num_kept, config)
    fine = align_all(target, source, kept, config.fine)
    return judge_motions(target, source, distinct_motions(fine, source, config.num_kept, config), config)


def select_motions(
    target: WallStructure, source: WallStructure, motions: Sequence[Array], count: int, config: HypothesesConfig
) -> list[Array]:
    """At most ``count`` different motions that fit best at a quick look, best first, without the hopeless ones."""
    scores = _score_quickly(target, source, motions, config)
    order = np.argsort(-scores, kind="stable")
    ranked, scores = [motions[number] for number in order], scores[order]
    least = config.min_share * scores[0] if len(scores) and scores[0] > 0.0 else -np.inf
    numbers = _different(ranked, source, count, config)
    return [ranked[number] for place, number in enumerate(numbers) if place < 2 or scores[number] >= least]


def distinct_motions(
    motions: Sequence[Array], source: WallStructure, count: int, config: HypothesesConfig
) -> list[Array]:
    """The first ``count`` motions, best first, that differ from those before them."""
    return [motions[number] for number in _different(motions, source, count, config)]


def judge_motions(
    target: WallStructure, source: WallStructure, motions: Sequence[Array], config: HypothesesConfig
) -> tuple[Hypothesis, ...]:
    """Compare different motions of one pair, each against the best of the others; best first."""
    evidence = [measure_evidence(target, source, T, config.verification) for T in motions]
    scores = [score_motion(item, config.probability) for item in evidence]
    rivals = [max(scores[:k] + scores[k + 1 :], default=0.0) for k in range(len(scores))]
    alone = [log_odds_of(item, rival, config.probability) for item, rival in zip(evidence, rivals, strict=True)]
    judged = map(Hypothesis, motions, evidence, scores, exclude_one_another(alone), rivals)
    return tuple(sorted(judged, key=lambda item: -item.score_m))


def is_same_motion(T: Array, T_other: Array, center_map: Array, config: HypothesesConfig) -> bool:
    """Whether two motions of a source put its centre, (2,) metres in its frame ``map``, and its axes alike."""
    apart_m = np.linalg.norm((T - T_other)[:2, :2] @ center_map + (T - T_other)[:2, 2])
    angle = float(se2.angle_of(se2.invert(T) @ T_other))
    return bool(apart_m < config.same_m and abs(angle) < np.radians(config.same_deg))


def _different(motions: Sequence[Array], source: WallStructure, count: int, config: HypothesesConfig) -> list[int]:
    """Numbers of the first ``count`` motions that differ from those before them (see `is_same_motion`)."""
    if len(motions) < 2:
        return list(range(len(motions)))
    T = np.stack(motions)
    x, y = (T[:, :2, :2] @ source.center_map + T[:, :2, 2]).T
    angle = se2.angle_of(T)
    near = np.hypot(np.subtract.outer(x, x), np.subtract.outer(y, y)) < config.same_m
    same = near & (np.abs(se2.wrap_angle(np.subtract.outer(angle, angle))) < np.radians(config.same_deg))
    left = np.ones(len(T), dtype=np.bool_)
    numbers: list[int] = []
    while len(numbers) < count and left.any():
        numbers.append(int(left.argmax()))
        left &= ~same[numbers[-1]]
    return numbers


def _score_quickly(
    target: WallStructure, source: WallStructure, motions: Sequence[Array], config: HypothesesConfig
) -> Array:
    """(K,) scores of motions (see `score_motion`) from some of the wall points."""
    if len(motions) == 0 or len(target.walls.points) == 0 or len(source.walls.points) == 0:
        return np.zeros(len(motions))
    reach_m, facing = config.verification.reach_m, config.verification.facing
    a, b, T = target.view(config.num_quick_points), source.view(config.num_quick_points), np.stack(motions)
    T = target.T_field_map @ T @ source.T_map_field
    forward = score_walls(T, b.sample, a.walls, a.fields, *reach_m(a.fields.resolution_m), facing)
    backward = score_walls(se2.invert(T), a.sample, b.walls, b.fields, *reach_m(b.fields.resolution_m), facing)
    near, conflict = (0.5 * (one + other) for one, other in zip(forward, backward, strict=True))
    return np.asarray(near - config.probability.conflict_weight * conflict)
