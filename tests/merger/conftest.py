"""A small building drawn in numpy, and maps cut from it anywhere, at any angle."""

from collections.abc import Callable

import numpy as np
import pytest

from merger import se2
from merger.grid_map import GridMap
from merger.robust.wall_structure import WallStructure, WallStructureConfig, extract_structure

CutMap = Callable[..., GridMap]
_CELL_M = 0.05
_SIZE_M = (24.0, 16.0)


def draw_building(seed: int) -> np.ndarray:
    """(H, W) log-odds of a building of 24 x 16 m: rooms with doors, and boxes that tell the rooms apart."""
    rng = np.random.default_rng(seed)
    rows, cols = round(_SIZE_M[1] / _CELL_M), round(_SIZE_M[0] / _CELL_M)
    world = np.full((rows, cols), -2.0, dtype=np.float32)

    def fill(x0: float, y0: float, x1: float, y1: float, value: float) -> None:
        row0, row1, col0, col1 = (round(v / _CELL_M) for v in (y0, y1, x0, x1))
        world[max(row0, 0) : row1, max(col0, 0) : col1] = value

    for x in (6.0, 12.5, 18.0):
        fill(x, 0.0, x + 0.1, 16.0, 2.0)
        for y in (rng.uniform(1.0, 6.0), rng.uniform(9.0, 14.0)):
            fill(x, y, x + 0.1, y + 1.0, -2.0)
    fill(0.0, 7.5, 24.0, 7.6, 2.0)
    for x in (2.0, 9.0, 15.0, 20.0):
        door = x + rng.uniform(0.0, 1.5)
        fill(door, 7.5, door + 1.0, 7.6, -2.0)
    for _ in range(60):
        x, y = rng.uniform(0.5, 23.0), rng.uniform(0.5, 15.0)
        fill(x, y, x + rng.uniform(0.2, 1.2), y + rng.uniform(0.2, 1.2), 2.0)
    for x0, y0, x1, y1 in ((0, 0, 24, 0.1), (0, 15.9, 24, 16), (0, 0, 0.1, 16), (23.9, 0, 24, 16)):
        fill(x0, y0, x1, y1, 2.0)
    return world


@pytest.fixture(scope="session")
def cut_map() -> CutMap:
    """``cut_map(name, (x0, x1), T_world_map, seed=0, resolution_m=0.1, yaw_rad=0.0)``: a part of the building.

    The map knows the building between x0 and x1 (metres, frame world), as seen from its own frame; its origin has
    the yaw given.
    """

    def cut(name, span_m, T_world_map, *, seed=0, resolution_m=0.1, yaw_rad=0.0, margin_m=0.3):
        world = draw_building(seed)
        box = np.array([[x, y] for x in span_m for y in (0.0, _SIZE_M[1])])
        T_grid_map = se2.make_motion(0.0, 0.0, -yaw_rad)
        corners = se2.transform_points(T_grid_map @ se2.invert(T_world_map), box)
        low = np.floor((corners.min(axis=0) - margin_m) / resolution_m) * resolution_m
        cols, rows = np.ceil((corners.max(axis=0) + margin_m - low) / resolution_m).astype(int)
        T_map_grid = se2.invert(T_grid_map) @ se2.make_motion(low[0], low[1], 0.0)
        empty = GridMap(name, np.zeros((rows, cols), dtype=np.float32), resolution_m, T_map_grid)
        points = se2.transform_points(T_world_map, empty.cell_centers(np.ones((rows, cols), dtype=bool)))
        col, row = np.floor(points / _CELL_M).astype(int).T
        inside = (points[:, 0] >= span_m[0]) & (points[:, 0] < span_m[1]) & (row >= 0) & (row < len(world))
        inside &= (col >= 0) & (col < world.shape[1])
        cells = np.zeros(rows * cols, dtype=np.float32)
        cells[inside] = world[row[inside], col[inside]]
        return GridMap(name, cells.reshape(rows, cols), resolution_m, T_map_grid)

    return cut


@pytest.fixture(scope="session")
def three_maps(cut_map: CutMap) -> tuple[list[GridMap], dict[str, np.ndarray]]:
    """Three overlapping maps of one building, turned and shifted, and their true motions ``T_world_map``."""
    truth = {
        "west": se2.make_motion(3.0, -2.0, 0.7),
        "middle": se2.make_motion(11.0, 5.0, -2.5),
        "east": se2.make_motion(-4.0, 8.0, 3.1),
    }
    spans = {"west": (0.0, 13.0), "middle": (6.0, 19.0), "east": (12.0, 24.0)}
    return [cut_map(name, spans[name], T) for name, T in truth.items()], truth


_T_WORLD_PAIR = (se2.make_motion(1.0, -2.0, 0.5), se2.make_motion(8.0, 3.0, 2.4))


@pytest.fixture(scope="session")
def pair(cut_map: CutMap) -> tuple[WallStructure, ...]:
    """The walls of two overlapping maps of different resolutions."""
    maps = (
        cut_map("a", (0.0, 14.0), _T_WORLD_PAIR[0], resolution_m=0.05),
        cut_map("b", (7.0, 22.0), _T_WORLD_PAIR[1], resolution_m=0.1),
    )
    return tuple(extract_structure(grid, WallStructureConfig()) for grid in maps)


@pytest.fixture(scope="session")
def T_A_B() -> np.ndarray:
    """The true motion of the pair."""
    return se2.invert(_T_WORLD_PAIR[0]) @ _T_WORLD_PAIR[1]


@pytest.fixture(scope="session")
def nudge() -> Callable[..., np.ndarray]:
    """``nudge(T, center, v)``: a motion, shifted and turned by v about a (2,) centre of its source."""

    def shift(T, center, v):
        there = se2.make_motion(center[0], center[1], 0.0)
        return T @ there @ se2.make_motion(*v) @ se2.invert(there)

    return shift
