"""A drawn map as a world: its outline lies where its cells end."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from merger import se2
from merger.grid_map import GridMap
from merger.map_server import write_map
from sim.buildings.free_space import sample_segments
from sim.buildings.world import read_world

RESOLUTION_M = 0.05
CORNER = se2.make_motion(-3.0, 2.0, 0.4)


@pytest.fixture
def drawn(tmp_path: Path) -> GridMap:
    """Two rooms joined by a door, a pillar, and a slanted corner; written as a map."""
    log_odds = np.zeros((140, 200), dtype=np.float32)
    log_odds[10:130, 10:190] = 2.0
    log_odds[12:128, 12:188] = -2.0
    log_odds[12:128, 98:102] = 2.0
    log_odds[60:80, 98:102] = -2.0
    log_odds[30:40, 40:50] = 2.0
    rows, cols = np.indices(log_odds.shape)
    log_odds[(rows + 2 * cols < 70) & (log_odds < 0)] = 2.0
    grid = GridMap("drawn", log_odds, RESOLUTION_M, CORNER)
    write_map(tmp_path / "drawn.yaml", grid)
    return grid


def test_the_outline_matches_the_map_within_a_cell(drawn: GridMap, tmp_path: Path) -> None:
    world = read_world(str(tmp_path / "drawn.yaml"))
    padded = np.pad(drawn.free, 1)
    near = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
    border = drawn.cell_centers(drawn.occupied & near)
    traced = sample_segments(world.segments, 0.01)
    assert cKDTree(traced).query(border)[0].max() < RESOLUTION_M
    assert cKDTree(border).query(traced)[0].max() < 1.5 * RESOLUTION_M


def test_starts_stand_free_in_the_frame_of_the_map(drawn: GridMap, tmp_path: Path) -> None:
    world = read_world(str(tmp_path / "drawn.yaml"))
    cells = np.floor(drawn.cells_from_points_map(world.starts[:, :2])).astype(int)
    assert drawn.free[cells[:, 0], cells[:, 1]].all()
    assert len(world.starts) >= 4


def test_straight_walls_become_few_segments(drawn: GridMap, tmp_path: Path) -> None:
    assert len(read_world(str(tmp_path / "drawn.yaml")).segments) < 60


def test_a_map_without_free_space_is_refused(tmp_path: Path) -> None:
    write_map(tmp_path / "full.yaml", GridMap("full", np.full((9, 9), 2.0, dtype=np.float32), 0.05))
    with pytest.raises(ValueError, match=r"full.yaml: the map has no free area"):
        read_world(str(tmp_path / "full.yaml"))
