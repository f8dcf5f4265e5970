"""Scores of the merged grid itself: do the maps agree where they meet, and does the whole look like the truth?

All maps are laid onto one raster (nearest cell), by the estimated and by the true motions, and votes are counted. What
the truth alone decides is worked out once for a dataset (`lay_true_grid`), since every method meets it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.vote_kernel import FREE, OCCUPIED, add_votes
from merger import se2
from merger.grid_map import GridMap

Array = npt.NDArray[np.float64]
Votes = npt.NDArray[np.uint16]
Mask = npt.NDArray[np.bool_]

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

    def corners_world(self, T_world_map: Array) -> Array:
        """(4, 2) its corners, metres in frame ``world``."""
        height, width = (n * self.resolution_m for n in self.marks.shape)
        box = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
        return se2.transform_points(T_world_map @ self.T_map_sheet, box)


@dataclass(frozen=True)
class TrueGrid:
    """The same submaps laid out by their true poses (real logs have no other truth)."""

    sheets: tuple[Sheet, ...]
    """The N maps."""
    T_world_map: Array
    """(N, 3, 3) true poses."""
    raster: Raster
    """A raster that holds them all."""
    walls: Mask
    """(rows, cols) occupied cells of the true map."""
    free: Mask
    """(rows, cols) free cells of the true map."""


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


def lay_true_grid(maps: Sequence[GridMap], T_world_map: Array) -> TrueGrid:
    """Lay N maps out by their (N, 3, 3) true poses."""
    sheets = tuple(make_sheet(grid) for grid in maps)
    raster = _raster_for(sheets, T_world_map)
    return TrueGrid(sheets, T_world_map, raster, *_classify(*count_votes(sheets, T_world_map, raster)))


def score_grids(true: TrueGrid, T_world_map_estimated: Array) -> GridScores:
    """Acceptance index and IoU of a merge.

    Args:
        true: The maps, and the map that they make by the truth.
        T_world_map_estimated: (N, 3, 3) estimated poses, brought into ``world`` by the fitted frame; NaN where a map
            is not placed.
    """
    known: Mask = np.asarray(np.isfinite(T_world_map_estimated).all(axis=(1, 2)))
    if not known.any():
        return GridScores(math.nan, 0, 0.0, 0.0)
    placed = [sheet for sheet, is_known in zip(true.sheets, known, strict=True) if is_known]
    raster, walls_true, free_true = _widen(true, placed, T_world_map_estimated[known])
    occupied, free = count_votes(placed, T_world_map_estimated[known], raster)
    acceptance, count = acceptance_index(occupied, free)
    walls, open_space = _classify(occupied, free)
    return GridScores(
        acceptance=acceptance,
        acceptance_count=count,
        iou_occupied=iou(walls, walls_true),
        iou_free=iou(open_space, free_true),
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
    o, f = (votes.reshape(-1).astype(np.float64) for votes in (occupied, free))
    agree = int(o @ o - o.sum() + f @ f - f.sum()) // 2  # n * (n - 1) / 2 pairs of n votes
    disagree = int(o @ f)
    total = agree + disagree
    return (agree / total if total else math.nan), total


def iou(mask: Mask, mask_true: Mask) -> float:
    """Intersection over union of the merged and the true map's cells, 0 to 1; 0 where both are empty.

    Cells unknown to both play no part; a map that was left out costs its cells.
    """
    union = np.count_nonzero(mask | mask_true)
    return np.count_nonzero(mask & mask_true) / union if union else 0.0


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
    T_raster_world = se2.make_motion(-raster.x_min_m, -raster.y_min_m, 0.0)
    for sheet, T in zip(sheets, T_world_map, strict=True):
        T_sheet_raster = se2.invert(T_raster_world @ T @ sheet.T_map_sheet) / sheet.resolution_m
        T_sheet_raster[:2, :2] *= raster.cell_m
        add_votes(sheet.marks, T_sheet_raster, _window(sheet.corners_world(T), raster), occupied, free)
    return occupied, free


def _classify(occupied: Votes, free: Votes) -> tuple[Mask, Mask]:
    """Occupied cells (at least as many votes as for free) and free cells."""
    walls = (occupied > 0) & (occupied >= free)
    return walls, (free > 0) & ~walls


def _window(corners_world: Array, raster: Raster) -> tuple[int, int, int, int]:
    """First and last row, first and last column of a raster that points may touch."""
    cells = (corners_world - [raster.x_min_m, raster.y_min_m]) / raster.cell_m
    left, below = np.maximum(np.floor(cells.min(axis=0)), 0.0)
    right, above = np.minimum(np.ceil(cells.max(axis=0)), [raster.cols, raster.rows])
    return int(below), int(above), int(left), int(right)


def _raster_for(sheets: Sequence[Sheet], T_world_map: Array) -> Raster:
    """The raster that holds every map, at the finest resolution that `MAX_CELLS` allows."""
    low, high = _bounds(sheets, T_world_map)
    cell = min(sheet.resolution_m for sheet in sheets)
    cell = max(cell, math.sqrt(float(np.prod(high - low)) / MAX_CELLS))
    cols, rows = (int(n) + 1 for n in np.ceil((high - low) / cell))
    return Raster(float(low[0]), float(low[1]), cell, rows, cols)


def _widen(true: TrueGrid, placed: Sequence[Sheet], T_world_map: Array) -> tuple[Raster, Mask, Mask]:
    """A raster that holds the true map and the placed maps, too, and the true map's walls and free cells on it.

    It grows by whole cells, so that the true map need not be laid out again, unless it would grow too large.
    """
    old = true.raster
    low, high = _bounds(placed, T_world_map)
    steps = [
        (low[1] - old.y_min_m, high[1] - old.y_min_m, old.rows),
        (low[0] - old.x_min_m, high[0] - old.x_min_m, old.cols),
    ]
    pads = [(max(math.ceil(-a / old.cell_m), 0), max(math.ceil(b / old.cell_m) - n, 0)) for a, b, n in steps]
    rows, cols = (n + sum(pad) for n, pad in zip((old.rows, old.cols), pads, strict=True))
    if rows * cols > MAX_CELLS + max(rows, cols):
        both = [*true.sheets, *placed]
        raster = _raster_for(both, np.concatenate([true.T_world_map, T_world_map]))
        return raster, *_classify(*count_votes(true.sheets, true.T_world_map, raster))
    x_min_m, y_min_m = old.x_min_m - pads[1][0] * old.cell_m, old.y_min_m - pads[0][0] * old.cell_m
    return Raster(x_min_m, y_min_m, old.cell_m, rows, cols), np.pad(true.walls, pads), np.pad(true.free, pads)


def _bounds(sheets: Sequence[Sheet], T_world_map: Array) -> tuple[Array, Array]:
    """The least and the greatest x and y of maps at their places, metres."""
    points = np.concatenate([sheet.corners_world(T) for sheet, T in zip(sheets, T_world_map, strict=True)])
    return points.min(axis=0), points.max(axis=0)
