"""A call finds in the cache what it would have read from the maps' own files."""

import numpy as np
import pytest

from bench.mergers.map_cache import read_cached_maps, write_map_cache
from merger import se2
from merger.grid_map import GridMap
from merger.map_server import read_map, write_map


@pytest.fixture
def paths(tmp_path):
    rng = np.random.default_rng(0)
    for name, shape in (("a", (7, 5)), ("b", (3, 11)), ("c", (16, 1))):
        cells = rng.choice([-2.0, 0.0, 2.0], shape).astype(np.float32)
        write_map(tmp_path / f"{name}.yaml", GridMap(name, cells, 0.05, se2.make_motion(*rng.normal(size=3))))
    return sorted(tmp_path.glob("*.yaml"))


def test_cached_maps_are_those_of_the_files_to_the_last_bit_in_any_order(paths, tmp_path):
    (tmp_path / "cache").mkdir()
    write_map_cache([read_map(path) for path in paths], tmp_path / "cache")
    for grid, path in zip(read_cached_maps(paths[::-1], tmp_path / "cache"), paths[::-1], strict=True):
        read = read_map(path)
        assert (grid.name, grid.resolution_m) == (read.name, read.resolution_m)
        np.testing.assert_array_equal(grid.T_map_grid, read.T_map_grid)
        np.testing.assert_array_equal(grid.log_odds, read.log_odds)
        assert (grid.log_odds.dtype, type(grid.log_odds)) == (read.log_odds.dtype, np.ndarray)


def test_what_a_method_writes_into_a_cached_map_reaches_no_other_call(paths, tmp_path):
    (tmp_path / "cache").mkdir()
    write_map_cache([read_map(path) for path in paths], tmp_path / "cache")
    before = read_map(paths[0]).log_odds
    read_cached_maps(paths, tmp_path / "cache")[0].log_odds[:] = 9.0
    np.testing.assert_array_equal(read_cached_maps(paths, tmp_path / "cache")[0].log_odds, before)


def test_without_a_cache_the_files_are_read(paths, tmp_path):
    assert [grid.name for grid in read_cached_maps(paths, tmp_path / "nothing")] == ["a", "b", "c"]
