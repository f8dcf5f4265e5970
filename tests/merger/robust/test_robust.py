"""The robust method, whole: placements that are right, and nothing placed that is not sure."""

import itertools

import numpy as np
import pytest

from merger import se2
from merger.files.result_json import from_json_dict, to_json_dict
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig
from merger.pipeline import merge_maps
from merger.result import MergeResult, Method, PairStatus
from merger.robust.scale_estimation import scale_map

CONFIG = MergeConfig(method=Method.ROBUST)
SPANS = ((0.0, 10.0), (5.0, 15.0), (10.0, 20.0), (14.0, 24.0))
RESOLUTIONS_M = (0.05, 0.1, 0.05, 0.1)


def place(number: int) -> np.ndarray:
    return se2.make_motion(3.0 * number - 4.0, 2.0 - number, 0.9 * number + 0.2)


@pytest.fixture(scope="module")
def parts(cut_map):
    """Four parts of one building, of two resolutions, with yaws in their origins."""
    return [
        cut_map(f"part_{k}", span, place(k), resolution_m=resolution_m, yaw_rad=0.4 * k)
        for k, (span, resolution_m) in enumerate(zip(SPANS, RESOLUTIONS_M, strict=True))
    ]


@pytest.fixture(scope="module")
def merged(parts) -> MergeResult:
    return merge_maps(parts, CONFIG)


def errors(result: MergeResult, reference: int) -> tuple[float, float]:
    """Largest error of the placed parts at the building's middle, metres and degrees."""
    shift, turn = [0.0], [0.0]
    for item in result.maps:
        number = int(item.name[-1])
        if item.placed:
            T_true = se2.invert(place(reference)) @ place(number)
            center = se2.transform_points(se2.invert(place(number)), np.array([[12.0, 8.0]]))
            shift.append(
                float(
                    np.linalg.norm(se2.transform_points(item.T_ref_map, center) - se2.transform_points(T_true, center))
                )
            )
            turn.append(float(np.degrees(np.abs(se2.angle_of(se2.invert(T_true) @ item.T_ref_map)))))
    return max(shift), max(turn)


def test_parts_of_mixed_resolutions_with_yaws_are_all_placed_right(merged):
    assert [item.placed for item in merged.maps] == [True] * 4
    shift_m, turn_deg = errors(merged, 0)
    assert shift_m < 0.06
    assert turn_deg < 0.2


def test_every_placed_map_has_a_confidence_and_a_covariance(merged):
    for item in merged.maps:
        assert 0.9 < item.confidence <= 1.0
        assert np.linalg.eigvalsh(item.covariance).min() > -1e-12


def test_the_order_of_the_maps_and_the_reference_change_only_the_frame(parts, merged):
    other = merge_maps([parts[k] for k in (2, 0, 3, 1)], CONFIG)
    assert other.reference == "part_2"
    assert other.components == merged.components
    T_ref_other = merged.placement("part_2").T_ref_map
    for item in other.maps:
        assert T_ref_other @ item.T_ref_map == pytest.approx(merged.placement(item.name).T_ref_map, abs=1e-6)
    there, back = other.placement("part_0"), merged.placement("part_2")
    J = se2.adjoint(back.T_ref_map)
    assert there.covariance == pytest.approx(J @ back.covariance @ J.T, rel=1e-6)
    # Part 3 lies beside part 2, from which its angle is surer than from part 0.
    assert other.placement("part_3").covariance[2, 2] < merged.placement("part_3").covariance[2, 2]


def test_the_answer_does_not_depend_on_the_number_of_workers(parts, merged):
    threaded = merge_maps(parts, MergeConfig(method=Method.ROBUST, workers=2))
    for item in threaded.maps:
        assert item.T_ref_map == pytest.approx(merged.placement(item.name).T_ref_map, abs=1e-12)


def test_the_answer_survives_its_json(merged):
    again = from_json_dict(to_json_dict(merged))
    assert again.components == merged.components
    assert [pair.status for pair in again.pairs] == [pair.status for pair in merged.pairs]


def test_maps_of_two_buildings_stay_apart(parts, cut_map):
    strangers = [cut_map(f"other_{k}", SPANS[k], place(k), seed=7) for k in range(3)]
    result = merge_maps([*parts[:3], *strangers], CONFIG)
    for members in result.components:
        assert len({name.split("_")[0] for name in members}) == 1
    assert len(result.components[0]) == 3


