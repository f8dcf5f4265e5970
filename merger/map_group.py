"""Groups of maps that lie fixed to each other, and what the motions of their maps say about two groups."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.hypotheses import HypothesesConfig, Hypothesis, is_same_motion
from merger.wall_structure import WallStructure

Array = npt.NDArray[np.float64]

PairHypotheses = dict[tuple[int, int], tuple[Hypothesis, ...]]
"""Motions in question of each pair ``(i, j)``, i < j: j moves onto i."""


@dataclass(frozen=True)
class Group:
    """Maps that lie fixed to each other."""

    members: tuple[int, ...]
    """Numbers of the maps, rising; the first one's frame is the group's."""
    T_group_map: Array
    """(M, 3, 3) their motions."""
    structure: WallStructure
    """Walls and free space of all members together, frame ``map`` of the first."""


@dataclass(frozen=True)
class Voice:
    """What one motion of two maps says about their groups."""

    pair: tuple[int, int]
    """The maps: one of the group that stays, one of the group that moves."""
    T_a_b: Array
    """(3, 3) motion of the one group into the other."""
    hypothesis: Hypothesis
    """Whose motion it is."""


def voices_between(a: Group, b: Group, hypotheses: PairHypotheses, min_log_odds: float) -> list[Voice]:
    """What the motions of all pairs of maps, if they are at least so probable, say about two groups."""
    voices = []
    for (i, T_a_i), (j, T_b_j) in product(
        zip(a.members, a.T_group_map, strict=True), zip(b.members, b.T_group_map, strict=True)
    ):
        for hypothesis in hypotheses.get((min(i, j), max(i, j)), ()):
            if hypothesis.log_odds >= min_log_odds:
                T_i_j = hypothesis.T_target_source if i < j else se2.invert(hypothesis.T_target_source)
                voices.append(Voice((i, j), T_a_i @ T_i_j @ se2.invert(T_b_j), hypothesis))
    return voices


def is_confirmed(
    T_a_b: Array, direct: Sequence[Voice], detours: Iterable[Array], center_b: Array, config: HypothesesConfig
) -> bool:
    """Whether a cycle confirms a motion between two groups.

    Args:
        T_a_b: (3, 3) the motion.
        direct: What pairs of maps of the two groups say.
        detours: (3, 3) motions that lead over a third group; asked for only if need be.
        center_b: (2,) middle of group b, metres, in its frame.
        config: Says when motions are the same.

    Returns:
        True if two different pairs of maps, or one pair and a way over a third group, say the same.
    """
    pairs = {v.pair for v in direct if is_same_motion(v.T_a_b, T_a_b, center_b, config)}
    return len(pairs) > 1 or any(is_same_motion(T, T_a_b, center_b, config) for T in detours)
