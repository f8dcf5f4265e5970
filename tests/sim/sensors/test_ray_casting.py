import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.sensors.ray_casting import DISC_HIT, NO_HIT, Discs, cast_rays
from sim.sensors.segment_grid import build_segment_grid

_spec = importlib.util.spec_from_file_location("pymunk_rays", Path(__file__).with_name("pymunk_rays.py"))
pymunk_rays = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(pymunk_rays)

LIMIT_M = 40.0


def assert_equals_pymunk(segments, origins, angles, cell_m=None):
    space = pymunk_rays.make_space(segments)
    hits = cast_rays(build_segment_grid(segments, cell_m), origins, angles, LIMIT_M)
    for k in range(len(origins)):
        expected, _ = pymunk_rays.cast(space, origins[k], angles[k], LIMIT_M)
        same = hits.ranges_m[k] == expected or abs(hits.ranges_m[k] - expected) < 1e-9
        assert same, (origins[k], angles[k], hits.ranges_m[k], expected)


def random_world(rng, count, size=25.0):
    starts = rng.uniform(0.0, size, (count, 2))
    angles = np.where(rng.random(count) < 0.6, rng.integers(0, 4, count) * np.pi / 2, rng.uniform(0, 2 * np.pi, count))
    lengths = rng.exponential(2.0, count) + 0.01
    ends = starts + lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.stack([starts, ends], axis=1)


@pytest.mark.parametrize("cell_m", [None, 0.3, 2.0, 100.0])
def test_rays_equal_pymunk_on_random_worlds(cell_m):
    rng = np.random.default_rng(1)
    segments = random_world(rng, 300)
    origins, angles = rng.uniform(-5.0, 30.0, (3000, 2)), rng.uniform(-7.0, 7.0, 3000)
    assert_equals_pymunk(segments, origins, angles, cell_m)


def test_rays_equal_pymunk_in_an_open_world_seen_from_far_outside():
    rng = np.random.default_rng(2)
    segments = random_world(rng, 12)
    origins, angles = rng.uniform(-30.0, 55.0, (3000, 2)), rng.uniform(-np.pi, np.pi, 3000)
    assert_equals_pymunk(segments, origins, angles)


lattice = st.integers(0, 6).map(float)
corner = st.tuples(lattice, lattice)
walls = st.lists(st.tuples(corner, corner).filter(lambda ab: ab[0] != ab[1]), min_size=1, max_size=8)
fine = st.integers(-128, 7 * 128).map(lambda k: k / 128.0)  # no origin that stands within rounding of a wall
eighth = st.integers(-8, 8).map(lambda k: k * math.pi / 4.0)


@settings(max_examples=150, deadline=None)
@given(walls, corner, eighth, st.sampled_from([0.5, 1.0, 3.0]))
def test_rays_through_corners_along_walls_and_on_cell_borders_equal_pymunk(segments, origin, angle, cell_m):
    assert_equals_pymunk(np.array(segments), np.array([origin]), np.array([angle]), cell_m)


@settings(max_examples=150, deadline=None)
@given(walls, st.tuples(fine, fine), corner)
def test_rays_aimed_at_a_corner_hit_or_miss_as_in_pymunk_or_graze_it(segments, origin, target):
    """Within rounding of a corner, a hit and a miss are both right: pymunk decides by the last bit."""
    segments, origin = np.array(segments), np.array(origin)
    angle = math.atan2(target[1] - origin[1], target[0] - origin[0])
    space = pymunk_rays.make_space(segments)
    found = cast_rays(build_segment_grid(segments), origin[None], np.array([angle]), LIMIT_M).ranges_m[0]
    answers = [pymunk_rays.cast(space, origin, angle + off, LIMIT_M)[0] for off in (0.0, -1e-12, 1e-12)]
    assert any(found == answer or abs(found - answer) < 1e-9 for answer in answers)


