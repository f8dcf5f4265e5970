"""Scores of the merged grid itself: do the maps agree where they meet, and does the whole look like the truth?

All maps are laid onto one raster (nearest cell), by the estimated and by the true motions, and votes are counted. What
the truth alone decides is worked out once for a dataset (`lay_true_grid`), since every method meets it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.scoring.map_raster import MAX_CELLS, Raster, Sheet, Votes, bounds_m, count_votes, make_sheet, raster_for
from bench.scoring.vote_kernel import count_agreements
from merger.grid_map import GridMap

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


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
    raster = raster_for(sheets, T_world_map)
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
    agree, disagree = count_agreements(occupied, free)
    total = agree + disagree
    return (agree / total if total else math.nan), total


def iou(mask: Mask, mask_true: Mask) -> float:
    """Intersection over union of the merged and the true map's cells, 0 to 1; 0 where both are empty.

    Cells unknown to both play no part; a map that was left out costs its cells.
    """
    union = np.count_nonzero(mask | mask_true)
    return np.count_nonzero(mask & mask_true) / union if union else 0.0


def _classify(occupied: Votes, free: Votes) -> tuple[Mask, Mask]:
    """Occupied cells (at least as many votes as for free) and free cells."""
    walls = (occupied > 0) & (occupied >= free)
    return walls, (free > 0) & ~walls


def _widen(true: TrueGrid, placed: Sequence[Sheet], T_world_map: Array) -> tuple[Raster, Mask, Mask]:
    """A raster that holds the true map and the placed maps, too, and the true map's walls and free cells on it.

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
        both = [*true.sheets, *placed]
        raster = raster_for(both, np.concatenate([true.T_world_map, T_world_map]))
        return raster, *_classify(*count_votes(true.sheets, true.T_world_map, raster))
    x_min_m, y_min_m = old.x_min_m - pads[1][0] * old.cell_m, old.y_min_m - pads[0][0] * old.cell_m
    return Raster(x_min_m, y_min_m, old.cell_m, rows, cols), np.pad(true.walls, pads), np.pad(true.free, pads)
