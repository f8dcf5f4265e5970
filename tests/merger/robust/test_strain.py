"""Strain: sure motions that contradict each other tell that a group is wrong inside."""

import numpy as np
import pytest

from merger import se2
from merger.robust.cycles import Relations
from merger.robust.hypotheses import HypothesesConfig, Hypothesis
from merger.robust.map_group import Formation
from merger.robust.strain import StrainConfig, part_strained
from merger.robust.verification import Evidence
from merger.robust.wall_structure import WallStructure, WallStructureConfig, extract_structure

HERE = np.eye(3)
BENT = se2.make_motion(1.0, 0.0, 0.0)
JOINS = [((0,), (1,)), ((2,), (3,)), ((2, 3), (4,))]
"""Two groups: maps 0 and 1, and maps 2 to 4."""


@pytest.fixture(scope="module")
def structure(cut_map) -> WallStructure:
    return extract_structure(cut_map("part", (0.0, 9.0), HERE), WallStructureConfig())


def part(structure: WallStructure, hypotheses: dict) -> tuple[list[tuple[int, ...]], list[int]]:
    """Members of the groups that are left, and the joins that fell; all maps lie at the origin."""
    groups = [Formation(members, np.stack([HERE] * len(members))) for members in ((0, 1), (2, 3, 4))]
    relations = Relations([structure] * 5, hypotheses, HypothesesConfig())
    left, fallen = part_strained(groups, JOINS, relations, StrainConfig())
    return sorted(group.members for group in left), fallen


def says(T: np.ndarray, log_odds: float = 6.0) -> tuple[Hypothesis, ...]:
    return (Hypothesis(T, Evidence(10.0, 0.0, 0.0, 0.0, 8.0, 4.0, 6.0, 2.0, 20.0, 10.0), 10.0, log_odds, 0.0),)


@pytest.mark.parametrize(
    "hypotheses",
    [
        {},
        {(0, 2): says(BENT)},
        {(0, 2): says(BENT), (1, 3): says(BENT)},
        {(0, 2): says(HERE), (1, 3): says(BENT, log_odds=1.0)},
        {(0, 2): says(HERE), (1, 3): says(se2.make_motion(0.1, 0.1, 0.01))},
    ],
    ids=["no motions", "one motion", "two that agree", "one is doubtful", "nearly the same"],
)
def test_groups_without_contradiction_stay_whole(structure, hypotheses):
    assert part(structure, hypotheses) == ([(0, 1), (2, 3, 4)], [])


def test_the_join_that_explains_most_contradictions_falls_with_those_built_on_it(structure):
    hypotheses = {(0, 2): says(HERE), (0, 3): says(BENT), (1, 3): says(BENT)}
    assert part(structure, hypotheses) == ([(0, 1), (2,), (3,), (4,)], [1, 2])


def test_only_the_map_that_is_blamed_leaves_where_nothing_builds_on_it(structure):
    hypotheses = {(0, 2): says(HERE), (1, 3): says(HERE), (0, 4): says(BENT), (1, 4): says(BENT)}
    assert part(structure, hypotheses) == ([(0, 1), (2, 3), (4,)], [2])


def test_a_turn_is_a_contradiction_although_the_middle_stays(structure):
    turn = se2.make_motion(*structure.center_map, np.radians(3.0)) @ se2.make_motion(*-structure.center_map, 0.0)
    assert part(structure, {(0, 4): says(HERE), (1, 4): says(turn)})[1] == [0]


def test_settings_out_of_range_are_refused():
    for setting in ({"apart_m": 0.0}, {"apart_deg": -1.0}):
        with pytest.raises(ValueError, match=next(iter(setting))):
            StrainConfig(**setting)