def test_moving_discs_are_met_as_in_pymunk():
    rng = np.random.default_rng(3)
    segments, centers = random_world(rng, 60), rng.uniform(0.0, 25.0, (12, 2))
    radii = rng.uniform(0.1, 0.6, 12)
    origins, angles = rng.uniform(0.0, 25.0, (4000, 2)), rng.uniform(-np.pi, np.pi, 4000)
    space = pymunk_rays.make_space(segments, centers, radii)
    hits = cast_rays(build_segment_grid(segments), origins, angles, LIMIT_M, Discs(centers[None], radii))
    assert np.count_nonzero(hits.segments == DISC_HIT) > 200
    for k in range(len(origins)):
        expected, tag = pymunk_rays.cast(space, origins[k], angles[k], LIMIT_M)
        grazing = tag == DISC_HIT and hits.incidence_cos[k] < 1e-3
        assert grazing or hits.ranges_m[k] == expected or abs(hits.ranges_m[k] - expected) < 1e-9


def test_a_disc_may_stand_elsewhere_for_each_ray():
    grid = build_segment_grid(np.array([[[10.0, -5.0], [10.0, 5.0]]]))
    discs = Discs(np.array([[[5.0, 0.0]], [[5.0, 3.0]]]), np.array([1.0]))
    hits = cast_rays(grid, np.zeros((2, 2)), np.zeros(2), LIMIT_M, discs)
    np.testing.assert_allclose(hits.ranges_m, [4.0, 10.0], atol=1e-12)
    assert hits.segments.tolist() == [DISC_HIT, 0]


def test_a_ray_that_starts_in_a_disc_or_on_a_wall_meets_it_at_once_as_in_pymunk():
    walls, center = np.array([[[10.0, -5.0], [10.0, 5.0]]]), np.zeros((1, 2))
    space = pymunk_rays.make_space(walls, center, [1.0])
    starts = np.array([[0.5, 0.0], [10.0, 2.0]])
    hits = cast_rays(build_segment_grid(walls), starts, np.zeros(2), LIMIT_M, Discs(center[None], np.array([1.0])))
    assert [pymunk_rays.cast(space, start, 0.0, LIMIT_M)[0] for start in starts] == [0.0, 0.0]
    assert hits.ranges_m.tolist() == [0.0, 0.0]
    assert hits.segments.tolist() == [DISC_HIT, 0]


def test_hits_tell_the_segment_and_the_angle_of_incidence():
    segments = np.array([[[3.0, -9.0], [3.0, 9.0]], [[-9.0, 8.0], [9.0, 8.0]]])
    hits = cast_rays(build_segment_grid(segments), np.zeros((3, 2)), np.radians([0.0, 60.0, 90.0]), LIMIT_M)
    assert hits.segments.tolist() == [0, 0, 1]
    np.testing.assert_allclose(hits.incidence_cos, [1.0, 0.5, 1.0], atol=1e-12)


def test_nothing_is_met_in_an_empty_world():
    hits = cast_rays(build_segment_grid(np.zeros((0, 2, 2))), np.zeros((2, 2)), np.array([0.0, 1.0]), LIMIT_M)
    assert np.isposinf(hits.ranges_m).all()
    assert (hits.segments == NO_HIT).all()


def test_a_wall_beyond_the_limit_is_not_met():
    grid = build_segment_grid(np.array([[[41.0, -5.0], [41.0, 5.0]]]))
    assert np.isposinf(cast_rays(grid, np.zeros((1, 2)), np.zeros(1), LIMIT_M).ranges_m[0])


def test_walls_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="finite"):
        build_segment_grid(np.array([[[0.0, 0.0], [np.nan, 1.0]]]))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(-3.0, 3.0), st.floats(-100.0, 100.0))
def test_turning_and_shifting_the_world_with_the_rays_changes_no_range(seed, turn, shift):
    rng = np.random.default_rng(seed)
    segments, origins, angles = random_world(rng, 40), rng.uniform(0.0, 25.0, (50, 2)), rng.uniform(-3.0, 3.0, 50)
    R = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    before = cast_rays(build_segment_grid(segments), origins, angles, LIMIT_M).ranges_m
    after = cast_rays(build_segment_grid(segments @ R.T + shift), origins @ R.T + shift, angles + turn, LIMIT_M)
    np.testing.assert_allclose(after.ranges_m, before, atol=1e-7)
