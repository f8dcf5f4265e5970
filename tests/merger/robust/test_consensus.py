"""Consensus and what it says of pairs: cycles confirm, bridges need more, shared walls are told."""

from dataclasses import replace

import numpy as np
import pytest

from merger import se2
from merger.merge_config import MergeConfig
from merger.result import PairStatus
from merger.robust.consensus import ConsensusConfig, grow_groups
from merger.robust.cycles import CycleConfig, Relations, Support, find_support
from merger.robust.hypotheses import HypothesesConfig, Hypothesis
from merger.robust.map_group import Formation, Group, describe_group, join_formations
from merger.robust.pair_answer import Findings, judge_pairs
from merger.robust.pair_probability import StepProbabilityConfig, log_odds_of_step
from merger.robust.stages import describe_maps, refine_groups, search_all_pairs
from merger.robust.verification import Evidence, VerificationConfig, find_agreeing_walls, measure_evidence
from merger.robust.wall_structure import WallStructureConfig, extract_structure

CONFIG = MergeConfig()
SPANS = ((0.0, 12.0), (4.0, 16.0), (8.0, 20.0))
HERE = np.eye(3)


def group_of(cut_map, number: int, span: tuple[float, float]) -> Group:
    structure = extract_structure(cut_map(f"part_{number}", span, HERE, resolution_m=0.05), WallStructureConfig())
    return Group((number,), HERE[None], structure)


def join(groups: list[Group]) -> Group:
    """Groups whose maps lie true, as one; its walls are those of the first."""
    formation = groups[0]
    for group in groups[1:]:
        formation = join_formations(formation, group, HERE)
    return Group(formation.members, formation.T_group_map, groups[0].structure)


def says(T: np.ndarray, log_odds: float = 3.0) -> tuple[Hypothesis, ...]:
    return (Hypothesis(T, Evidence(10.0, 0.0, 0.0, 0.0, 8.0, 4.0, 6.0, 2.0, 20.0, 10.0), 10.0, log_odds, 0.0),)


@pytest.fixture(scope="module")
def parts(cut_map):
    """Two maps of the west, two of the middle, one of the east and one of all; all frames are the world's."""
    spans = ((0.0, 9.0), (0.0, 9.0), (3.0, 16.0), (3.0, 16.0), (12.0, 24.0), (0.0, 24.0))
    return [group_of(cut_map, number, span) for number, span in enumerate(spans)]


@pytest.mark.parametrize(
    ("sides", "over", "known", "support"),
    [
        (([0], [2]), [], {(0, 2): says(HERE)}, Support.NONE),
        (([0], [2]), [], {(0, 2): (*says(HERE), *says(HERE))}, Support.NONE),
        (([0], [2, 3]), [], {(0, 2): says(HERE), (0, 3): says(HERE)}, Support.ECHO),
        (([0, 4], [2]), [], {(0, 2): says(HERE), (2, 4): says(HERE)}, Support.CYCLE),
        (([0, 4], [2]), [], {(0, 2): says(HERE), (2, 4): says(se2.make_motion(2.0, 0.0, 0.0))}, Support.NONE),
        (([0, 4], [2]), [], {(0, 2): says(HERE), (2, 4): says(HERE, -1.0)}, Support.NONE),
        (([0], [1]), [2], {(0, 1): says(HERE), (0, 2): says(HERE), (1, 2): says(HERE)}, Support.ECHO),
        (([2], [4]), [5], {(2, 4): says(HERE), (2, 5): says(HERE), (4, 5): says(HERE)}, Support.CYCLE),
        (
            ([2], [4]),
            [5],
            {(2, 4): says(HERE), (2, 5): says(HERE), (4, 5): says(se2.make_motion(2.0, 0, 0))},
            Support.NONE,
        ),
    ],
    ids=[
        "alone",
        "one pair twice",
        "two pairs that see the same walls",
        "two pairs that see different walls",
        "the other pair disagrees",
        "the other pair is doubtful",
        "a way over the same walls",
        "a way over other walls",
        "a way to another place",
    ],
)
def test_a_cycle_confirms_if_each_way_rests_on_walls_of_its_own(parts, sides, over, known, support):
    relations = Relations([part.structure for part in parts], known, HypothesesConfig())
    first, second = (join([parts[k] for k in side]) for side in sides)
    assert find_support(HERE, (first, second), [parts[k] for k in over], relations, CycleConfig()) is support


