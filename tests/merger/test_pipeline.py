import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from merger import se2
from merger.features import FeatureConfig
from merger.files.result_json import to_json_dict
from merger.grid_map import GridMap, crop_to_known
from merger.pipeline import MergeConfig, Method, merge_maps
from merger.preparation import prepare_map
from merger.random_streams import make_rng
from merger.result import PairStatus
from merger.spanning_tree import SpanningTreeConfig

_PAPER = MergeConfig(method=Method.PAPER)


def _text(result):
    return json.dumps(to_json_dict(result) | {"runtime_s": None})


def _errors(result, truth):
    """Translation and rotation errors of the placed maps in the reference's frame."""
    T_world_ref = truth[result.reference]
    errors = []
    for placement in result.maps:
        expected = se2.invert(T_world_ref) @ truth[placement.name]
        errors.append(np.abs(se2.log(se2.invert(expected) @ placement.T_ref_map)))
    return np.array(errors)


def _orders(maps):
    return [maps, maps[::-1], [*maps[1:], maps[0]]]


def test_overlapping_maps_of_a_building_are_placed_where_they_belong(three_maps):
    maps, truth = three_maps
    result = merge_maps(maps, _PAPER)
    assert result.components == (("east", "middle", "west"),)
    assert all(placement.placed for placement in result.maps)
    errors = _errors(result, truth)
    assert errors[:, :2].max() < 0.1
    assert errors[:, 2].max() < np.deg2rad(0.5)
    assert result.reference == "west"
    assert (result.placement("west").T_ref_map == np.eye(3)).all()
    assert result.runtime_s.total > 0.0


def test_the_order_of_the_maps_changes_nothing_but_the_reference(three_maps):
    maps, _ = three_maps
    fixed = {_text(merge_maps(order, replace(_PAPER, reference="middle"))) for order in _orders(maps)}
    assert len(fixed) == 1
    first = merge_maps(maps, _PAPER)
    other = merge_maps(maps[::-1], _PAPER)
    assert other.reference == "east"
    T_west_east = first.placement("east").T_ref_map
    for placement in other.maps:
        expected = first.placement(placement.name).T_ref_map
        assert np.allclose(T_west_east @ placement.T_ref_map, expected, atol=1e-9)


def test_the_same_seed_gives_the_same_result_whatever_the_number_of_workers(three_maps):
    maps, _ = three_maps
    texts = {_text(merge_maps(maps, replace(_PAPER, workers=workers, seed=7))) for workers in (1, 1, 2, 5)}
    assert len(texts) == 1


def test_moving_the_origin_of_a_map_moves_its_answer_by_just_that(three_maps):
    maps, _ = three_maps
    T_new_old = se2.make_motion(40.0, -25.0, 2.3)
    moved = [GridMap(g.name, g.log_odds, g.resolution_m, T_new_old @ g.T_map_grid) for g in maps[1:2]]
    before = merge_maps(maps, _PAPER)
    after = merge_maps([maps[0], *moved, maps[2]], _PAPER)
    for name in ("west", "east"):
        assert np.allclose(after.placement(name).T_ref_map, before.placement(name).T_ref_map, atol=1e-9)
    for field in ("T_ref_map", "T_ref_map_initial"):
        new, old = (getattr(result.placement("middle"), field) for result in (after, before))
        assert np.allclose(new @ T_new_old, old, atol=1e-9)


def test_moving_the_origin_of_the_reference_moves_all_answers(three_maps):
    maps, _ = three_maps
    T_new_old = se2.make_motion(-7.0, 3.0, -1.2)
    first = GridMap("west", maps[0].log_odds, maps[0].resolution_m, T_new_old @ maps[0].T_map_grid)
    before, after = merge_maps(maps, _PAPER), merge_maps([first, *maps[1:]], _PAPER)
    for name in ("middle", "east"):
        expected = T_new_old @ before.placement(name).T_ref_map
        assert np.allclose(after.placement(name).T_ref_map, expected, atol=1e-9)


