"""Consensus: grow placements from the surest motion on, and judge each further step by the maps already joined.

Two groups of maps are joined by the motion that is most probable when all maps of the one are compared with all maps
of the other, as one map with one map, against the best rival motion. A motion that looks right between two maps but
contradicts their neighbours' free space dies here; a motion that two maps alone leave open is decided by the rest.
Nothing is joined below a fixed probability, to which a cycle adds: what is left stays apart, with its reason.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from merger.grid_map import GridMap
from merger.robust.cycles import CycleConfig, Relations, Support, find_support
from merger.robust.hypotheses import HypothesesConfig, Hypothesis, distinct_motions, judge_motions, select_motions
from merger.robust.map_group import (
    Formation,
    Group,
    PairHypotheses,
    describe_group,
    join_formations,
    voices_between,
)
from merger.robust.pair_probability import StepProbabilityConfig, log_odds_of_step
from merger.robust.strain import StrainConfig, part_strained
from merger.robust.wall_alignment import AlignmentConfig, align_all
from merger.robust.wall_structure import WallStructure, WallStructureConfig

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
    cycles: CycleConfig = field(default_factory=CycleConfig)
    """What counts as a cycle."""
    min_log_odds: float = 4.0
    """Groups are joined only by motions at least so probable."""
    cycle_log_odds: float = 3.0
    """A motion that a cycle confirms may have log-odds lower by this, >= 0."""
    echo_log_odds: float = 1.0
    """The same for one that is confirmed from the same walls only, >= 0."""
    strain: StrainConfig = field(default_factory=StrainConfig)
    """When steps are taken back."""
    step: StepProbabilityConfig = field(default_factory=StepProbabilityConfig)
    """How sure a step is."""
    plausible_log_odds: float = -6.0
    """Motions of two maps below it are not tried between groups, below what may join."""
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
        for name in ("cycle_log_odds", "echo_log_odds"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must be >= 0, got {getattr(self, name)}")
        least = self.min_log_odds - max(self.cycle_log_odds, self.echo_log_odds)
        if not self.plausible_log_odds < least:
            raise ValueError(f"plausible_log_odds must be < {least}, got {self.plausible_log_odds}")
        if self.num_tried < 1:
            raise ValueError(f"num_tried must be >= 1, got {self.num_tried}")


@dataclass(frozen=True)
class Join:
    """One step of the consensus."""

    members: tuple[int, ...]
    """The maps that were joined to ``others``."""
    others: tuple[int, ...]
    """See ``members``."""
    motion_log_odds: float
    """Log-odds of the motion that joined them."""
    log_odds: float
    """Log-odds that the step is right."""


@dataclass(frozen=True)
class Agreement:
    """What the consensus came to."""

    groups: tuple[Formation, ...]
    """Largest first, then by first member."""
    joins: tuple[Join, ...]
    """Its steps, in order."""
    open_motions: tuple[tuple[tuple[int, ...], tuple[int, ...], Hypothesis], ...]
    """The best motion between any two of the groups, if there is one."""
    taken_back: tuple[Join, ...] = ()
    """Steps that were taken back, because sure motions to maps of other groups contradict each other over them."""


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
    relations = Relations(structures, hypotheses, config.pairs)
    parts = enumerate(zip(structures, maps, strict=True))
    groups: dict[Key, Group] = {(i,): Group((i,), np.eye(3)[None], *part) for i, part in parts}
    best: Judged = {((i,), (j,)): items for (i, j), items in hypotheses.items() if items}
    joins: list[Join] = []
    while (step := _next_step(groups, best, relations, config)) is not None:
        a, b, motion, support = step
        sure = log_odds_of_step(motion.log_odds, support is Support.CYCLE, config.step)
        joins.append(Join(a, b, motion.log_odds, sure))
        first, second = groups.pop(a), groups.pop(b)
        formation = join_formations(first, second, motion.T_target_source)
        if not groups:
            return Agreement((formation,), tuple(joins), ())
        joined = describe_group(formation, min(first, second, key=lambda group: group.members), maps, config.structure)
        best = {key: value for key, value in best.items() if not {a, b} & set(key)}
        for one, other, found in _motions_from(joined, groups, hypotheses, config):
            best[(one.members, other.members)] = found
            watch(one, other, found)
        groups[joined.members] = joined
    return _take_back(groups, best, joins, relations, config)


def _take_back(
    groups: dict[Key, Group], best: Judged, joins: Sequence[Join], relations: Relations, config: ConsensusConfig
) -> Agreement:
    """The answer, without the joins that sure motions contradict (`merger.robust.strain`)."""
    sides = [(join.members, join.others) for join in joins]
    left, fallen = part_strained(list(groups.values()), sides, relations, config.strain)
    ordered = sorted(left, key=lambda group: (-len(group.members), group.members))
    remaining = tuple(_open_motions(ordered, groups, best, relations.hypotheses))
    standing = tuple(join for number, join in enumerate(joins) if number not in fallen)
    return Agreement(tuple(ordered), standing, remaining, tuple(joins[number] for number in fallen))


def _next_step(
    groups: dict[Key, Group], best: Judged, relations: Relations, config: ConsensusConfig
) -> tuple[Key, Key, Hypothesis, Support] | None:
    """The surest motion that may join two groups, and the support that it needed; None if there is none left."""
    lower = {Support.NONE: 0.0, Support.ECHO: config.echo_log_odds, Support.CYCLE: config.cycle_log_odds}
    surest = sorted(((_surest(items), key) for key, items in best.items()), key=lambda m: (m[0].log_odds, m[1]))
    for motion, (a, b) in reversed(surest):
        if motion.log_odds < config.min_log_odds - max(lower.values()):
            return None
        if motion.log_odds >= config.min_log_odds:
            return a, b, motion, Support.NONE
        others = [groups[key] for key in sorted(groups.keys() - {a, b})]
        support = find_support(motion.T_target_source, (groups[a], groups[b]), others, relations, config.cycles)
        if motion.log_odds >= config.min_log_odds - lower[support]:
            return a, b, motion, support
    return None


def _open_motions(
    left: Sequence[Formation], judged: dict[Key, Group], best: Judged, hypotheses: PairHypotheses
) -> Iterator[tuple[Key, Key, Hypothesis]]:
    """The best motion between any two groups that are left; by single maps, where one is what joins taken back left."""
    for a, b in combinations(sorted(left, key=lambda group: group.members), 2):
        motions = best.get((a.members, b.members), ())
        if not (a.members in judged and b.members in judged):
            voices = voices_between(a, b, hypotheses, -np.inf)
            motions = tuple(replace(voice.hypothesis, T_target_source=voice.T_a_b) for voice in voices)
        if motions:
            yield a.members, b.members, _surest(motions)


def _surest(motions: Sequence[Hypothesis]) -> Hypothesis:
    """The motion with the highest log-odds."""
    return max(motions, key=lambda motion: motion.log_odds)


def _motions_from(
    joined: Group, groups: dict[Key, Group], hypotheses: PairHypotheses, config: ConsensusConfig
) -> Iterator[tuple[Group, Group, tuple[Hypothesis, ...]]]:
    """The judged motions between a new group and each other group that shares one with it."""
    for key, group in sorted(groups.items()):
        one, other = (joined, group) if joined.members < key else (group, joined)
        if found := _try_motions(one, other, hypotheses, config):
            yield one, other, found


def _try_motions(a: Group, b: Group, hypotheses: PairHypotheses, config: ConsensusConfig) -> tuple[Hypothesis, ...]:
    """Judge the motions in question between two groups, all maps of both at once."""
    voices = voices_between(a, b, hypotheses, config.plausible_log_odds)
    if not config.judge_groups:
        return tuple(replace(voice.hypothesis, T_target_source=voice.T_a_b) for voice in voices)
    voices.sort(key=lambda voice: -voice.hypothesis.score_m)
    proposed = distinct_motions([voice.T_a_b for voice in voices], b.structure, config.num_tried, config.pairs)
    tried = select_motions(a.structure, b.structure, proposed, config.num_tried, config.pairs)
    refined = align_all(a.structure, b.structure, tried, config.alignment)
    distinct = distinct_motions(refined, b.structure, config.num_tried, config.pairs)
    return judge_motions(a.structure, b.structure, distinct, config.pairs)
