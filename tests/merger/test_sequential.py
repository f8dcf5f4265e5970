import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from merger import se2
from merger.grid_map import GridMap
from merger.motion_modes import MotionModesConfig, find_modes
from merger.pipeline import MergeConfig, Method, merge_maps
from merger.result import PairStatus
from merger.result_json import to_json_dict

_QUICK = MotionModesConfig(num_draws=5000, num_guesses=60)
_SEQUENTIAL = MergeConfig(method=Method.SEQUENTIAL, composite=False, modes=_QUICK)


def test_maps_are_merged_one_after_another_into_the_first(three_maps):
    maps, truth = three_maps
    result = merge_maps(maps, _SEQUENTIAL)
    assert result.components == (("east", "middle", "west"),)
    for placement in result.maps:
        expected = se2.invert(truth["west"]) @ truth[placement.name]
        error = np.abs(se2.log(se2.invert(expected) @ placement.T_ref_map))
        assert error[:2].max() < 0.2
        assert error[2] < np.deg2rad(1.0)
    assert [(pair.target, pair.source) for pair in result.pairs] == [("west", "east"), ("west", "middle")]


def test_a_map_whose_turn_comes_too_early_is_left_out_with_its_reason(three_maps):
    maps, _ = three_maps
    empty = GridMap("empty", np.zeros((10, 10), dtype=np.float32), 0.1)
    result = merge_maps([maps[0], empty, maps[1]], _SEQUENTIAL)
    assert result.components == (("middle", "west"), ("empty",))
    assert not result.placement("empty").placed
    assert "not merged when its turn came" in result.placement("empty").reason
    assert next(pair for pair in result.pairs if pair.source == "empty").status == PairStatus.NO_MATCH


def test_maps_that_never_meet_are_all_left_out(cut_map):
    maps = [cut_map("a", (0.0, 5.5), np.eye(3)), cut_map("b", (18.5, 24.0), np.eye(3), seed=5)]
    result = merge_maps(maps, replace(_SEQUENTIAL, modes=replace(_QUICK, min_support=40)))
    assert result.components == (("a",), ("b",))
    assert result.num_placed == 0
    assert all(placement.reason for placement in result.maps)


def test_the_reference_may_be_any_map(three_maps):
    maps, _ = three_maps
    first, other = (merge_maps(maps, replace(_SEQUENTIAL, reference=name)) for name in ("west", "east"))
    T_west_east = first.placement("east").T_ref_map
    for placement in other.maps:
        expected = first.placement(placement.name).T_ref_map
        assert np.allclose(T_west_east @ placement.T_ref_map, expected, atol=1e-9)


def test_the_same_seed_gives_the_same_result(three_maps):
    texts = {json.dumps(to_json_dict(merge_maps(three_maps[0], _SEQUENTIAL)) | {"runtime_s": 0}) for _ in range(2)}
    assert len(texts) == 1


def test_two_motions_with_equal_support_give_two_modes_with_their_weights():
    rng = np.random.default_rng(0)
    truth = [se2.make_motion(1.0, 2.0, 0.4), se2.make_motion(-6.0, 0.0, -2.0)]
    source = rng.uniform(-8, 8, size=(80, 2))
    target = np.concatenate([se2.transform_points(T, source) for T in truth])
    matches = np.stack([np.arange(160), np.tile(np.arange(80), 2)], axis=1)
    modes = find_modes(target, source, matches, MotionModesConfig(), rng)
    assert len(modes) >= 2
    assert sum(mode.weight for mode in modes) == pytest.approx(1.0)
    assert all(first.weight >= second.weight for first, second in pairwise(modes))
    for T in truth:
        assert min(np.abs(mode.T_target_source - T).max() for mode in modes[:2]) < 1e-6
    assert all(np.linalg.eigvalsh(mode.covariance).min() >= -1e-12 for mode in modes)
    assert modes[0].support == 80


def test_without_candidates_there_is_no_mode():
    none = np.zeros((0, 2), dtype=np.intp)
    points = np.zeros((3, 2))
    assert find_modes(points, points, none, MotionModesConfig(), np.random.default_rng(0)) == []


def test_settings_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"modes\.min_support must be >= 3, got 2"):
        MotionModesConfig(min_support=2)