def test_maps_of_other_sizes_and_with_a_yaw_in_their_origin_are_merged(cut_map, three_maps):
    maps, truth = three_maps
    small = cut_map("small", (3.0, 9.0), truth["west"], yaw_rad=1.3, margin_m=4.0)
    result = merge_maps([*maps, small], _PAPER)
    assert result.num_placed == 4
    assert _errors(result, truth | {"small": truth["west"]})[:, :2].max() < 0.1


def test_maps_of_two_buildings_come_back_as_two_components(cut_map, three_maps):
    maps, _ = three_maps
    others = [cut_map(f"other_{k}", span, np.eye(3), seed=9) for k, span in enumerate([(0.0, 14.0), (5.0, 24.0)])]
    strict = replace(_PAPER, ransac=replace(_PAPER.ransac, min_inliers=12))
    result = merge_maps([*maps, *others], strict)
    assert result.components == (("east", "middle", "west"), ("other_0", "other_1"))
    assert (result.placement("other_0").T_ref_map == np.eye(3)).all()
    assert np.allclose(result.placement("other_1").T_ref_map, np.eye(3), atol=0.1)


def test_a_map_that_matches_nothing_is_left_out_with_its_reason(three_maps):
    maps, _ = three_maps
    rng = np.random.default_rng(0)
    noise = GridMap("noise", np.where(rng.random((90, 90)) < 0.02, 2.0, -2.0).astype(np.float32), 0.1)
    empty = GridMap("empty", np.zeros((10, 10), dtype=np.float32), 0.1)
    result = merge_maps([*maps, noise, empty], replace(_PAPER, ransac=replace(_PAPER.ransac, min_inliers=12)))
    assert result.components == (("east", "middle", "west"), ("empty",), ("noise",))
    for name in ("noise", "empty"):
        placement = result.placement(name)
        assert not placement.placed
        assert placement.T_ref_map is None
        assert placement.reason
    assert len(result.pairs) == 10
    assert {pair.status for pair in result.pairs if "noise" in (pair.target, pair.source)} == {PairStatus.NO_MATCH}


def test_one_map_alone_is_no_merge(three_maps):
    result = merge_maps(three_maps[0][:1], _PAPER)
    assert result.num_placed == 0
    assert result.components == (("west",),)
    assert result.maps[0].reason == "there is no other map"


def test_the_merged_map_shows_the_building(cut_map, three_maps):
    maps, truth = three_maps
    merged = merge_maps(maps, _PAPER).merged
    whole = cut_map("whole", (0.0, 24.0), truth["west"])
    expected = whole.cell_centers(whole.occupied)
    walls = merged.cell_centers(merged.occupied)
    assert (cKDTree(expected).query(walls)[0] < 0.25).mean() > 0.98
    assert (cKDTree(walls).query(expected)[0] < 0.25).mean() > 0.98


def test_without_compositing_there_is_no_merged_map(three_maps):
    assert merge_maps(three_maps[0], replace(_PAPER, composite=False)).merged is None


def test_without_confirmation_no_motion_is_rejected(three_maps):
    config = replace(_PAPER, tree=SpanningTreeConfig(confirm_distance=np.inf))
    statuses = {pair.status for pair in merge_maps(three_maps[0], config).pairs}
    assert PairStatus.REJECTED not in statuses


def test_the_coarse_motions_are_chained_along_the_tree_and_the_fine_ones_are_not(cut_map):
    spans = {"a": (0.0, 16.0), "b": (4.0, 20.0), "c": (7.0, 24.0)}
    turns = {"a": 0.3, "b": 1.9, "c": -2.6}
    maps = [cut_map(name, span, se2.make_motion(1.0, 2.0, turns[name])) for name, span in spans.items()]
    result = merge_maps(maps, _PAPER)
    tree = [pair for pair in result.pairs if pair.in_tree]
    assert len(tree) == 2
    assert len([pair for pair in result.pairs if pair.status == PairStatus.RELIABLE]) == 3
    for field, chained in (("T_ref_map_initial", True), ("T_ref_map", False)):
        for pair in tree:
            T_ref_target, T_ref_source = (getattr(result.placement(n), field) for n in (pair.target, pair.source))
            same = np.allclose(se2.invert(T_ref_target) @ T_ref_source, pair.T_target_source, atol=1e-9)
            assert same == chained
    assert result.objective.residual_m <= result.objective.residual_initial_m
    assert result.objective.num_reliable == 3


