"""How probable it is that a motion between two maps is right, from what the maps say about it.

A logistic model on dimensionless or logarithmic evidence. Its coefficients were fitted to pairs of maps of many
simulated buildings and of real logs by ``python -m bench.pair_calibration``, which prints them.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger.verification import Evidence

FEATURES = ("constant", "weak", "near", "conflict", "rival", "free", "tight", "loose")
"""Names of the features, in the order of `features_of`."""


@dataclass(frozen=True)
class ProbabilityConfig:
    """The logistic model.

    Raises:
        ValueError: the number of coefficients is wrong.
    """

    coefficients: tuple[float, ...] = (-2.3, 0.9, 0.0, -2.9, -3.1, 1.1, 0.0, -0.4)
    """One for each of `FEATURES`."""
    conflict_weight: float = 5.0
    """Metres of agreeing wall that outweigh one metre in free space when motions of a pair are ranked, >= 0."""

    def __post_init__(self) -> None:
        """Refuse what is no model."""
        if len(self.coefficients) != len(FEATURES):
            raise ValueError(f"coefficients must be {len(FEATURES)} numbers, got {len(self.coefficients)}")
        if not self.conflict_weight >= 0.0:
            raise ValueError(f"conflict_weight must be >= 0, got {self.conflict_weight}")


def score_motion(evidence: Evidence, config: ProbabilityConfig) -> float:
    """Metres of agreeing wall less the weighted metres of contradiction: ranks the motions of one pair."""
    return evidence.near_m - config.conflict_weight * evidence.conflict_m


def features_of(evidence: Evidence, score_m: float, rival_score_m: float) -> npt.NDArray[np.float64]:
    """The (8,) features of one motion.

    Args:
        evidence: What the maps say about it.
        score_m: Its score.
        rival_score_m: The score of the best motion of the pair that is really another one.
    """
    near, conflict, loose = evidence.near_m, evidence.conflict_m, evidence.loose_m
    rival = min(max(rival_score_m / max(score_m, 1.0), 0.0), 2.0)
    return np.array(
        [
            1.0,
            math.log1p(evidence.weak_m),
            math.log1p(near),
            math.log((conflict + 0.5) / (near + 0.5)),
            rival,
            math.log(0.3 + evidence.free_m2),
            evidence.tight_m / max(near, 0.5),
            math.log((loose + 0.5) / (near + 0.5)),
        ]
    )


def log_odds_of(evidence: Evidence, rival_score_m: float, config: ProbabilityConfig) -> float:
    """Log-odds that a motion is right (see `features_of`)."""
    features = features_of(evidence, score_motion(evidence, config), rival_score_m)
    return float(features @ np.array(config.coefficients))


def probability(log_odds: float) -> float:
    """Probability, 0..1, of log-odds."""
    return 1.0 / (1.0 + math.exp(-min(max(log_odds, -50.0), 50.0)))
