import json
from dataclasses import replace

import numpy as np
import pytest

from merger import se2
from merger.files.result_json import to_json_dict
from merger.grid_map import GridMap
from merger.pipeline import MergeConfig, Method, merge_maps
from merger.result import PairStatus
from merger.rival.motion_modes import MotionModesConfig
from merger.rival.shrinking_icp import ShrinkingIcpConfig

_SEQUENTIAL = MergeConfig(method=Method.SEQUENTIAL, composite=False)


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


def test_progress_tells_of_the_compiler_before_the_first_map_and_of_every_map(three_maps):
    told = []
    merge_maps(three_maps[0], _SEQUENTIAL, progress=lambda *news: told.append(news))
    assert told == [("compiler", 0, 1), ("compiler", 1, 1), ("maps", 1, 2), ("maps", 2, 2)]


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
    result = merge_maps(maps, replace(_SEQUENTIAL, modes=MotionModesConfig(min_inlier_share=0.9)))
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


def test_settings_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"modes\.min_keypoints must be >= 2, got 1"):
        MotionModesConfig(min_keypoints=1)
    with pytest.raises(ValueError, match=r"shrinking_icp\.shrink must be in \(0, 1\), got 1"):
        ShrinkingIcpConfig(shrink=1.0)