def test_a_map_that_is_left_out_has_its_reason_in_words(parts, cut_map):
    result = merge_maps([*parts[:2], cut_map("zother", (0.0, 10.0), place(1), seed=7)], CONFIG)
    left_out = result.placement("zother")
    assert not left_out.placed
    assert "no motion onto another map is sure enough" in left_out.reason
    for pair in result.pairs:
        assert (pair.reason is None) == (pair.status is PairStatus.RELIABLE)


def corridor(name: str, doors_m: tuple[float, ...] = ()) -> GridMap:
    """16 m of a corridor whose ends nobody has seen; a door is a gap in one wall."""
    cells = np.zeros((60, 340), np.float32)
    cells[10:50, 10:330] = -2.0
    cells[9], cells[50] = 0.0, 0.0
    cells[9, 10:330] = cells[50, 10:330] = 2.0
    for door_m in doors_m:
        col = 10 + round(door_m / 0.05)
        cells[50, col : col + 20] = -2.0
    return GridMap(name, cells, 0.05)


def test_a_bare_corridor_is_not_accepted_at_any_shift():
    result = merge_maps([corridor("a"), corridor("b")], CONFIG)
    assert [item.placed for item in result.maps] == [False, False]


def test_a_corridor_of_equal_doors_is_not_accepted():
    doors = tuple(np.arange(1.0, 15.0, 3.0))
    result = merge_maps([corridor("a", doors), corridor("b", doors[:-1])], CONFIG)
    assert [item.placed for item in result.maps] == [False, False]


def test_maps_without_walls_or_without_any_known_cell_are_left_out(parts):
    blank = GridMap("blank", np.zeros((40, 40), np.float32), 0.05)
    floor = GridMap("floor", np.full((40, 40), -2.0, np.float32), 0.05)
    result = merge_maps([*parts[:2], blank, floor], CONFIG)
    assert [result.placement(name).placed for name in ("part_0", "part_1", "blank", "floor")] == [
        True,
        True,
        False,
        False,
    ]


def test_one_map_alone_is_not_placed(parts):
    result = merge_maps(parts[:1], CONFIG)
    assert result.components == (("part_0",),)
    assert result.maps[0].reason == "there is no other map"


def test_moving_a_map_by_its_origin_moves_its_answer_by_just_that(parts, merged):
    T_new_old = se2.make_motion(3.0, -2.0, 0.7)
    moved = GridMap("part_3", parts[3].log_odds, parts[3].resolution_m, T_new_old @ parts[3].T_map_grid)
    result = merge_maps([*parts[:3], moved], CONFIG)
    T_ref_new = result.placement("part_3").T_ref_map
    assert T_ref_new @ T_new_old == pytest.approx(merged.placement("part_3").T_ref_map, abs=2e-3)


def test_confirmed_pairs_agree_with_the_placement(merged):
    reliable = [pair for pair in merged.pairs if pair.status is PairStatus.RELIABLE]
    assert len(reliable) >= 3
    for pair in reliable:
        T = se2.invert(merged.placement(pair.target).T_ref_map) @ merged.placement(pair.source).T_ref_map
        assert np.linalg.norm(se2.log(se2.invert(T) @ pair.T_target_source)) < 0.3
        assert np.linalg.eigvalsh(pair.information).min() > 0.0
    assert sum(pair.in_tree for pair in merged.pairs) == 3
    assert len(list(itertools.combinations(range(4), 2))) == len(merged.pairs)


@pytest.mark.parametrize("factor", [0.95, 1.0, 1.04])
def test_a_stated_resolution_that_is_off_is_estimated_on_request(cut_map, factor):
    parts = [cut_map(f"part_{k}", SPANS[k], place(k), resolution_m=0.1) for k in range(2)]
    off = GridMap("part_1", parts[1].log_odds, 0.1 * factor, scale_map(parts[1], factor).T_map_grid)
    result = merge_maps([parts[0], off], MergeConfig(method=Method.ROBUST, estimate_scale=True))
    assert result.placement("part_1").placed
    assert result.placement("part_1").scale == pytest.approx(1.0 / factor, abs=0.004)
    assert result.placement("part_0").scale == 1.0
    assert errors(result, 0)[0] < 0.1
