"""Whether a cycle confirms a motion between two groups, and whether by walls that the motion itself does not rest on.

Pairs of maps that see the same walls err alike: where one takes a room for its twin, so does the other. Two pairs make
a cycle only if each rests on agreeing walls that the other has not seen, and a way over a third group only if both its
steps rest on walls that the two groups do not share. What says the same from the same walls is a mere echo.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import combinations

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.hypotheses import HypothesesConfig, is_same_motion
from merger.robust.map_group import Group, PairHypotheses, Voice, voices_between
from merger.robust.verification import find_agreeing_walls
from merger.robust.wall_structure import WallStructure

Array = npt.NDArray[np.float64]


class Support(Enum):
    """What else says that a motion is right."""

    NONE = "none"
    """Nothing, or one pair of maps."""
    ECHO = "echo"
    """A second pair, or a way over a third group, from the same walls."""
    CYCLE = "cycle"
    """The same from walls of its own."""


@dataclass(frozen=True)
class CycleConfig:
    """What makes a cycle.

    Raises:
        ValueError: a setting is out of its range.
    """

    voice_log_odds: float = 0.0
    """Motions of two maps at least so probable close cycles."""
    reach_m: float = 0.5
    """Walls farther than this from those of another way are a way's own, metres, > 0."""
    min_own_m: float = 1.5
    """Agreeing wall of its own that each way needs, metres, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("reach_m", "min_own_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0 m, got {getattr(self, name)}")


@dataclass(frozen=True)
class Relations:
    """What is known of single maps and of their pairs."""

    structures: Sequence[WallStructure]
    """The N maps."""
    hypotheses: PairHypotheses
    """Motions in question of their pairs."""
    pairs: HypothesesConfig
    """How two maps are compared, and when motions are the same."""


@dataclass(frozen=True)
class AgreeingWalls:
    """Walls on which one way of a cycle rests."""

    points: Array
    """(N, 2) places, metres, in the frame of the group that stays."""
    lengths_m: Array
    """(N,) wall length that each point stands for, metres."""


def find_support(
    T_a_b: Array, sides: tuple[Group, Group], others: Sequence[Group], relations: Relations, config: CycleConfig
) -> Support:
    """Find what confirms a motion between two groups.

    Args:
        T_a_b: (3, 3) the motion.
        sides: Group a, which stays, and group b.
        others: All other groups.
        relations: What is known of maps and pairs.
        config: The settings.

    Returns:
        A cycle if two pairs of maps say the same from different walls, or if a way over a third group says the same
        and both its steps rest on walls that a and b do not share; an echo if they say so from the same walls.
    """
    a, b = sides
    voices = voices_between(a, b, relations.hypotheses, config.voice_log_odds)
    center_b, pairs = b.structure.center_map, relations.pairs
    same = [v for v in voices if is_same_motion(v.T_a_b, T_a_b, center_b, pairs)]
    seen = [_walls_of(voice, sides, np.eye(3), relations) for voice in same]
    if any(_has_own(one, other, config) and _has_own(other, one, config) for one, other in combinations(seen, 2)):
        return Support.CYCLE
    support = Support.ECHO if len({voice.pair for voice in same}) > 1 else Support.NONE
    shared: AgreeingWalls | None = None
    for over, first, second in _detours(sides, others, relations, config):
        if is_same_motion(first.T_a_b @ second.T_a_b, T_a_b, center_b, pairs):
            support = Support.ECHO
            shared = shared or _agree(a.structure, b.structure, T_a_b, relations)
            steps = ((first, (a, over), np.eye(3)), (second, (over, b), first.T_a_b))
            if all(_has_own(_walls_of(*step, relations), shared, config) for step in steps):
                return Support.CYCLE
    return support


def _detours(
    sides: tuple[Group, Group], others: Sequence[Group], relations: Relations, config: CycleConfig
) -> Iterator[tuple[Group, Voice, Voice]]:
    """Ways from group b into group a over a third group: that group, and the two steps."""
    a, b = sides
    for over in others:
        second = voices_between(over, b, relations.hypotheses, config.voice_log_odds)
        first = voices_between(a, over, relations.hypotheses, config.voice_log_odds) if second else []
        yield from ((over, one, other) for one in first for other in second)


def _walls_of(voice: Voice, sides: tuple[Group, Group], T_a_side: Array, relations: Relations) -> AgreeingWalls:
    """Walls of the map that stays on which a motion of two maps rests; ``T_a_side`` moves its group into frame a."""
    i, j = voice.pair
    T_side_i = sides[0].place_of(i)
    T_i_j = se2.invert(T_side_i) @ voice.T_a_b @ sides[1].place_of(j)
    walls = _agree(relations.structures[i], relations.structures[j], T_i_j, relations)
    return AgreeingWalls(se2.transform_points(T_a_side @ T_side_i, walls.points), walls.lengths_m)


def _agree(at: WallStructure, to: WallStructure, T_at_to: Array, relations: Relations) -> AgreeingWalls:
    """The walls of one map that agree with another map's, in its own frame."""
    number = find_agreeing_walls(at, to, T_at_to, relations.pairs.verification)
    return AgreeingWalls(se2.transform_points(at.T_map_field, at.walls.points[number]), at.walls.lengths_m[number])


def _has_own(walls: AgreeingWalls, other: AgreeingWalls, config: CycleConfig) -> bool:
    """Whether enough wall is out of another way's reach."""
    from scipy.spatial import cKDTree  # noqa: PLC0415 # slow to import, and most merges need no cycle

    if min(len(walls.points), len(other.points)) == 0:
        return float(walls.lengths_m.sum()) >= config.min_own_m
    distance_m, _ = cKDTree(other.points).query(walls.points, distance_upper_bound=config.reach_m)
    return float(walls.lengths_m[np.isinf(distance_m)].sum()) >= config.min_own_m
