"""A uniform grid of wall segments, each written into every cell that it touches, for rays that walk through cells."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

MARGIN_M = 1e-6
"""A segment belongs to every cell that it comes this near, so that rounding at a cell's border loses no hit."""
_CELLS_PER_SEGMENT = 0.8
"""Cells of the grid per segment: few enough to walk over quickly, enough that a cell holds few segments."""


class SegmentGrid(NamedTuple):
    """Wall segments, sorted into square cells."""

    segments: npt.NDArray[np.float64]
    """(N, 6) x and y of a segment's first and second end, and of its unit normal, metres."""
    cell_begin: npt.NDArray[np.int64]
    """(rows * columns + 1,) first of a cell's entries, row by row; the next one is the cell's end."""
    entries: npt.NDArray[np.float64]
    """(M, 6) the segments of each cell, cell by cell."""
    members: npt.NDArray[np.int32]
    """(M,) their indices."""
    shape: tuple[int, int]
    """Rows and columns."""
    corner_m: tuple[float, float]
    """Lower left corner of cell (0, 0)."""
    cells_per_m: float
    """Inverse of a cell's side."""


def build_segment_grid(segments_m: npt.NDArray[np.float64], cell_m: float | None = None) -> SegmentGrid:
    """Sort wall segments into a uniform grid.

    Args:
        segments_m: (N, 2, 2) ends of the segments, metres; N may be 0.
        cell_m: Side of a cell; by default chosen from the number of segments and their extent.

    Raises:
        ValueError: a coordinate is not finite, or the cell is not > 0.
    """
    ends = np.asarray(segments_m, dtype=np.float64).reshape(-1, 2, 2)
    if not np.isfinite(ends).all():
        raise ValueError("wall segments must be finite")
    low, high = (ends.min(axis=(0, 1)), ends.max(axis=(0, 1))) if len(ends) else (np.zeros(2), np.zeros(2))
    low, size = low - 2 * MARGIN_M, high - low + 4 * MARGIN_M
    cell = _default_cell_m(size, len(ends)) if cell_m is None else cell_m
    if not cell > 0.0:
        raise ValueError(f"cell_m must be > 0, got {cell:g}")
    columns, rows = (int(n) for n in np.floor(size / cell) + 1)
    walls = np.concatenate([ends.reshape(-1, 4), _normals(ends)], axis=1)
    corner = (float(low[0]), float(low[1]))
    counts = np.zeros((rows, columns), dtype=np.int64)
    _sort_segments(walls, corner, cell, counts, np.zeros(0, dtype=np.int32))
    begin = np.concatenate([[0], np.cumsum(counts)])
    members = np.zeros(int(begin[-1]), dtype=np.int32)
    _sort_segments(walls, corner, cell, begin[:-1].reshape(counts.shape).copy(), members)
    return SegmentGrid(walls, begin, walls[members], members, (rows, columns), corner, float(1.0 / cell))


def _default_cell_m(size_m: npt.NDArray[np.float64], num_segments: int) -> float:
    """A cell that makes about _CELLS_PER_SEGMENT cells a segment."""
    wanted = max(_CELLS_PER_SEGMENT * num_segments, 1.0)
    return float(max(math.sqrt(size_m[0] * size_m[1] / wanted), size_m.max() / wanted, 1e-3))


def _normals(ends: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(N, 2) unit normals, rounded as Chipmunk rounds them; zero for a segment without length."""
    along = ends[:, 1] - ends[:, 0]
    length = np.sqrt(along[:, 0] * along[:, 0] + along[:, 1] * along[:, 1])
    unit = along * (1.0 / (length + np.finfo(np.float64).tiny))[:, None]
    return np.stack([unit[:, 1], -unit[:, 0]], axis=-1)


@njit(cache=True, nogil=True)
def _sort_segments(walls, corner_m, cell_m, places, members):  # type: ignore[no-untyped-def] # a kernel
    """Put each segment into the cells that it touches: ``places`` counts on; ``members``, if any, are written."""
    half = 0.5 * cell_m
    rows, columns = places.shape
    for i in range(len(walls)):
        x1, y1, x2, y2, nx, ny = walls[i]
        reach = (abs(nx) + abs(ny)) * half + MARGIN_M
        first_row = max(math.floor((min(y1, y2) - MARGIN_M - corner_m[1]) / cell_m), 0)
        last_row = min(math.floor((max(y1, y2) + MARGIN_M - corner_m[1]) / cell_m), rows - 1)
        first_column = max(math.floor((min(x1, x2) - MARGIN_M - corner_m[0]) / cell_m), 0)
        last_column = min(math.floor((max(x1, x2) + MARGIN_M - corner_m[0]) / cell_m), columns - 1)
        for row in range(first_row, last_row + 1):
            y = corner_m[1] + row * cell_m + half
            for column in range(first_column, last_column + 1):
                x = corner_m[0] + column * cell_m + half
                if abs((x - x1) * nx + (y - y1) * ny) <= reach:
                    if len(members):
                        members[places[row, column]] = i
                    places[row, column] += 1
