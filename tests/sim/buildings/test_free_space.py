"""Clearances: distances to the nearest surface, the same whatever OpenCV computes them with."""

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from sim.buildings.free_space import measure_free_space, sample_segments
from sim.buildings.plan import box
from sim.buildings.world import read_world


@pytest.fixture
def num_threads():
    """Sets OpenCV's number of threads until the test is over."""
    before = cv2.getNumThreads()
    yield cv2.setNumThreads
    cv2.setNumThreads(before)


@pytest.mark.parametrize("name", ["tim", "fr079"])
def test_clearances_are_the_same_to_the_last_bit_whatever_the_number_of_opencvs_threads(num_threads, name):
    """One thread computes them by other code than several."""
    segments = read_world(name).segments
    found = []
    for count in (1, 2, 4):
        num_threads(count)
        found.append(measure_free_space(segments).clearance_m.tobytes())
    assert found[0] == found[1] == found[2]


def test_clearances_are_distances_to_the_nearest_surface():
    corners = box(3.0, 2.0, (6.0, 4.0))
    segments = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    space = measure_free_space(segments)
    cells = np.stack(np.indices(space.clearance_m.shape), axis=-1)
    exact = cKDTree(sample_segments(segments, 0.001)).query(space.centers_of(cells))[0]
    assert np.abs(space.clearance_m - np.minimum(exact, 2.0)).max() < 0.02
