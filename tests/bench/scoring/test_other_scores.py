"""Laws of the scores of pairs, relations, grids, confidences and 'Obj.'."""

import itertools

import numpy as np
import pytest

from bench.cell import Outcome
from bench.scoring import calibration, grid_metrics, map_raster, objective, pair_metrics, relation_metrics
from bench.scoring.nearest_other import nearest_other_m
from bench.scoring.scores import score_result
from bench.scoring.statistics import breaking_point, wilson_share
from bench.scoring.yardstick import make_yardstick
from merger import se2
from merger.edges import extract_edge_points
from merger.grid_map import GridMap


def draw_motions(seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return se2.make_motion(*rng.uniform(-20, 20, (2, count)), rng.uniform(-np.pi, np.pi, count))


def test_true_edges_have_full_precision_and_recall(answer, pair) -> None:
    truth = draw_motions(0, 3)
    overlap = np.array([[1.0, 0.5, 0.0], [0.1, 1.0, 0.3], [0.0, 0.0, 1.0]])
    pairs = (
        pair(0, 1, se2.invert(truth[0]) @ truth[1]),
        pair(1, 2, se2.invert(truth[1]) @ truth[2]),
        pair(0, 2, se2.make_motion(50.0, 0.0, 0.0), "rejected"),
    )
    scores = pair_metrics.score_pairs(answer(truth, pairs=pairs), truth, overlap)
    assert (scores.edge_precision, scores.edge_recall) == (1.0, 1.0)
    assert scores.edge_precision_initial == pytest.approx(2 / 3)
    assert scores.num_edges == 2


def test_a_false_edge_costs_precision_and_a_missing_one_recall(answer, pair) -> None:
    truth = draw_motions(1, 3)
    overlap = np.full((3, 3), 0.4)
    pairs = (pair(0, 1, se2.invert(truth[0]) @ truth[1]), pair(0, 2, np.eye(3)), pair(1, 2, None, "no_match"))
    scores = pair_metrics.score_pairs(answer(truth, pairs=pairs), truth, overlap)
    assert scores.edge_precision == 0.5
    assert scores.edge_recall == pytest.approx(1 / 3)


def test_a_method_that_names_no_pair_has_no_pair_scores(answer) -> None:
    truth = draw_motions(2, 3)
    assert np.isnan(pair_metrics.score_pairs(answer(truth), truth, np.ones((3, 3))).edge_precision)


def test_a_pair_on_which_a_method_is_silent_is_one_that_it_did_not_find(dataset, answer, pair) -> None:
    yardstick, truth = make_yardstick(dataset), dataset.truth.T_world_map
    _, _, silent = score_result(yardstick, answer(truth), Outcome("ok"))
    _, _, named = score_result(yardstick, answer(truth, pairs=(pair(2, 1, np.eye(3)),)), Outcome("ok"))
    assert silent == []
    every = set(map(frozenset, itertools.combinations(dataset.truth.names, 2)))
    assert {frozenset((row.target, row.source)) for row in named} == every
    assert [row.status for row in named] == ["reliable", *["no_match"] * 5]


def test_relations_are_exact_under_the_truth_and_feel_a_shift(answer) -> None:
    truth = draw_motions(3, 4)
    overlap = np.full((4, 4), 0.5)
    exact = relation_metrics.score_relations(answer(draw_motions(4, 1)[0] @ truth), truth, overlap)
    assert exact.relation_error_m == pytest.approx(0.0, abs=1e-9)
    assert exact.num_relations == 6
    shifted = truth.copy()
    shifted[0, 0, 2] += 2.0
    assert relation_metrics.score_relations(answer(shifted), truth, overlap).relation_error_m == pytest.approx(1.0)


def test_the_objective_is_zero_where_two_maps_are_the_same_and_grows_with_a_shift(dataset) -> None:
    grid = dataset.maps[0]
    edges = [se2.transform_points(grid.T_map_grid, extract_edge_points(grid))] * 2
    cells = [grid.resolution_m] * 2
    identity = np.stack([np.eye(3)] * 2)
    together = np.zeros(2, dtype=np.int64)
    assert objective.score_objective(edges, cells, identity, together) == 0.0
    moved = identity.copy()
    moved[1, 0, 2] = 3 * grid.resolution_m
    assert objective.score_objective(edges, cells, moved, together) > 0.1


@pytest.mark.parametrize("spread", ["round", "line", "point", "outlier"])
def test_the_nearest_point_of_another_group_is_that_of_a_search_through_all(spread) -> None:
    rng = np.random.default_rng(5)
    points, group = rng.normal(0.0, 3.0, (300, 2)), rng.integers(0, 4, 300)
    if spread == "line":
        points[:, 1] = 0.0
    elif spread == "point":
        points[:] = points[0]
    elif spread == "outlier":
        points[0] = (1e6, -1e5)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    apart[group[:, None] == group[None]] = np.inf
    np.testing.assert_allclose(nearest_other_m(points, group), apart.min(axis=1), rtol=1e-9, atol=1e-9)
    assert np.isinf(nearest_other_m(points, np.zeros(300, dtype=np.int64))).all()


def test_the_objective_of_trimmed_distances_follows_its_formula() -> None:
    distances = np.array([0.0, 1.0, 1.0, 10.0])
    expected = min(0.0, (2 / 3) / 0.75**3, 102 / 4)
    assert objective.map_objective(distances) == expected
    assert objective.map_objective(np.full(5, 2.0)) == 4.0


def test_the_true_motions_reach_the_floor_of_the_objective(dataset) -> None:
    edges = [se2.transform_points(m.T_map_grid, extract_edge_points(m)) for m in dataset.maps]
    cells = [m.resolution_m for m in dataset.maps]
    together = np.zeros(len(edges), dtype=np.int64)
    floor = objective.score_objective(edges, cells, dataset.truth.T_world_map, together)
    bent = dataset.truth.T_world_map.copy()
    bent[1, 0, 2] += 0.5
    assert 0.0 < floor < 2.0
    assert objective.score_objective(edges, cells, bent, together) > floor


def test_grids_laid_by_the_truth_agree_with_the_true_map(dataset) -> None:
    truth = dataset.truth.T_world_map
    true = grid_metrics.lay_true_grid(dataset.maps, truth)
    scores = grid_metrics.score_grids(true, truth)
    assert (scores.iou_occupied, scores.iou_free) == (1.0, 1.0)
    assert scores.acceptance > 0.9
    bent = truth.copy()
    bent[2, 1, 2] += 1.0
    worse = grid_metrics.score_grids(true, bent)
    assert worse.acceptance < scores.acceptance
    assert worse.iou_occupied < 0.9


@pytest.mark.parametrize("shift_m", [3.0, 30.0, 3e4])
def test_a_map_that_is_laid_beyond_the_true_map_costs_its_cells_twice(dataset, shift_m) -> None:
    truth = dataset.truth.T_world_map
    true = grid_metrics.lay_true_grid(dataset.maps, truth)
    without, away = truth.copy(), truth.copy()
    without[0] = np.nan
    away[0, :2, 2] += (-shift_m, shift_m)
    left_out, far_off = grid_metrics.score_grids(true, without), grid_metrics.score_grids(true, away)
    assert far_off.iou_free < left_out.iou_free < 1.0


def test_the_acceptance_index_counts_pairs_of_maps() -> None:
    rows = [[2.0, -2.0, 0.0], [-2.0, -2.0, 0.0], [2.0, -2.0, 2.0]]
    maps = [GridMap(f"m{k}", np.array([row], dtype=np.float32), 0.1) for k, row in enumerate(rows)]
    poses = np.broadcast_to(np.eye(3), (3, 3, 3))
    scores = grid_metrics.score_grids(grid_metrics.lay_true_grid(maps, poses), poses)
    assert (scores.acceptance, scores.acceptance_count) == (4 / 6, 6)
    alone = np.concatenate([poses[:1], np.full((2, 3, 3), np.nan)])
    assert np.isnan(grid_metrics.score_grids(grid_metrics.lay_true_grid(maps, poses), alone).acceptance)


@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.0), (0.4, -0.3, 0.2), (-20.0, 3.0, 2.0)])
def test_a_merge_is_compared_with_the_truth_cell_by_cell(dataset, moved) -> None:
    maps, T = dataset.maps, dataset.truth.T_world_map
    estimated = T @ np.stack([np.eye(3), se2.make_motion(*moved)] * (len(T) // 2))
    true = grid_metrics.lay_true_grid(maps, T)
    sheets = [map_raster.make_sheet(m) for m in maps]
    low, high = map_raster.bounds_m([*sheets, *sheets], np.concatenate([T, estimated]))
    cell, pads = true.raster.cell_m, np.ceil((np.array([true.raster.x_min_m, true.raster.y_min_m]) - low) / 0.05)
    corner = np.array([true.raster.x_min_m, true.raster.y_min_m]) - pads * cell
    cols, rows = np.ceil((high - corner) / cell).astype(int) + 1
    raster = map_raster.Raster(*corner, cell, rows, cols)
    layers = [map_raster.count_votes(sheets, poses, raster) for poses in (T, estimated)]
    walls = [(o > 0) & (o >= f) for o, f in layers]
    floors = [(f > 0) & (f > o) for o, f in layers]
    occupied, free = (layer.astype(int) for layer in layers[1])
    agree, disagree = (occupied * (occupied - 1) + free * (free - 1)).sum() // 2, (occupied * free).sum()
    scores = grid_metrics.score_grids(true, estimated)
    assert abs(scores.acceptance_count - agree - disagree) <= 1e-3 * (agree + disagree)  # cells on borders
    np.testing.assert_allclose(scores.acceptance, agree / (agree + disagree), rtol=1e-3)
    for value, (was, now) in ((scores.iou_occupied, walls), (scores.iou_free, floors)):
        np.testing.assert_allclose(value, (was & now).sum() / (was | now).sum(), rtol=1e-3)


@pytest.mark.parametrize("theta", [0.0, 1e-18, 0.3, np.pi / 2, -2.5])
def test_every_raster_cell_gets_the_votes_of_the_map_cells_at_its_centre(dataset, theta) -> None:
    maps, T_world_map = (
        dataset.maps[:2],
        np.stack([se2.make_motion(3.0, -1.0, theta), se2.make_motion(5.0, 2.0, theta)]),
    )
    raster = grid_metrics.lay_true_grid(maps, T_world_map).raster
    votes = map_raster.count_votes([map_raster.make_sheet(m) for m in maps], T_world_map, raster)
    cols, rows = np.meshgrid(np.arange(raster.cols) + 0.5, np.arange(raster.rows) + 0.5)
    centres = np.stack([raster.x_min_m + cols * raster.cell_m, raster.y_min_m + rows * raster.cell_m], axis=-1)
    expected = np.zeros((2, raster.rows, raster.cols), dtype=int)
    for grid, T in zip(maps, T_world_map, strict=True):
        at = np.floor(grid.cells_from_points_map(se2.transform_points(se2.invert(T), centres.reshape(-1, 2)))).astype(
            int
        )
        inside = np.flatnonzero(np.all((at >= 0) & (at < grid.log_odds.shape), axis=1))
        for layer, mask in zip(expected, (grid.occupied, grid.free), strict=True):
            layer.reshape(-1)[inside] += mask[tuple(at[inside].T)]
    different = np.count_nonzero(expected != np.stack(votes))
    assert different <= 1e-4 * expected.size  # centres on the border of two cells
    assert expected.sum() > 100


def test_honest_confidences_have_no_calibration_error() -> None:
    confidence = np.repeat([0.25, 0.75], 4)
    right = np.array([True, False, False, False, True, True, True, False])
    assert calibration.calibration_error(confidence, right) == pytest.approx(0.0)
    assert calibration.calibration_error(np.ones(4), np.zeros(4, dtype=bool)) == 1.0
    assert np.isnan(calibration.brier_score(np.full(2, np.nan), np.ones(2, dtype=bool)))


def test_wilson_intervals_agree_with_published_values() -> None:
    share = wilson_share(81, 263)
    assert (share.low, share.high) == (pytest.approx(0.2553, abs=1e-4), pytest.approx(0.3662, abs=1e-4))
    assert wilson_share(0, 10).low == 0.0
    assert wilson_share(10, 10).high == 1.0


def test_the_breaking_point_lies_between_the_values_around_it() -> None:
    assert breaking_point([0.0, 0.1, 0.2], [1.0, 1.0, 0.8], 0.9, hard_is_high=True) == pytest.approx(0.15)
    assert breaking_point([0.4, 0.2, 0.0], [1.0, 0.6, 0.0], 0.5, hard_is_high=False) == pytest.approx(0.2 - 0.2 / 6)
    assert np.isnan(breaking_point([0.0, 1.0], [1.0, 1.0], 0.9, hard_is_high=True))
