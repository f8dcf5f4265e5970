"""Consensus and what it says of pairs: cycles confirm, bridges need more, shared walls are told."""

from dataclasses import replace

import numpy as np
import pytest

from merger import se2
from merger.consensus import ConsensusConfig, grow_groups
from merger.hypotheses import HypothesesConfig, Hypothesis
from merger.map_group import Voice, is_confirmed
from merger.merge_config import MergeConfig
from merger.pair_answer import Findings, judge_pairs
from merger.result import PairStatus
from merger.robust_stages import describe_maps, refine_groups, search_all_pairs
from merger.verification import Evidence

CONFIG = MergeConfig()
SPANS = ((0.0, 12.0), (4.0, 16.0), (8.0, 20.0))
T = se2.make_motion(3.0, -1.0, 0.8)
OTHER = se2.make_motion(5.0, -1.0, 0.8)
CENTER = np.array([4.0, 2.0])


def voice(pair: tuple[int, int], motion: np.ndarray) -> Voice:
    evidence = Evidence(10.0, 0.0, 0.0, 0.0, 8.0, 4.0, 6.0, 20.0)
    return Voice(pair, motion, Hypothesis(motion, evidence, 10.0, 3.0, 0.0))


@pytest.mark.parametrize(
    ("direct", "detours", "confirmed"),
    [
        ([voice((0, 1), T)], [], False),
        ([voice((0, 1), T), voice((0, 1), T)], [], False),
        ([voice((0, 1), T), voice((0, 2), OTHER)], [OTHER], False),
        ([voice((0, 1), T), voice((0, 2), T)], [], True),
        ([voice((0, 1), T)], [OTHER, T], True),
    ],
    ids=["alone", "one pair twice", "others disagree", "two pairs", "a way round"],
)
def test_a_second_pair_or_a_way_round_confirms_a_motion(direct, detours, confirmed):
    assert is_confirmed(T, direct, detours, CENTER, HypothesesConfig()) is confirmed


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
    joined = grow(found, alone, bridge_log_odds=log_odds - 0.01, min_log_odds=log_odds - 1.0)
    apart = grow(found, alone, bridge_log_odds=log_odds + 0.01, min_log_odds=log_odds - 1.0)
    assert [group.members for group in joined.groups] == [(0, 1), (2,)]
    assert [group.members for group in apart.groups] == [(0,), (1,), (2,)]


def test_a_cycle_lets_a_weaker_motion_join(found):
    surest = max(motion.log_odds for motions in found[2].values() for motion in motions)
    agreement = grow(found, found[2], bridge_log_odds=surest + 1.0, min_log_odds=0.0)
    assert [group.members for group in agreement.groups] == [(0, 1, 2)]


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
