"""Strain: two groups that stayed apart although sure motions join them, because these motions contradict each other.

Each motion tells where the one group lies in the other. If both are right, then a group is wrong inside: a join that
looked sure is not, as when a map is bent. The join that explains most contradictions is taken back.

Note:
    False alarms: none in 22 sets cut from real logs of which a map stayed apart and no placement was wrong. Where all
    maps come together, there is nothing to contradict.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.cycles import Relations
from merger.robust.hypotheses import is_same_motion
from merger.robust.map_group import Formation, voices_between

Array = npt.NDArray[np.float64]

Sides = tuple[tuple[int, ...], tuple[int, ...]]
"""The maps that a join put together: its members and its others."""


@dataclass(frozen=True)
class StrainConfig:
    """What counts as a contradiction.

    Raises:
        ValueError: a setting is out of its range.
    """

    sure_log_odds: float = 4.0
    """Motions of two maps at least so probable are believed."""
    apart_m: float = 0.5
    """Two motions contradict each other if they put a map farther apart than this, metres, > 0, ..."""
    apart_deg: float = 2.0
    """... or turn it by more than this, degrees, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("apart_m", "apart_deg"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")


def part_strained(
    groups: Sequence[Formation], joins: Sequence[Sides], relations: Relations, config: StrainConfig
) -> tuple[list[Formation], list[int]]:
    """Take joins back until no two sure motions between groups contradict each other.

    Args:
        groups: The groups that stayed apart.
        joins: The joins that made them, in order.
        relations: What is known of maps and pairs.
        config: The settings.

    Returns:
        The groups that are left, and the numbers of the joins that fell.
    """
    left, fallen = list(groups), set[int]()
    while True:
        standing = {k: sides for k, sides in enumerate(joins) if k not in fallen}
        number = _find_strained_join(left, standing, relations, config)
        if number is None:
            return left, sorted(fallen)
        core = _union(joins[number])
        above = [k for k, sides in standing.items() if core <= _union(sides)]
        whole = next(group for group in left if core <= set(group.members))
        parts = [side for k in above for side in joins[k] if k == number or not core <= set(side)]
        left = [group for group in left if group is not whole]
        left += [_part_of(whole, members) for members in parts]
        fallen |= set(above)


def _find_strained_join(
    groups: Sequence[Formation], joins: Mapping[int, Sides], relations: Relations, config: StrainConfig
) -> int | None:
    """Number of the join that explains most contradictions, the latest one of several; None without any."""
    blamed: Counter[int] = Counter()
    for a, b in combinations(groups, 2):
        for ends_a, ends_b in _contradictions(a, b, relations, config):
            blamed.update({_parting_join(ends, joins) for ends in (ends_a, ends_b) if ends[0] != ends[1]})
    return max(blamed, key=lambda number: (blamed[number], number), default=None)


def _contradictions(
    a: Formation, b: Formation, relations: Relations, config: StrainConfig
) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Two sure motions that lay group b differently: the maps of group a that they start from, and those of b."""
    voices = voices_between(a, b, relations.hypotheses, config.sure_log_odds)
    middle_b = {j: _middle_of(j, b, relations) for j in b.members}
    same = replace(relations.pairs, same_m=config.apart_m, same_deg=config.apart_deg)
    for one, other in combinations(voices, 2):
        seen = (middle_b[one.pair[1]], middle_b[other.pair[1]])
        if not all(is_same_motion(one.T_a_b, other.T_a_b, middle, same) for middle in seen):
            yield (one.pair[0], other.pair[0]), (one.pair[1], other.pair[1])


def _middle_of(number: int, group: Formation, relations: Relations) -> Array:
    """(2,) middle of one map of a group, in the group's frame."""
    return np.asarray(se2.transform_points(group.place_of(number), relations.structures[number].center_map[None])[0])


def _parting_join(ends: tuple[int, int], joins: Mapping[int, Sides]) -> int:
    """The join that put two maps of a group together: the first that holds both."""
    return next(number for number, sides in joins.items() if set(ends) <= _union(sides))


def _union(sides: Sides) -> set[int]:
    return set(sides[0] + sides[1])


def _part_of(formation: Formation, members: tuple[int, ...]) -> Formation:
    """Some maps of a group, as a group."""
    T = np.stack([formation.place_of(number) for number in members])
    return Formation(members, se2.invert(T[0]) @ T)
