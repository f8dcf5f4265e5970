import numpy as np
import pytest
from scipy.spatial import cKDTree

from merger import se2
from merger.compositing import CompositingConfig, composite_maps
from merger.grid_map import GridMap

_CONFIG = CompositingConfig()


def _random_map(name, seed, shape=(20, 30), T_map_grid=None):
    log_odds = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    return GridMap(name, log_odds, 0.05, np.eye(3) if T_map_grid is None else T_map_grid)


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-3.35, 12.2, 0.0), (5.0, 1.0, 2.0)])
def test_maps_that_lie_on_each_other_give_the_sum_of_their_log_odds(origin):
    T = se2.make_motion(*origin)
    maps = [_random_map(name, seed, T_map_grid=T) for seed, name in enumerate("abc")]
    merged = composite_maps(maps, np.tile(np.eye(3), (3, 1, 1)), T, 0.05, _CONFIG)
    assert np.allclose(merged.log_odds, sum(grid.log_odds for grid in maps), atol=1e-5)
    assert np.allclose(merged.T_map_grid, T)


def test_a_shift_by_whole_cells_shifts_the_cells():
    a, b = _random_map("a", 0), _random_map("b", 1)
    motions = np.stack([np.eye(3), se2.make_motion(0.5, -0.25, 0.0)])
    merged = composite_maps([a, b], motions, np.eye(3), 0.05, _CONFIG)
    assert merged.log_odds.shape == (25, 40)
    expected = np.zeros((25, 40), dtype=np.float32)
    expected[5:, :30] += a.log_odds
    expected[:20, 10:] += b.log_odds
    assert np.allclose(merged.log_odds, expected, atol=1e-5)
    assert np.allclose(merged.T_map_grid, se2.make_motion(0.0, -0.25, 0.0))


def test_a_quarter_turn_turns_the_cells():
    grid = _random_map("a", 2, shape=(6, 9))
    merged = composite_maps([grid], se2.make_motion(0.0, 0.0, np.pi / 2)[None], np.eye(3), 0.05, _CONFIG)
    assert np.allclose(merged.log_odds, np.rot90(grid.log_odds, -1), atol=1e-5)


def test_walls_stay_where_they_are_under_any_motion(cut_map):
    T = se2.make_motion(3.0, 2.0, 0.9)
    grid = cut_map("a", (0.0, 12.0), T)
    merged = composite_maps([grid], T[None], np.eye(3), 0.1, _CONFIG)
    walls = merged.cell_centers(merged.occupied)
    expected = se2.transform_points(T, grid.cell_centers(grid.occupied))
    assert cKDTree(expected).query(walls)[0].max() < 0.1
    assert cKDTree(walls).query(expected)[0].max() < 0.1


def test_thin_walls_do_not_vanish_in_coarser_cells():
    cells = np.full((40, 40), -2.0, dtype=np.float32)
    cells[:, 17] = 2.0
    merged = composite_maps([GridMap("a", cells, 0.05)], np.eye(3)[None], np.eye(3), 0.2, _CONFIG)
    assert merged.log_odds.shape == (10, 10)
    assert merged.occupied[:, 4].all()
    assert merged.occupied.sum() == 10


def test_finer_cells_repeat_the_map():
    grid = _random_map("a", 3)
    merged = composite_maps([grid], np.eye(3)[None], np.eye(3), 0.025, _CONFIG)
    assert np.allclose(merged.log_odds, np.kron(grid.log_odds, np.ones((2, 2))))


def test_unknown_cells_say_nothing_and_make_no_room():
    cells = np.zeros((50, 60), dtype=np.float32)
    cells[10:20, 30:45] = -2.0
    merged = composite_maps([GridMap("a", cells, 0.05)], np.eye(3)[None], np.eye(3), 0.05, _CONFIG)
    assert merged.log_odds.shape == (10, 15)
    assert (merged.log_odds == -2.0).all()


def test_a_grid_beyond_the_limit_is_refused_with_its_size():
    with pytest.raises(ValueError, match=r"the merged map at 0\.0001 m would need 1\.5e\+08 cells"):
        composite_maps([_random_map("a", 4)], np.eye(3)[None], np.eye(3), 0.0001, _CONFIG)


def test_the_maps_given_are_not_changed():
    grid = _random_map("a", 5)
    before = grid.log_odds.copy()
    composite_maps([grid, grid], np.tile(np.eye(3), (2, 1, 1)), np.eye(3), 0.05, _CONFIG)
    assert (grid.log_odds == before).all()
