"""Consensus: grow placements from the surest motion on, and judge each further step by the maps already joined.

Two groups of maps are joined by the motion that is most probable when all maps of the one are compared with all maps
of the other, as one map with one map, against the best rival motion. A motion that looks right between two maps but
contradicts their neighbours' free space dies here; a motion that two maps alone leave open is decided by the rest.
Nothing is joined below a fixed probability: what is left stays apart, with its reason.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.compositing import CompositingConfig, composite_maps
from merger.grid_map import GridMap
from merger.hypotheses import HypothesesConfig, Hypothesis, is_same_motion, judge_motions
from merger.wall_alignment import AlignmentConfig, align_walls
from merger.wall_structure import WallStructure, WallStructureConfig, extract_structure

Array = npt.NDArray[np.float64]

PairHypotheses = dict[tuple[int, int], tuple[Hypothesis, ...]]
"""Motions in question of each pair ``(i, j)``, i < j: j moves onto i."""


@dataclass(frozen=True)
class ConsensusConfig:
    """Settings of the consensus.

    Raises:
        ValueError: a setting is out of its range.
    """

    structure: WallStructureConfig = field(default_factory=WallStructureConfig)
    """How the walls of a map, and of a group, are described."""
    pairs: HypothesesConfig = field(default_factory=HypothesesConfig)
    """How the motions of two maps are found and judged."""
    min_log_odds: float = 2.5
    """Groups are joined only by motions at least so probable."""
    plausible_log_odds: float = -6.0
    """Motions of two maps below it are not tried between groups, below ``min_log_odds``."""
    num_tried: int = 4
    """Motions that are tried between two groups, at least 1."""
    alignment: AlignmentConfig = field(
        default_factory=lambda: AlignmentConfig((0.4, 0.3, 0.2, 0.2, 0.2), num_points=2000)
    )
    """Refinement between groups."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not self.plausible_log_odds < self.min_log_odds:
            raise ValueError(f"plausible_log_odds must be < {self.min_log_odds}, got {self.plausible_log_odds}")
        if self.num_tried < 1:
            raise ValueError(f"num_tried must be >= 1, got {self.num_tried}")


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
class Join:
    """One step of the consensus."""

    members: tuple[int, ...]
    """The maps that were joined to ``others``."""
    others: tuple[int, ...]
    """See ``members``."""
    log_odds: float
    """Log-odds of the motion that joined them."""


@dataclass(frozen=True)
class Agreement:
    """What the consensus came to."""

    groups: tuple[Group, ...]
    """Largest first, then by first member."""
    joins: tuple[Join, ...]
    """Its steps, in order."""
    open_motions: tuple[tuple[tuple[int, ...], tuple[int, ...], Hypothesis], ...]
    """The best motion between any two groups that stayed apart, if there is one."""


def grow_groups(
    maps: Sequence[GridMap],
    structures: Sequence[WallStructure],
    hypotheses: PairHypotheses,
    config: ConsensusConfig,
) -> Agreement:
    """Join maps into groups, the surest motion first.

    Args:
        maps: N maps in canonical order.
        structures: Their N structures.
        hypotheses: Motions in question of all pairs.
        config: The settings.

    Returns:
        The groups and how they came about.
    """
    groups: dict[tuple[int, ...], Group] = {
        (i,): Group((i,), np.eye(3)[None], item) for i, item in enumerate(structures)
    }
    best: dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[Hypothesis, ...]]
    best = {((i,), (j,)): items for (i, j), items in hypotheses.items() if items}
    joins = []
    while best:
        (a, b), motion = max(
            ((key, _surest(items)) for key, items in best.items()), key=lambda m: (m[1].log_odds, m[0])
        )
        if motion.log_odds < config.min_log_odds:
            break
        joined = _join(groups.pop(a), groups.pop(b), motion.T_target_source)
        if groups:
            joined = _describe(joined, maps, config.structure)
        joins.append(Join(a, b, motion.log_odds))
        best = {key: value for key, value in best.items() if not {a, b} & set(key)}
        for other in sorted(groups):
            pair = (joined, groups[other]) if joined.members < other else (groups[other], joined)
            found = _try_motions(*pair, hypotheses, config)
            if found:
                best[(pair[0].members, pair[1].members)] = found
        groups[joined.members] = joined
    ordered = sorted(groups.values(), key=lambda group: (-len(group.members), group.members))
    remaining = tuple((a, b, _surest(items)) for (a, b), items in sorted(best.items()))
    return Agreement(tuple(ordered), tuple(joins), remaining)


def _surest(motions: Sequence[Hypothesis]) -> Hypothesis:
    """The motion with the highest log-odds."""
    return max(motions, key=lambda motion: motion.log_odds)


def _join(a: Group, b: Group, T_a_b: Array) -> Group:
    """Put two groups into one, in the frame of its first member; its structure is still that of the first group."""
    members = np.array(a.members + b.members)
    T_a_map = np.concatenate([a.T_group_map, T_a_b @ b.T_group_map])
    order = np.argsort(members)
    T_group_map = se2.invert(T_a_map[order[0]]) @ T_a_map[order]
    numbers = tuple(int(n) for n in members[order])
    return Group(numbers, T_group_map, a.structure)


def _describe(group: Group, maps: Sequence[GridMap], config: WallStructureConfig) -> Group:
    """Give a group the structure of all its maps together."""
    own = [maps[number] for number in group.members]
    finest = min(grid.resolution_m for grid in own)
    cell_m = max(finest, config.spacing_m)
    merged = composite_maps(own, group.T_group_map, own[0].T_map_grid, cell_m, CompositingConfig())
    return replace(group, structure=extract_structure(replace(merged, name=own[0].name), config))


def _try_motions(a: Group, b: Group, hypotheses: PairHypotheses, config: ConsensusConfig) -> tuple[Hypothesis, ...]:
    """Judge the motions in question between two groups, all maps of both at once."""
    proposed = []
    for (i, T_a_i), (j, T_b_j) in _cross(a, b):
        for hypothesis in hypotheses.get((min(i, j), max(i, j)), ()):
            T_i_j = hypothesis.T_target_source if i < j else se2.invert(hypothesis.T_target_source)
            if hypothesis.log_odds >= config.plausible_log_odds:
                proposed.append((hypothesis.score_m, T_a_i @ T_i_j @ se2.invert(T_b_j)))
    proposed.sort(key=lambda item: -item[0])
    center_b = b.structure.center_map
    kept: list[Array] = []
    for _, T in proposed:
        if len(kept) < config.num_tried and not any(is_same_motion(T, o, center_b, config.pairs) for o in kept):
            kept.append(T)
    refined = [align_walls(a.structure, b.structure, T, config.alignment) for T in kept]
    distinct: list[Array] = []
    for T in refined:
        if not any(is_same_motion(T, other, center_b, config.pairs) for other in distinct):
            distinct.append(T)
    return judge_motions(a.structure, b.structure, distinct, config.pairs)


def _cross(a: Group, b: Group) -> list[tuple[tuple[int, Array], tuple[int, Array]]]:
    """Every map of one group with every map of the other, with their motions in the groups."""
    return [
        ((i, T_a_i), (j, T_b_j))
        for i, T_a_i in zip(a.members, a.T_group_map, strict=True)
        for j, T_b_j in zip(b.members, b.T_group_map, strict=True)
    ]