def test_the_agreeing_walls_are_those_that_the_evidence_measures(parts):
    west, middle = parts[0].structure, parts[2].structure
    T = se2.make_motion(0.1, 0.0, 0.01)
    config = VerificationConfig()
    lengths = [
        one.walls.lengths_m[find_agreeing_walls(one, other, motion, config)].sum()
        for one, other, motion in ((west, middle, T), (middle, west, se2.invert(T)))
    ]
    assert np.mean(lengths) == pytest.approx(measure_evidence(west, middle, T, config).near_m)


def test_formations_joined_in_either_order_are_the_same():
    rng = np.random.default_rng(3)
    T = se2.exp(rng.normal(size=(5, 3)))
    a = Formation((0, 3), se2.invert(T[0]) @ T[[0, 3]])
    b = Formation((1, 2, 4), se2.invert(T[1]) @ T[[1, 2, 4]])
    for joined in (join_formations(a, b, se2.invert(T[0]) @ T[1]), join_formations(b, a, se2.invert(T[1]) @ T[0])):
        assert joined.members == (0, 1, 2, 3, 4)
        assert joined.T_group_map == pytest.approx(se2.invert(T[0]) @ T)


@pytest.fixture(scope="module")
def found(cut_map):
    """Three parts in a row, their structures, and the motions in question."""
    maps = [
        cut_map(f"part_{k}", span, se2.make_motion(2.0 * k, k, 0.7 * k), resolution_m=0.05)
        for k, span in enumerate(SPANS)
    ]
    described = describe_maps(maps, CONFIG, lambda *_: None)
    return maps, described, search_all_pairs(described, CONFIG, lambda *_: None)


def grow(found, hypotheses, **settings):
    maps, described, _ = found
    return grow_groups(maps, [d.structure for d in described], hypotheses, ConsensusConfig(**settings))


def test_a_bridge_that_no_cycle_confirms_needs_the_higher_log_odds(found):
    alone = {pair: motions if pair == (0, 1) else () for pair, motions in found[2].items()}
    log_odds = max(motion.log_odds for motion in alone[(0, 1)])
    joined = grow(found, alone, min_log_odds=log_odds - 0.01, cycle_log_odds=1.0, echo_log_odds=1.0)
    apart = grow(found, alone, min_log_odds=log_odds + 0.01, cycle_log_odds=1.0, echo_log_odds=1.0)
    assert [group.members for group in joined.groups] == [(0, 1), (2,)]
    assert [group.members for group in apart.groups] == [(0,), (1,), (2,)]


def test_a_cycle_lets_a_weaker_motion_join_and_makes_it_surer(found):
    surest = max(motion.log_odds for motions in found[2].values() for motion in motions)
    asked = surest + 1.0
    agreement = grow(found, found[2], min_log_odds=asked, cycle_log_odds=asked, echo_log_odds=0.0)
    assert [group.members for group in agreement.groups] == [(0, 1, 2)]
    first = agreement.joins[0]
    alone = max(motion.log_odds for motion in found[2][first.members + first.others])
    assert first.motion_log_odds == alone
    assert first.log_odds == log_odds_of_step(alone, True, StepProbabilityConfig())
    assert first.log_odds > log_odds_of_step(alone, False, StepProbabilityConfig())
    unheard = grow(found, found[2], min_log_odds=asked, cycle_log_odds=0.0, echo_log_odds=0.0)
    assert [group.members for group in unheard.groups] == [(0,), (1,), (2,)]


def test_an_echo_lets_a_motion_join_that_is_a_little_weaker(found):
    surest = max(motion.log_odds for motions in found[2].values() for motion in motions)
    agreement = grow(found, found[2], min_log_odds=surest + 0.9, cycle_log_odds=1.0, echo_log_odds=1.0)
    assert len(agreement.joins[0].members + agreement.joins[0].others) == 2
    assert agreement.joins[0].motion_log_odds == surest


def test_a_group_that_grows_map_by_map_is_the_same_as_one_described_at_once(cut_map):
    T_world_map = [se2.make_motion(0.3 * k, k, 0.4 * k) for k in range(3)]
    maps = [cut_map(f"m{k}", span, T) for k, (span, T) in enumerate(zip(SPANS, T_world_map, strict=True))]
    config = WallStructureConfig()
    single = [Group((k,), HERE[None], extract_structure(grid, config), grid) for k, grid in enumerate(maps)]
    two = describe_group(
        join_formations(*single[:2], se2.invert(T_world_map[0]) @ T_world_map[1]), single[0], maps, config
    )
    three = join_formations(single[2], two, se2.invert(T_world_map[2]) @ T_world_map[0])
    grown = describe_group(three, two, maps, config)
    at_once = describe_group(three, replace(two, grid=None), maps, config)
    assert grown.members == (0, 1, 2)
    cells = []
    for group in (grown, at_once):
        known = group.grid.log_odds != 0.0
        cells.append(np.column_stack([group.grid.cell_centers(known), group.grid.log_odds[known]]))
    assert cells[0] == pytest.approx(cells[1])
    assert grown.structure.length_m == pytest.approx(at_once.structure.length_m)


