"""Runs are cut into parts that overlap as asked."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from merger import se2
from sim.maps.submaps import SubmapsConfig, cut_submaps, draw_submap_frame


@given(st.lists(st.integers(5, 3000), min_size=1, max_size=4), st.integers(0, 12), st.floats(0.0, 0.9))
def test_the_cuts_cover_every_scan_in_order_and_each_has_one(num_scans, more, overlap):
    count = min(len(num_scans) + more, sum(num_scans))
    cuts = cut_submaps(num_scans, count, overlap)
    assert [cut.name for cut in cuts] == [f"map_{k:02d}" for k in range(count)]
    for robot, scans in enumerate(num_scans):
        own = [cut for cut in cuts if cut.robot == robot]
        assert own[0].start == 0
        assert own[-1].stop == scans
        assert all(0 <= cut.start < cut.stop <= scans for cut in own)
        assert all(b.start <= a.stop and a.start <= b.start for a, b in itertools.pairwise(own))


@given(st.integers(2, 12), st.floats(0.0, 0.9))
def test_neighbours_share_the_overlap_and_parts_are_equally_long(count, overlap):
    cuts = cut_submaps([100_000], count, overlap)
    length = cuts[0].stop - cuts[0].start
    assert all(abs(cut.stop - cut.start - length) <= 1 for cut in cuts)
    assert all(abs((a.stop - b.start) / length - overlap) < 1e-3 for a, b in itertools.pairwise(cuts))


def test_a_robot_with_twice_the_scans_gets_twice_the_submaps():
    cuts = cut_submaps([2000, 1000], 9, 0.3)
    assert [cut.robot for cut in cuts] == [0] * 6 + [1] * 3


@pytest.mark.parametrize("count", [1, 11])
def test_fewer_submaps_than_robots_and_more_than_scans_are_refused(count):
    with pytest.raises(ValueError, match=r"submaps.count must be between the number of robots, 2, .* scans, 10, got"):
        cut_submaps([5, 5], count, 0.0)


@pytest.mark.parametrize(
    "values", [{"count": 0}, {"overlap": -0.1}, {"overlap": 0.95}, {"shift_m": -1.0}, {"turn_deg": 181.0}]
)
def test_impossible_settings_are_refused_by_name(values):
    with pytest.raises(ValueError, match=f"submaps.{next(iter(values))} must be"):
        SubmapsConfig(**values)


def test_frames_are_turned_and_shifted_within_their_bounds_and_differ():
    rng = np.random.default_rng(0)
    frames = se2.parameters_of(np.stack([draw_submap_frame(SubmapsConfig(shift_m=2.0), rng) for _ in range(200)]))
    assert np.abs(frames[:, :2]).max() <= 2.0
    assert np.abs(frames[:, 2]).max() > 3.0
    assert frames[:, 2].min() < -3.0
    assert np.allclose(draw_submap_frame(SubmapsConfig(shift_m=0.0, turn_deg=0.0), rng), np.eye(3))
