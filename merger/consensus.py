"""Consensus: grow placements from the surest motion on, and judge each further step by the maps already joined.

Two groups of maps are joined by the motion that is most probable when all maps of the one are compared with all maps
of the other, as one map with one map, against the best rival motion. A motion that looks right between two maps but
contradicts their neighbours' free space dies here; a motion that two maps alone leave open is decided by the rest.
Nothing is joined below a fixed probability, nor below a higher one if no cycle confirms the motion: what is left stays
apart, with its reason.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.compositing import CompositingConfig, composite_maps
from merger.grid_map import GridMap
from merger.hypotheses import HypothesesConfig, Hypothesis, is_same_motion, judge_motions
from merger.map_group import Group, PairHypotheses, is_confirmed, voices_between
from merger.wall_alignment import AlignmentConfig, align_walls
from merger.wall_structure import WallStructure, WallStructureConfig, extract_structure

Array = npt.NDArray[np.float64]

Key = tuple[int, ...]
"""The members of a group."""
Judged = dict[tuple[Key, Key], tuple[Hypothesis, ...]]
"""Motions between groups that were judged."""
Watch = Callable[[Group, Group, Sequence[Hypothesis]], None]
"""Told of two groups and of the motions between them that were judged."""


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
    bridge_log_odds: float = 4.0
    """The same for a motion that no cycle confirms; below ``min_log_odds`` no cycle is asked for."""
    voice_log_odds: float = -2.0
    """Motions of two maps at least so probable close cycles."""
    plausible_log_odds: float = -6.0
    """Motions of two maps below it are not tried between groups, below ``min_log_odds``."""
    judge_groups: bool = True
    """Whether all maps of two groups judge their motion (off: the two maps that propose it alone; an ablation)."""
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
    watch: Watch = lambda a, b, motions: None,
) -> Agreement:
    """Join maps into groups, the surest motion first.

    Args:
        maps: N maps in canonical order.
        structures: Their N structures.
        hypotheses: Motions in question of all pairs.
        config: The settings.
        watch: Told of every two groups, and the motions between them, that are judged beyond single maps.

    Returns:
        The groups and how they came about.
    """
    groups: dict[Key, Group] = {(i,): Group((i,), np.eye(3)[None], item) for i, item in enumerate(structures)}
    best: Judged = {((i,), (j,)): items for (i, j), items in hypotheses.items() if items}
    joins = []
    while (step := _next_step(groups, best, hypotheses, config)) is not None:
        a, b, motion = step
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
                watch(*pair, found)
        groups[joined.members] = joined
    ordered = sorted(groups.values(), key=lambda group: (-len(group.members), group.members))
    remaining = tuple((a, b, _surest(items)) for (a, b), items in sorted(best.items()))
    return Agreement(tuple(ordered), tuple(joins), remaining)


def _next_step(
    groups: dict[Key, Group], best: Judged, hypotheses: PairHypotheses, config: ConsensusConfig
) -> tuple[Key, Key, Hypothesis] | None:
    """The surest motion that may join two groups; None if there is none left."""
    surest = sorted(((_surest(items), key) for key, items in best.items()), key=lambda m: (m[0].log_odds, m[1]))
    for motion, (a, b) in reversed(surest):
        if motion.log_odds < config.min_log_odds:
            return None
        if motion.log_odds >= config.bridge_log_odds:
            return a, b, motion
        direct = voices_between(groups[a], groups[b], hypotheses, config.voice_log_odds)
        detours = _detours(groups, a, b, hypotheses, config)
        if is_confirmed(motion.T_target_source, direct, detours, groups[b].structure.center_map, config.pairs):
            return a, b, motion
    return None


def _detours(
    groups: dict[Key, Group], a: Key, b: Key, hypotheses: PairHypotheses, config: ConsensusConfig
) -> Iterator[Array]:
    """Motions of one group into another that lead over a third one."""
    for key in groups.keys() - {a, b}:
        second = voices_between(groups[key], groups[b], hypotheses, config.voice_log_odds)
        first = voices_between(groups[a], groups[key], hypotheses, config.voice_log_odds) if second else []
        yield from (one.T_a_b @ other.T_a_b for one in first for other in second)


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
    voices = voices_between(a, b, hypotheses, config.plausible_log_odds)
    if not config.judge_groups:
        return tuple(replace(voice.hypothesis, T_target_source=voice.T_a_b) for voice in voices)
    proposed = [(voice.hypothesis.score_m, voice.T_a_b) for voice in voices]
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
