"""Which neighbouring submaps do not overlap by what was asked for: said when they are made, and on their card."""

import itertools
import logging

from sim.maps.overlap_search import TOLERANCE
from sim.maps.truth import Truth

_logger = logging.getLogger(__name__)


def describe_missed(truth: Truth, target: float) -> list[str]:
    """Neighbours that do not overlap by what was asked for, in words: ``map_03 and map_04 (0.17)``.

    Args:
        truth: The submaps as they were made; neighbours follow each other and are of one robot.
        target: Wanted overlap.
    """
    missed = []
    for i, j in itertools.pairwise(range(len(truth.names))):
        overlap = float(truth.overlap[i, j] + truth.overlap[j, i]) / 2.0
        if truth.robot[i] == truth.robot[j] and abs(overlap - target) > TOLERANCE:
            missed.append(f"{truth.names[i]} and {truth.names[j]} ({overlap:.2f})")
    return missed


def warn_of_missed(truth: Truth, target: float) -> None:
    """Log the neighbours that do not overlap by what was asked for, if there are any."""
    missed = describe_missed(truth, target)
    if missed:
        _logger.warning("submaps.measured_overlap=%g is met on average, but not by %s", target, ", ".join(missed))
