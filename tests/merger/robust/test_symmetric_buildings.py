"""Buildings that look alike after a turn or a shift: what two maps cannot tell is left apart."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from merger import se2
from merger.grid_map import GridMap
from merger.pipeline import MergeConfig, Method, merge_maps
from merger.robust.pair_probability import exclude_one_another, probability


def _draw_room(name, size_m, T_room_map, landmark=False):
    """A room whose walls are 0.1 m thick, as seen in a frame of its own; the landmark is a box and a stub of wall."""
    width, depth = size_m
    cells = np.indices((round(2.4 * max(size_m) / 0.05),) * 2).reshape(2, -1).T
    empty = GridMap(
        name, np.zeros((cells.max() + 1,) * 2, np.float32), 0.05, se2.make_motion(*[-1.2 * max(size_m)] * 2, 0)
    )
    x, y = se2.transform_points(T_room_map, empty.points_map_from_cells(cells + 0.5)).T
    solid = (np.abs(x) > width / 2) | (np.abs(y) > depth / 2)
    if landmark:
        solid |= (np.abs(x - 1.2) < 0.4) & (np.abs(y - 0.3) < 0.6) | (np.abs(x + 0.7) < 0.06) & (y > depth / 2 - 1.1)
    known = (np.abs(x) < width / 2 + 0.1) & (np.abs(y) < depth / 2 + 0.1)
    log_odds = np.where(known, np.where(solid, 2.0, -2.0), 0.0).astype(np.float32)
    return GridMap(name, log_odds.reshape(empty.log_odds.shape), 0.05, empty.T_map_grid)


@pytest.mark.parametrize("size_m", [(6.0, 6.0), (9.0, 5.0)])
def test_a_bare_room_is_left_apart_and_one_with_a_landmark_is_placed(size_m):
    T_a_b = se2.make_motion(0.4, -0.3, 0.6)
    bare, marked = (
        merge_maps(
            [_draw_room("a", size_m, np.eye(3), landmark), _draw_room("b", size_m, T_a_b, landmark)],
            MergeConfig(method=Method.ROBUST),
        )
        for landmark in (False, True)
    )
    assert bare.num_placed == 0
    assert "another motion fits about as well" in bare.placement("b").reason
    assert marked.num_placed == 2
    assert np.allclose(marked.placement("b").T_ref_map, T_a_b, atol=0.05)


@given(st.lists(st.floats(-30.0, 30.0), min_size=1, max_size=5))
def test_motions_that_exclude_one_another_share_one_probability(log_odds):
    together = exclude_one_another(log_odds)
    assert sum(map(probability, together)) <= 1.0 + 1e-9
    assert all(one <= alone for one, alone in zip(together, log_odds, strict=True))
    assert exclude_one_another(log_odds[:1]) == log_odds[:1]


def test_motions_that_are_equally_sure_share_it_evenly_and_a_hopeless_rival_takes_nothing():
    assert [probability(value) for value in exclude_one_another([20.0] * 4)] == pytest.approx([0.25] * 4)
    assert exclude_one_another([5.0, -20.0])[0] == pytest.approx(5.0, abs=1e-8)
    assert exclude_one_another([5.0, 2.0])[0] == pytest.approx(5.0 - math.log(1.0 + math.exp(2.0)))
