"""How probable it is that a motion between two maps is right, from what the maps say about it.

A logistic model on dimensionless or logarithmic evidence. Its coefficients were fitted to pairs of maps of simulated
buildings and of real logs; ``python -m bench.pair_calibration`` fits them anew to any datasets and tells how both do on
buildings that the fit has not seen.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger.robust.verification import Evidence

FEATURES = ("constant", "conflict", "rival", "ambiguity", "blunt", "crowding", "loose_end", "lead")
"""Names of the features, in the order of `features_of`."""

_AMBIGUOUS = 0.7
"""A rival above this share of a motion's score makes it ambiguous."""
_PINNED_M = 2.0
"""Less wall than this across the weaker direction leaves a motion loose: a corridor fits itself at any shift."""

_AHEAD_M = 10.0
"""A score that leads the rival's by less is common among wrong motions."""


@dataclass(frozen=True)
class ProbabilityConfig:
    """The logistic model.

    Raises:
        ValueError: the number of coefficients is wrong, or a setting is out of its range.
    """

    coefficients: tuple[float, ...] = (-3.78, -4.20, -1.14, -4.21, 2.76, -3.38, -0.63, 0.82)
    """One for each of `FEATURES`."""
    conflict_weight: float = 5.0
    """Metres of agreeing wall that outweigh one metre in free space when motions of a pair are ranked, >= 0."""

    def __post_init__(self) -> None:
        """Refuse what is no model."""
        if len(self.coefficients) != len(FEATURES):
            raise ValueError(f"coefficients must be {len(FEATURES)} numbers, got {len(self.coefficients)}")
        if not self.conflict_weight >= 0.0:
            raise ValueError(f"conflict_weight must be >= 0, got {self.conflict_weight}")


@dataclass(frozen=True)
class StepProbabilityConfig:
    """The logistic model of a step of the consensus, the surest motion between any two groups that are left.

    Among the motions of all pairs, of which most are wrong, one of log-odds 1 to 2 is right in 95 of 100 cases; as a
    step of the consensus it is right in 99.
    """

    constant: float = 0.6
    """Log-odds of a step whose motion has log-odds of 0."""
    slope: float = 1.6
    """What the motion's log-odds add, times themselves."""
    cycle: float = 3.1
    """What a cycle adds."""


def score_motion(evidence: Evidence, config: ProbabilityConfig) -> float:
    """Metres of agreeing wall less the weighted metres of contradiction: ranks the motions of one pair."""
    return evidence.near_m - config.conflict_weight * evidence.conflict_m


def features_of(evidence: Evidence, score_m: float, rival_score_m: float) -> npt.NDArray[np.float64]:
    """The (8,) features of one motion; a little is added to all lengths, so that short ones say little.

    Args:
        evidence: What the maps say about it.
        score_m: Its score.
        rival_score_m: The score of the best motion of the pair that is really another one.

    Returns:
        1; the logarithm of the walls that do not agree, those that lie a little aside by half, over those that do; the
        rival's share of the score, 0 to 1.5; what of it is above 0.7, where two motions fit about as well; the
        logarithm of the share of agreeing walls that are no straight lines (straight walls agree by chance); that of
        agreeing wall over as much as the maps have for so much floor (walls that agree by chance share little floor);
        how much too little wall there is across the weaker direction, as a logarithm, 0 to 3; the metres by which the
        score leads the rival's over 10 m, as a logarithm, at least 0.
    """
    near_m = evidence.near_m + 0.5
    conflict = math.log((evidence.conflict_m + 0.5 * evidence.loose_m + 0.5) / near_m)
    rival = min(max(rival_score_m / max(score_m, 1.0), 0.0), 1.5)
    blunt = math.log((evidence.blunt_m + 0.2) / near_m)
    crowding = math.log((evidence.near_m + 2.0) / (evidence.expected_m + 2.0))
    loose_end = min(max(math.log(_PINNED_M / max(evidence.weak_m, 1e-3)), 0.0), 3.0)
    lead = math.log(max((score_m - max(rival_score_m, 0.0)) / _AHEAD_M, 1.0))
    return np.array([1.0, conflict, rival, max(0.0, rival - _AMBIGUOUS), blunt, crowding, loose_end, lead])


def log_odds_of(evidence: Evidence, rival_score_m: float, config: ProbabilityConfig) -> float:
    """Log-odds that a motion is right (see `features_of`)."""
    features = features_of(evidence, score_motion(evidence, config), rival_score_m)
    return float(features @ np.array(config.coefficients))


def exclude_one_another(log_odds: Sequence[float]) -> list[float]:
    """Log-odds of motions of which at most one is right, from those of each as if it were alone.

    The odds of each are divided by 1 plus the odds of all others, so that the probabilities add up to less than 1: in
    a bare square room four motions fit alike, and none is sure.
    """
    odds = [math.exp(min(value, 50.0)) for value in log_odds]
    return [value - math.log1p(sum(odds[:k] + odds[k + 1 :])) for k, value in enumerate(log_odds)]


def log_odds_of_step(motion_log_odds: float, is_confirmed: bool, config: StepProbabilityConfig) -> float:
    """Log-odds that a step of the consensus is right, by its motion's and by whether a cycle confirms it."""
    return config.constant + config.slope * motion_log_odds + config.cycle * is_confirmed


def probability(log_odds: float) -> float:
    """Probability, 0..1, of log-odds."""
    return 1.0 / (1.0 + math.exp(-min(max(log_odds, -50.0), 50.0)))