def test_the_frame_in_which_motions_are_confirmed_moves_with_the_map(three_maps):
    grid = three_maps[0][0]
    T_new_old = se2.make_motion(500.0, -300.0, 2.0)
    moved = GridMap(grid.name, grid.log_odds, grid.resolution_m, T_new_old @ grid.T_map_grid)
    before, after = (prepare_map(g, FeatureConfig()).T_map_center for g in (grid, moved))
    assert np.allclose(after, T_new_old @ before, atol=1e-9)
    assert np.allclose(before[:2, 2], grid.cell_centers(grid.occupied).mean(axis=0), atol=1.0)


@pytest.mark.parametrize("names", [("a", "b"), ("b", "a")])
def test_a_random_stream_depends_on_the_seed_and_the_names_alone(names):
    draws = make_rng(3, *names).integers(1 << 30, size=4)
    assert (draws == make_rng(3, "a", "b").integers(1 << 30, size=4)).all()
    for other in (make_rng(4, *names), make_rng(3, "a", "c"), make_rng(3, "ab")):
        assert (draws != other.integers(1 << 30, size=4)).any()


def test_progress_is_told_stage_by_stage(three_maps):
    calls = []
    merge_maps(three_maps[0], _PAPER, progress=lambda *call: calls.append(call))
    assert calls[0] == ("features", 0, 3)
    assert calls[-1] == ("pairs", 3, 3)


@pytest.mark.parametrize("method", [Method.PAPER, Method.SEQUENTIAL])
def test_maps_of_different_resolutions_are_refused_by_name(cut_map, three_maps, method):
    fine = cut_map("fine", (0.0, 12.0), np.eye(3), resolution_m=0.05)
    with pytest.raises(ValueError, match=r"map 'fine' has a resolution of 0\.05 m, map 'west' of 0\.1 m"):
        merge_maps([three_maps[0][0], fine], MergeConfig(method=method))


@pytest.mark.parametrize("method", list(Method))
def test_how_much_unknown_is_around_a_map_changes_nothing(three_maps, method):
    maps, _ = three_maps
    config = MergeConfig(method=method)
    plain = [crop_to_known(grid) for grid in maps]
    wide = []
    for grid, margin in zip(plain, (0, 37, 150), strict=True):
        T_map_grid = grid.T_map_grid @ se2.make_motion(-margin * grid.resolution_m, -margin * grid.resolution_m, 0.0)
        wide.append(replace(grid, log_odds=np.pad(grid.log_odds, margin), T_map_grid=T_map_grid))
    for one, other in zip(merge_maps(plain, config).maps, merge_maps(wide, config).maps, strict=True):
        assert one.placed == other.placed
        assert np.allclose(one.T_ref_map, other.T_ref_map, atol=1e-9)


def test_bad_calls_are_refused_with_the_fact(three_maps):
    maps, _ = three_maps
    with pytest.raises(ValueError, match="no map"):
        merge_maps([], _PAPER)
    with pytest.raises(ValueError, match="two maps have the name 'west'"):
        merge_maps([maps[0], maps[1], maps[0]], _PAPER)
    with pytest.raises(ValueError, match="reference 'north' is none of the maps east, middle, west"):
        merge_maps(maps, replace(_PAPER, reference="north"))
    with pytest.raises(ValueError, match="seed must be >= 0, got -1"):
        MergeConfig(seed=-1)
    with pytest.raises(ValueError, match="workers must be >= 1, got 0"):
        MergeConfig(workers=0)
    with pytest.raises(ValueError, match=r"resolution must be in \[0.001, 100\] m, got 0"):
        MergeConfig(resolution_m=0.0)
