"""Laws of the placement scores."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.scoring import metrics
from merger import se2

ALL = np.ones(6, dtype=bool)
ONE = np.zeros(6, dtype=np.int64)


def draw_motions(seed: int, count: int = 6) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return se2.make_motion(*rng.uniform(-20, 20, (2, count)), rng.uniform(-np.pi, np.pi, count))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_perfect_motions_score_zero_in_any_frame(seed: int) -> None:
    truth = draw_motions(seed)
    gauge = draw_motions(seed + 1, 1)[0]
    errors = metrics.placement_errors(truth, ALL, ONE, gauge @ truth)
    np.testing.assert_allclose(errors.error_m, 0.0, atol=1e-9)
    np.testing.assert_allclose(errors.error_deg, 0.0, atol=1e-6)
    assert not errors.wrong.any()


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_the_frame_of_the_answer_changes_no_error(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = draw_motions(seed)
    estimate = truth @ se2.exp(rng.normal(0, [0.1, 0.1, 0.01], (6, 3)))
    before = metrics.placement_errors(truth, ALL, ONE, estimate)
    after = metrics.placement_errors(truth, ALL, ONE, draw_motions(seed + 1, 1)[0] @ estimate)
    np.testing.assert_allclose(before.error_m, after.error_m, atol=1e-9)
    np.testing.assert_allclose(before.error_deg, after.error_deg, atol=1e-6)


@pytest.mark.parametrize("moved", range(6))
def test_one_map_shifted_by_a_metre_is_wrong_and_the_rest_is_not(moved: int) -> None:
    truth = draw_motions(3)
    estimate = truth.copy()
    estimate[moved, 0, 2] += 1.0
    errors = metrics.placement_errors(truth, ALL, ONE, estimate)
    assert errors.wrong.tolist() == [k == moved for k in range(6)]
    assert errors.error_m[moved] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("distance_m", [1e17, 1e300, 1.7e308])
def test_maps_so_far_away_that_rounding_hides_their_places_are_wrong(distance_m: float) -> None:
    truth = draw_motions(3)
    estimate = truth.copy()
    estimate[:, 0, 2] += distance_m
    with np.errstate(over="ignore", invalid="ignore"):
        errors = metrics.placement_errors(truth, ALL, ONE, estimate)
    assert errors.wrong.sum() >= 5


def test_a_map_turned_by_three_degrees_is_wrong() -> None:
    truth = draw_motions(4)
    estimate = truth.copy()
    estimate[2] = estimate[2] @ se2.make_motion(0.0, 0.0, np.deg2rad(3.0))
    assert metrics.placement_errors(truth, ALL, ONE, estimate).wrong.tolist() == [k == 2 for k in range(6)]


def test_the_frame_follows_the_majority_even_when_the_reference_is_wrong() -> None:
    truth = draw_motions(5)
    estimate = se2.invert(truth[0]) @ truth
    estimate[1:] = se2.make_motion(7.0, -3.0, 0.4) @ estimate[1:]
    assert metrics.placement_errors(truth, ALL, ONE, estimate).wrong.tolist() == [True] + [False] * 5


def test_errors_just_inside_the_bounds_are_right() -> None:
    truth = draw_motions(6)
    estimate = truth.copy()
    estimate[4, :2, 2] += [0.3, 0.39]
    assert not metrics.placement_errors(truth, ALL, ONE, estimate).wrong.any()


def test_every_component_has_its_own_frame() -> None:
    truth = draw_motions(7)
    component = np.array([0, 0, 0, 1, 1, 1])
    estimate = truth.copy()
    estimate[3:] = draw_motions(8, 1)[0] @ estimate[3:]
    assert not metrics.placement_errors(truth, ALL, component, estimate).wrong.any()


def test_a_map_alone_or_not_placed_has_no_error_and_is_not_wrong() -> None:
    truth = draw_motions(9)
    placed = np.array([True, True, True, True, False, True])
    component = np.array([0, 0, 0, 0, 0, 1])
    errors = metrics.placement_errors(truth, placed, component, truth)
    assert np.isnan(errors.error_m).tolist() == [False] * 4 + [True] * 2
    assert not errors.wrong.any()


def test_success_needs_every_map_in_one_component_and_none_wrong(answer) -> None:
    truth = draw_motions(10)

    def success(prediction) -> bool:
        errors = metrics.placement_errors(truth, prediction.placed, prediction.component, prediction.T_ref_map)
        return metrics.score_placement(prediction, errors).success

    assert success(answer(truth))
    assert not success(answer(truth, placed=np.array([True] * 5 + [False])))
    assert not success(answer(truth, component=np.array([0, 0, 0, 1, 1, 1])))
    shifted = truth.copy()
    shifted[0, 0, 2] += 5.0
    assert not success(answer(shifted))


def test_nothing_placed_scores_nothing(answer) -> None:
    truth = draw_motions(11)
    prediction = answer(np.full((6, 3, 3), np.nan), placed=np.zeros(6, dtype=bool), component=np.arange(6))
    errors = metrics.placement_errors(truth, prediction.placed, prediction.component, prediction.T_ref_map)
    placement = metrics.score_placement(prediction, errors)
    assert (placement.num_placed, placement.num_wrong, placement.success) == (0, 0, False)
    assert np.isnan(placement.max_error_m)


def test_two_maps_that_contradict_each_other_count_one_wrong() -> None:
    truth = draw_motions(12, 2)
    estimate = truth.copy()
    estimate[1, 0, 2] += 4.0
    errors = metrics.placement_errors(truth, np.ones(2, bool), np.zeros(2, np.int64), estimate)
    assert errors.wrong.sum() == 1
