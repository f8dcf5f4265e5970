"""Maps laid onto one raster by their poses (nearest cell), where votes are counted: occupied or free."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.scoring.vote_kernel import FREE, OCCUPIED, add_votes
from merger import se2
from merger.grid_map import GridMap

Array = npt.NDArray[np.float64]
Votes = npt.NDArray[np.uint16]

MAX_CELLS = 4_000_000
"""Largest raster; wilder placements are scored on coarser cells."""


@dataclass(frozen=True)
class Raster:
    """A common raster in frame ``world``."""

    x_min_m: float
    """Left edge."""
    y_min_m: float
    """Lower edge."""
    cell_m: float
    """Side of a cell."""
    rows: int
    """Cells along y."""
    cols: int
    """Cells along x."""


@dataclass(frozen=True)
class Sheet:
    """The known part of one map, ready to be laid onto a raster."""

    marks: npt.NDArray[np.uint8]
    """(H, W) 1 occupied, 2 free, 0 unknown."""
    resolution_m: float
    """Side of a cell."""
    T_map_sheet: Array
    """(3, 3) place of its lower-left corner in frame ``map``."""


def make_sheet(grid: GridMap) -> Sheet:
    """The part of a map that is known; the whole of it where nothing is."""
    marks = grid.occupied * np.uint8(OCCUPIED) + grid.free * np.uint8(FREE)
    rows, cols = np.flatnonzero(marks.any(axis=1)), np.flatnonzero(marks.any(axis=0))
    if not len(rows):
        return Sheet(marks, grid.resolution_m, grid.T_map_grid)
    shift = se2.make_motion(cols[0] * grid.resolution_m, rows[0] * grid.resolution_m, 0.0)
    known = np.ascontiguousarray(marks[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1])
    return Sheet(known, grid.resolution_m, grid.T_map_grid @ shift)


def count_votes(sheets: Sequence[Sheet], T_world_map: Array, raster: Raster) -> tuple[Votes, Votes]:
    """How many maps call each raster cell occupied, and how many free: two (rows, cols) arrays, row 0 at smallest y."""
    occupied = np.zeros((raster.rows, raster.cols), dtype=np.uint16)
    free = np.zeros_like(occupied)
    T_sheet_raster, windows = place_sheets(sheets, T_world_map, raster)
    for sheet, T, window in zip(sheets, T_sheet_raster, windows.tolist(), strict=True):
        add_votes(sheet.marks, T, tuple(window), occupied, free)
    return occupied, free


def place_sheets(sheets: Sequence[Sheet], T_world_map: Array, raster: Raster) -> tuple[Array, npt.NDArray[np.int64]]:
    """Where N maps lie on a raster.

    Returns:
        (N, 3, 3) continuous cell coordinates (x, y) of the raster to those of each map, scale included; (N, 4) first
        and last row, first and last column of the raster that each may touch, the last ones not included.
    """
    T_raster_world = se2.make_motion(-raster.x_min_m, -raster.y_min_m, 0.0)
    places = np.array([sheet.T_map_sheet for sheet in sheets])
    T_sheet_raster = se2.invert(T_raster_world @ T_world_map @ places)
    T_sheet_raster /= np.array([sheet.resolution_m for sheet in sheets])[:, None, None]
    T_sheet_raster[:, :2, :2] *= raster.cell_m
    cells = (_corners_world(sheets, T_world_map) - [raster.x_min_m, raster.y_min_m]) / raster.cell_m
    left, below = np.maximum(np.floor(cells.min(axis=1)), 0.0).T
    right, above = np.minimum(np.ceil(cells.max(axis=1)), [raster.cols, raster.rows]).T
    return T_sheet_raster, np.stack([below, above, left, right], axis=1).astype(np.int64)


def raster_for(sheets: Sequence[Sheet], T_world_map: Array) -> Raster:
    """The raster that holds every map, at the finest resolution that `MAX_CELLS` allows."""
    low, high = bounds_m(sheets, T_world_map)
    cell = min(sheet.resolution_m for sheet in sheets)
    cell = max(cell, math.sqrt(float(np.prod(high - low)) / MAX_CELLS))
    cols, rows = (int(n) + 1 for n in np.ceil((high - low) / cell))
    return Raster(float(low[0]), float(low[1]), cell, rows, cols)


def bounds_m(sheets: Sequence[Sheet], T_world_map: Array) -> tuple[Array, Array]:
    """The least and the greatest x and y of maps at their places, metres."""
    points = _corners_world(sheets, T_world_map).reshape(-1, 2)
    return points.min(axis=0), points.max(axis=0)


def _corners_world(sheets: Sequence[Sheet], T_world_map: Array) -> Array:
    """(N, 4, 2) the corners of N maps, metres in frame ``world``."""
    sizes = np.array(
        [(sheet.marks.shape[1] * sheet.resolution_m, sheet.marks.shape[0] * sheet.resolution_m) for sheet in sheets]
    )
    boxes = sizes[:, None] * [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    return se2.transform_points(T_world_map @ np.array([sheet.T_map_sheet for sheet in sheets]), boxes)
