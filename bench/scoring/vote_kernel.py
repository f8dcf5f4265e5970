"""The hot loops of `map_raster` and `grid_metrics`: lay one map onto a raster, and count (numba)."""

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]
Marks = npt.NDArray[np.uint8]
OCCUPIED, FREE = 1, 2
"""Marks of cells; 0 is unknown."""
_BITS, _LOW = np.uint64(16), np.uint64(0xFFFF)


@njit(cache=True, nogil=True)
def add_votes(
    marks: Marks,
    T_sheet_raster: Array,
    window: tuple[int, int, int, int],
    occupied: npt.NDArray[np.uint16],
    free: npt.NDArray[np.uint16],
) -> None:
    """Count, for every raster cell of a window, what the map says at its centre (nearest cell).

    Args:
        marks: (H, W) the map's cells.
        T_sheet_raster: (3, 3) continuous cell coordinates (x, y) of the raster to those of the map, scale included.
        window: First and last row, first and last column of the raster, the last ones not included.
        occupied: (rows, cols) votes, counted up in place.
        free: (rows, cols) votes, counted up in place.
    """
    T = T_sheet_raster
    for row in range(window[0], window[1]):
        x0 = T[0, 1] * (row + 0.5) + T[0, 2]
        y0 = T[1, 1] * (row + 0.5) + T[1, 2]
        first, last = _clip(x0, T[0, 0], marks.shape[1], window[2], window[3])
        first, last = _clip(y0, T[1, 0], marks.shape[0], first, last)
        for col in range(first, last):
            mark = marks[int(y0 + T[1, 0] * (col + 0.5)), int(x0 + T[0, 0] * (col + 0.5))]
            occupied[row, col] += mark & OCCUPIED
            free[row, col] += mark >> 1


@njit(cache=True, nogil=True)
def compare_cells(
    marks: Marks, sheets: npt.NDArray[np.int64], T_sheet_raster: Array, true: Marks, place: tuple[int, int, int, int]
) -> tuple[int, int, int, int, int, int]:
    """Lay maps onto a raster, a row at a time that is counted and forgotten, and compare it with the true one.

    Args:
        marks: (M,) cells of all maps, row by row, one map after the other.
        sheets: (N, 7) of each map: where it begins in ``marks``, its rows and columns, and the window of the raster
            that it touches: first and last row, first and last column, the last ones not included.
        T_sheet_raster: (N, 3, 3) as in `add_votes`.
        true: (h, w) marks of the true raster.
        place: Rows and columns of the raster, and the row and column of it where the true one begins.

    Returns:
        How often, over all cells and all two maps that know a cell, they agree on it, and how often they do not;
        then cells that are occupied in both rasters, in either; free in both, in either.
    """
    rows, cols, top, left = place
    agree, disagree, walls, all_walls, floor, all_floor = 0, 0, 0, 0, 0, 0
    votes, at = np.empty(cols, dtype=np.uint64), np.empty(cols, dtype=np.int32)
    true_row = np.zeros(cols, dtype=np.uint8)
    for row in range(rows):
        votes[:] = 0
        for k in range(len(sheets)):
            if sheets[k, 3] <= row < sheets[k, 4]:
                _add_row(marks, sheets[k], T_sheet_raster[k], row, (votes, at))
        true_row[:] = 0
        if top <= row < top + len(true):
            true_row[left : left + true.shape[1]] = true[row - top]
        for col in range(cols):
            o, f = np.int64((votes[col] >> _BITS) & _LOW), np.int64(votes[col] >> (_BITS + _BITS))
            wall, free = (o > 0) & (o >= f), f > o
            true_wall, true_free = (true_row[col] & OCCUPIED) != 0, (true_row[col] & FREE) != 0
            agree += int((o * (o - 1) + f * (f - 1)) >> 1)
            disagree += int(o * f)
            walls += wall & true_wall
            all_walls += wall | true_wall
            floor += free & true_free
            all_floor += free | true_free
    return agree, disagree, walls, all_walls, floor, all_floor


@njit(inline="always")
def _add_row(
    marks: Marks,
    sheet: npt.NDArray[np.int64],
    T: Array,
    row: int,
    buffers: tuple[npt.NDArray[np.uint64], npt.NDArray[np.int32]],
) -> None:
    """Count what one map says along a row of the raster: 16 bits of a number for each mark."""
    votes, at = buffers
    width = np.int32(sheet[2])
    x0, y0 = T[0, 1] * (row + 0.5) + T[0, 2], T[1, 1] * (row + 0.5) + T[1, 2]
    first, last = _clip(x0, T[0, 0], sheet[2], sheet[5], sheet[6])
    first, last = _clip(y0, T[1, 0], sheet[1], first, last)
    for k in range(last - first):
        centre = np.float64(np.int32(k)) + (first + 0.5)  # 32 bits: several at a time
        at[k] = np.int32(y0 + T[1, 0] * centre) * width + np.int32(x0 + T[0, 0] * centre)
    cells = marks[sheet[0] : sheet[0] + sheet[1] * sheet[2]]
    for k in range(last - first):
        votes[first + k] += np.uint64(1) << (np.uint64(cells[np.uint32(at[k])]) * _BITS)


@njit(cache=True, nogil=True)
def _clip(offset: float, slope: float, size: int, first: int, last: int) -> tuple[int, int]:
    """The columns from ``first`` to before ``last`` at whose centres ``offset + slope * x`` lies within [0, size)."""
    if slope != 0.0:
        ends = -offset / slope, (size - offset) / slope
        first = int(max(min(min(ends) - 1.5, last), first))
        last = int(min(max(max(ends) + 1.5, first), last))
    while first < last and not 0.0 <= offset + slope * (first + 0.5) < size:
        first += 1
    while first < last and not 0.0 <= offset + slope * (last - 0.5) < size:
        last -= 1
    return first, last
