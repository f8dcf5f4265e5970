import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merger import se2
from merger.grid_map import LOG_ODDS_FREE, LOG_ODDS_OCCUPIED, GridMap, crop_to_known, log_odds_from_probability
from merger.whole_file import write_whole

_CELLS = np.zeros((4, 6), dtype=np.float32)


@settings(max_examples=40, deadline=None)
@given(st.tuples(*[st.floats(-50, 50)] * 3), st.floats(0.01, 2.0), st.integers(0, 1000))
def test_cells_and_points_are_inverse_to_each_other(origin, resolution_m, seed):
    grid = GridMap("a", _CELLS, resolution_m, se2.make_motion(*origin))
    cells = np.random.default_rng(seed).uniform(-10, 10, size=(7, 2))
    assert np.allclose(grid.cells_from_points_map(grid.points_map_from_cells(cells)), cells, atol=1e-6)


def test_centres_of_cells_lie_half_a_cell_from_their_corners():
    grid = GridMap("a", _CELLS, 0.5, se2.make_motion(10.0, 20.0, 0.0))
    mask = np.zeros((4, 6), dtype=bool)
    mask[1, 3] = True
    assert np.allclose(grid.cell_centers(mask), [[10.0 + 1.75, 20.0 + 0.75]])
    assert grid.size_m == (3.0, 2.0)


def test_occupied_free_and_unknown_cells_are_told_apart():
    grid = GridMap("a", np.array([[LOG_ODDS_OCCUPIED, 0.0, LOG_ODDS_FREE, 0.5, -1.2]], dtype=np.float32), 0.1)
    assert grid.occupied.tolist() == [[True, False, False, False, False]]
    assert grid.free.tolist() == [[False, False, True, False, False]]


def test_the_thresholds_of_a_file_keep_their_meaning():
    probability = np.array([[0.3, 0.5, 0.55, 1.0, 0.0]])
    log_odds = log_odds_from_probability(probability, probability > 0.52, probability < 0.35)
    grid = GridMap("a", log_odds, 0.1)
    assert grid.occupied.tolist() == [[False, False, True, True, False]]
    assert grid.free.tolist() == [[True, False, False, False, True]]


@pytest.mark.parametrize(
    ("cells", "resolution_m", "T", "fault"),
    [
        (np.zeros((0, 3), dtype=np.float32), 0.1, np.eye(3), r"non-empty 2D array, got shape \(0, 3\)"),
        (np.zeros(3, dtype=np.float32), 0.1, np.eye(3), r"non-empty 2D array, got shape \(3,\)"),
        (np.full((2, 2), np.nan, dtype=np.float32), 0.1, np.eye(3), "log-odds must be finite"),
        (_CELLS, 0.0, np.eye(3), r"resolution must be in \[0.001, 100\] m, got 0"),
        (_CELLS, np.inf, np.eye(3), r"resolution must be in \[0.001, 100\] m, got inf"),
        (_CELLS, 0.1, 2 * np.eye(3), "must be a .* rigid motion"),
        (_CELLS, 0.1, se2.make_motion(0.0, -1e9, 0.0), "its origin must lie within 1e"),
    ],
)
def test_what_is_no_grid_is_refused_with_the_name_and_the_fact(cells, resolution_m, T, fault):
    with pytest.raises(ValueError, match=f"map 'kitchen'.*{fault}"):
        GridMap("kitchen", cells, resolution_m, T)


def test_a_name_that_is_no_text_is_refused():
    with pytest.raises(ValueError, match=r"map 'k.*udcff': its name is not in UTF-8"):
        GridMap("k\udcff", _CELLS, 0.1)


def test_cutting_off_the_unknown_leaves_every_known_cell_at_its_place():
    cells = np.zeros((7, 9), dtype=np.float32)
    cells[2:5, 3:8] = [[2, 0, 0, 0, 0], [0, 0, -2, 0, 0], [0, 0, 0, 0, 2]]
    grid = GridMap("a", cells, 0.25, se2.make_motion(4.0, -1.0, 2.5))
    cropped = crop_to_known(grid)
    assert cropped.log_odds.shape == (3, 5)
    for mask in ("occupied", "free"):
        places = [item.cell_centers(getattr(item, mask)) for item in (grid, cropped)]
        assert np.allclose(*places, atol=1e-12)
    assert crop_to_known(cropped) is cropped
    nothing = GridMap("a", np.zeros((4, 4), dtype=np.float32), 0.1)
    assert crop_to_known(nothing) is nothing


@pytest.mark.parametrize(("second", "error"), [("not bytes", TypeError), (None, IsADirectoryError)])
def test_files_are_written_whole_and_all_or_none(tmp_path, second, error):
    write_whole({tmp_path / "a": b"old"})
    (tmp_path / "b").mkdir()
    with pytest.raises(error):
        write_whole({tmp_path / "a": b"new", tmp_path / ("c" if second else "b"): second or b"new"})
    assert (tmp_path / "a").read_bytes() == b"old"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a", "b"]
