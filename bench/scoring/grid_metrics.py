"""Scores of the merged grid itself: do the maps agree where they meet, and does the whole look like the truth?

All maps are laid onto one raster (nearest cell), by the estimated and by the true motions, and votes are counted. What
the truth alone decides is worked out once for a dataset (`lay_true_grid`), since every method meets it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.scoring.map_raster import (
    MAX_CELLS,
    Raster,
    Sheet,
    bounds_m,
    count_votes,
    make_sheet,
    place_sheets,
    raster_for,
)
from bench.scoring.vote_kernel import FREE, OCCUPIED, Marks, compare_cells
from merger.grid_map import GridMap

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TrueGrid:
    """The same submaps laid out by their true poses (real logs have no other truth)."""

    sheets: tuple[Sheet, ...]
    """The N maps; their cells lie in `marks`, one after the other."""
    marks: Marks
    """(M,) the cells of all maps, as in `Sheet`."""
    T_world_map: Array
    """(N, 3, 3) true poses."""
    raster: Raster
    """A raster that holds them all."""
    cells: Marks
    """(rows, cols) the true map: 1 occupied, 2 free, 0 unknown."""


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
    made = [make_sheet(grid) for grid in maps]
    marks, sheets = join_sheets(made)
    raster = raster_for(sheets, T_world_map)
    return TrueGrid(sheets, marks, T_world_map, raster, _lay_out(sheets, T_world_map, raster))


def join_sheets(sheets: Sequence[Sheet]) -> tuple[Marks, tuple[Sheet, ...]]:
    """The cells of all maps in one array, and the maps with their cells there."""
    marks = np.concatenate([sheet.marks.ravel() for sheet in sheets])
    ends = np.cumsum([sheet.marks.size for sheet in sheets])
    parts = zip(sheets, np.split(marks, ends[:-1]), strict=True)
    return marks, tuple(replace(sheet, marks=part.reshape(sheet.marks.shape)) for sheet, part in parts)


def score_grids(true: TrueGrid, T_world_map_estimated: Array) -> GridScores:
    """Acceptance index and IoU of a merge.

    Args:
        true: The maps, and the map that they make by the truth.
        T_world_map_estimated: (N, 3, 3) estimated poses, brought into ``world`` by the fitted frame; NaN where a map
            is not placed.
    """
    known = np.asarray(np.isfinite(T_world_map_estimated).all(axis=(1, 2)))
    if not known.any():
        return GridScores(math.nan, 0, 0.0, 0.0)
    placed = [sheet for sheet, is_known in zip(true.sheets, known, strict=True) if is_known]
    raster, cells, shift = _widen(true, placed, T_world_map_estimated[known])
    T_sheet_raster, windows = place_sheets(placed, T_world_map_estimated[known], raster)
    sizes = np.array([sheet.marks.shape for sheet in true.sheets])
    starts = np.cumsum(sizes.prod(axis=1)) - sizes.prod(axis=1)
    places = np.column_stack([starts[known], sizes[known], windows])
    counts = compare_cells(true.marks, places, T_sheet_raster, cells, (raster.rows, raster.cols, *shift))
    agree, disagree, walls, all_walls, free, all_free = counts
    return GridScores(
        acceptance=acceptance_index(agree, disagree),
        acceptance_count=agree + disagree,
        iou_occupied=iou(walls, all_walls),
        iou_free=iou(free, all_free),
    )


def acceptance_index(agree: int, disagree: int) -> float:
    """Acceptance index of Birk and Carpin (2006), over all pairs of maps at once.

    ``agree / (agree + disagree)`` over every cell and every two maps that both know the cell: they agree if both
    call it occupied or both free. 0 to 1; NaN where no two maps meet. An index from few comparisons says little: their
    count, ``agree + disagree``, stands beside it.
    """
    return agree / (agree + disagree) if agree + disagree else math.nan


def iou(both: int, either: int) -> float:
    """Intersection over union of the merged and the true map's cells, 0 to 1; 0 where both are empty.

    A merged cell is occupied by at least as many votes as for free. Cells unknown to both maps play no part; a map
    that was left out costs its cells.

    Args:
        both: Cells that are so in the merged map and in the true one.
        either: Cells that are so in one of them.
    """
    return both / either if either else 0.0


def _lay_out(sheets: Sequence[Sheet], T_world_map: Array, raster: Raster) -> Marks:
    """The cells of the map that maps make at their places: occupied by at least as many votes as for free."""
    occupied, free = count_votes(sheets, T_world_map, raster)
    walls = (occupied > 0) & (occupied >= free)
    return np.where(walls, np.uint8(OCCUPIED), (free > 0) * np.uint8(FREE))


def _widen(true: TrueGrid, placed: Sequence[Sheet], T_world_map: Array) -> tuple[Raster, Marks, tuple[int, int]]:
    """A raster that holds the true map and the placed maps, too; the true map, and the row and column where it begins.

    It grows by whole cells, so that the true map need not be laid out again, unless it would grow too large.
    """
    old = true.raster
    low, high = bounds_m(placed, T_world_map)
    steps = [
        (low[1] - old.y_min_m, high[1] - old.y_min_m, old.rows),
        (low[0] - old.x_min_m, high[0] - old.x_min_m, old.cols),
    ]
    pads = [(max(math.ceil(-a / old.cell_m), 0), max(math.ceil(b / old.cell_m) - n, 0)) for a, b, n in steps]
    rows, cols = (n + sum(pad) for n, pad in zip((old.rows, old.cols), pads, strict=True))
    if rows * cols > MAX_CELLS + max(rows, cols):
        raster = raster_for([*true.sheets, *placed], np.concatenate([true.T_world_map, T_world_map]))
        return raster, _lay_out(true.sheets, true.T_world_map, raster), (0, 0)
    (above, _), (left, _) = pads
    corner = old.x_min_m - left * old.cell_m, old.y_min_m - above * old.cell_m
    return Raster(*corner, old.cell_m, rows, cols), true.cells, (above, left)