def test_the_groups_that_are_judged_are_told(found):
    seen = []
    maps, described, hypotheses = found
    structures = [d.structure for d in described]
    grow_groups(maps, structures, hypotheses, ConsensusConfig(), lambda a, b, _: seen.append({*a.members, *b.members}))
    assert seen == [{0, 1, 2}]


def test_features_may_propose_motions_too(found):
    maps, _, without = found
    config = replace(CONFIG, robust=replace(CONFIG.robust, features=True))
    described = describe_maps(maps, config, lambda *_: None)
    assert all(item.prepared is not None for item in described)
    proposed = search_all_pairs(described, config, lambda *_: None)
    assert max(m.log_odds for m in proposed[(0, 1)]) >= max(m.log_odds for m in without[(0, 1)]) - 0.5


def test_without_the_judgement_of_groups_the_motions_of_pairs_decide(found):
    hypotheses = found[2]
    seen = []
    maps, described, _ = found
    config = ConsensusConfig(judge_groups=False)
    grow_groups(maps, [d.structure for d in described], hypotheses, config, lambda a, b, motions: seen.append(motions))
    known = {motion.log_odds for motions in hypotheses.values() for motion in motions}
    assert seen
    assert all(motion.log_odds in known for motions in seen for motion in motions)


def judged(found, hypotheses, config):
    maps, described, known = found
    agreement = grow_groups(maps, [d.structure for d in described], known, config.robust.consensus)
    findings = Findings(described, hypotheses, agreement, refine_groups(described, known, agreement, config))
    return {(pair.target[-1], pair.source[-1]): pair for pair in judge_pairs(findings, config)}


def test_a_pair_that_the_search_missed_is_confirmed_by_the_walls_that_it_shares(found):
    pair = judged(found, found[2] | {(0, 1): ()}, CONFIG)["0", "1"]
    assert pair.status is PairStatus.RELIABLE
    T_true = se2.make_motion(2.0, 1.0, 0.7)
    assert np.abs(se2.log(se2.invert(T_true) @ pair.T_target_source)).max() < 0.05


def test_a_pair_is_as_sure_as_the_joins_between_its_maps(found):
    pairs = judged(found, found[2], CONFIG)
    joins = grow(found, found[2]).joins
    first, second = (1.0 / (1.0 + np.exp(-join.log_odds)) for join in joins)
    names = {str(number) for number in (*joins[0].members, *joins[0].others)}
    for key, pair in pairs.items():
        assert pair.confidence == pytest.approx(first if set(key) == names else second, rel=0.02)


def test_a_placed_pair_without_common_walls_is_not_reliable(found):
    strict = replace(CONFIG, robust=replace(CONFIG.robust, min_shared=0.5))
    pairs = judged(found, found[2], strict)
    assert [pairs[key].status is PairStatus.RELIABLE for key in (("0", "1"), ("1", "2"), ("0", "2"))] == [
        True,
        True,
        False,
    ]


def test_open_motions_name_the_groups_that_are_left_when_a_join_is_taken_back(found):
    """Maps 0 and 1 are joined, but both are sure of map 2, at places that contradict each other and the walls."""
    sure = {pair: (replace(motions[0], log_odds=8.0),) for pair, motions in found[2].items() if motions}
    off = {(0, 2): se2.make_motion(40.0, 0.0, 0.5), (1, 2): se2.make_motion(-40.0, 9.0, 2.0)}
    for pair, T in off.items():
        sure[pair] = (replace(sure[(0, 1)][0], T_target_source=T, log_odds=5.0),)
    agreement = grow(found, sure)
    assert [join.members + join.others for join in agreement.taken_back] == [(0, 1)]
    assert [group.members for group in agreement.groups] == [(0,), (1,), (2,)]
    assert [(a, b) for a, b, _ in agreement.open_motions] == [((0,), (1,)), ((0,), (2,)), ((1,), (2,))]
    for a, b, motion in agreement.open_motions:
        assert motion.T_target_source == pytest.approx(sure[a + b][0].T_target_source)
