"""Scores of the merged grid itself: do the maps agree where they meet, and does the whole look like the truth?

All maps are laid onto one raster (nearest cell), by the estimated and by the true motions, and votes are counted.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

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
class GridScores:
    """Scores of the merged grid."""

    acceptance: float
    """Acceptance index, see `acceptance_index`; 0 to 1, NaN where nothing is compared."""
    acceptance_count: int
    """Comparisons behind it."""
    iou_occupied: float
    """See `iou`, of occupied cells."""
    iou_free: float
    """See `iou`, of free cells."""


def score_grids(maps: Sequence[GridMap], T_world_map: Array, T_world_map_estimated: Array) -> GridScores:
    """Acceptance index and IoU of a merge.

    Args:
        maps: N maps.
        T_world_map: (N, 3, 3) true poses.
        T_world_map_estimated: (N, 3, 3) estimated poses, brought into ``world`` by the fitted frame; NaN where a map
            is not placed.
    """
    known: npt.NDArray[np.bool_] = np.asarray(np.isfinite(T_world_map_estimated).all(axis=(1, 2)))
    if not known.any():
        return GridScores(math.nan, 0, 0.0, 0.0)
    placed = [grid for grid, is_known in zip(maps, known, strict=True) if is_known]
    raster = _raster_for([*maps, *placed], np.concatenate([T_world_map, T_world_map_estimated[known]]))
    occupied, free = count_votes(placed, T_world_map_estimated[known], raster)
    occupied_true, free_true = count_votes(maps, T_world_map, raster)
    acceptance, count = acceptance_index(occupied, free)
    walls, walls_true = (occupied > 0) & (occupied >= free), (occupied_true > 0) & (occupied_true >= free_true)
    return GridScores(
        acceptance=acceptance,
        acceptance_count=count,
        iou_occupied=iou(walls, walls_true),
        iou_free=iou((free > 0) & ~walls, (free_true > 0) & ~walls_true),
    )


def acceptance_index(occupied: Votes, free: Votes) -> tuple[float, int]:
    """Acceptance index of Birk and Carpin (2006), over all pairs of maps at once, and its count.

    ``agree / (agree + disagree)`` over every cell and every two maps that both know the cell: they agree if both
    call it occupied or both free. 0 to 1; NaN where no two maps meet. The count is ``agree + disagree``: an index from
    few comparisons says little.

    Args:
        occupied: (H, W) how many maps call a cell occupied.
        free: (H, W) how many call it free.
    """
    shared = occupied + free > 1
    o, f = occupied[shared].astype(np.int64), free[shared].astype(np.int64)
    agree = int((o * (o - 1) // 2 + f * (f - 1) // 2).sum())
    disagree = int((o * f).sum())
    total = agree + disagree
    return (agree / total if total else math.nan), total


def iou(mask: npt.NDArray[np.bool_], mask_true: npt.NDArray[np.bool_]) -> float:
    """Intersection over union of the merged and the true map's cells, 0 to 1; 0 where both are empty.

    The true map is the same submaps laid out by their true poses (real logs have no other). Cells unknown to both
    play no part; a map that was left out costs its cells.
    """
    union = int((mask | mask_true).sum())
    return int((mask & mask_true).sum()) / union if union else 0.0


def count_votes(maps: Sequence[GridMap], T_world_map: Array, raster: Raster) -> tuple[Votes, Votes]:
    """How many maps call each raster cell occupied, and how many free: two (rows, cols) arrays, row 0 at smallest y."""
    occupied = np.zeros((raster.rows, raster.cols), dtype=np.uint16)
    free = np.zeros_like(occupied)
    T_raster_world = se2.make_motion(-raster.x_min_m, -raster.y_min_m, 0.0)
    for grid, T in zip(maps, T_world_map, strict=True):
        T_raster_grid = T_raster_world @ T @ grid.T_map_grid
        occupied += _warp(grid.occupied, grid.resolution_m, T_raster_grid, raster)
        free += _warp(grid.free, grid.resolution_m, T_raster_grid, raster)
    return occupied, free


def _warp(
    mask: npt.NDArray[np.bool_], resolution_m: float, T_raster_grid: Array, raster: Raster
) -> npt.NDArray[np.uint8]:
    """Sample a mask at the centres of the raster's cells (nearest cell)."""
    A = np.empty((2, 3))
    A[:, :2] = T_raster_grid[:2, :2] * (resolution_m / raster.cell_m)
    A[:, 2] = T_raster_grid[:2, 2] / raster.cell_m + A[:, :2] @ [0.5, 0.5] - 0.5
    warped = cv2.warpAffine(
        mask.view(np.uint8), A, (raster.cols, raster.rows), flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT
    )
    return np.asarray(warped, dtype=np.uint8)


def _raster_for(maps: Sequence[GridMap], T_world_map: Array) -> Raster:
    """The raster that holds every map, at the finest resolution that `MAX_CELLS` allows."""
    corners = [se2.transform_points(T, _known_corners(grid)) for grid, T in zip(maps, T_world_map, strict=True)]
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    cell = min(grid.resolution_m for grid in maps)
    cell = max(cell, math.sqrt(float(np.prod(high - low)) / MAX_CELLS))
    cols, rows = (int(n) + 1 for n in np.ceil((high - low) / cell))
    return Raster(float(low[0]), float(low[1]), cell, rows, cols)


def _known_corners(grid: GridMap) -> Array:
    """(4, 2) corners of the box around a map's known cells, metres in frame ``map``."""
    known = grid.log_odds != 0.0
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        rows, cols = np.array([0, known.shape[0] - 1]), np.array([0, known.shape[1] - 1])
    low, high = (rows[0], cols[0]), (rows[-1] + 1, cols[-1] + 1)
    box = [[low[0], low[1]], [low[0], high[1]], [high[0], high[1]], [high[0], low[1]]]
    return grid.points_map_from_cells(np.array(box, dtype=np.float64))
