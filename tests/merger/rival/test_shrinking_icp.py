import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merger import se2
from merger.nearest_edges import index_edges
from merger.rival.shrinking_icp import ShrinkingIcpConfig, align_points


def _draw_walls(rng):
    """Points on the walls of a few boxes."""
    points = []
    for _ in range(6):
        corner, size = rng.uniform(-8, 8, size=2), rng.uniform(1.0, 5.0, size=2)
        side = rng.random((60, 2)) * size
        side[np.arange(60), rng.integers(2, size=60)] = 0.0
        points.append(corner + side)
    return np.concatenate(points)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_exact_points_give_the_exact_motion_from_a_perturbed_start(seed):
    rng = np.random.default_rng(seed)
    target = _draw_walls(rng)
    T = se2.make_motion(*rng.uniform(-5, 5, size=2), rng.uniform(-np.pi, np.pi))
    start = T @ se2.make_motion(*rng.uniform(-0.05, 0.05, size=2), rng.uniform(-0.01, 0.01))
    found = align_points(
        index_edges(target, 0.05), se2.transform_points(se2.invert(T), target), start, ShrinkingIcpConfig()
    )
    assert np.allclose(found.T_target_source, T, atol=1e-6)
    assert found.goodness == 1.0
    assert found.rmse_m < 1e-6


def test_goodness_is_the_share_of_points_that_have_a_counterpart():
    target = _draw_walls(np.random.default_rng(3))
    source = np.concatenate([target, target + 100.0])
    found = align_points(index_edges(target, 0.05), source, np.eye(3), ShrinkingIcpConfig())
    assert found.goodness == pytest.approx(0.5)


def test_without_a_point_within_reach_the_motion_stays_and_is_worth_nothing():
    target = _draw_walls(np.random.default_rng(4))
    start = se2.make_motion(500.0, 0.0, 0.3)
    found = align_points(index_edges(target, 0.05), target, start, ShrinkingIcpConfig())
    assert (found.T_target_source == start).all()
    assert found.goodness == 0.0
