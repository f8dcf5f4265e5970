"""The hot loops of `map_raster` and `grid_metrics`: lay one map onto a raster, and count (numba)."""

import numpy as np
import numpy.typing as npt
from numba import njit

OCCUPIED, FREE = 1, 2
"""Marks of cells; 0 is unknown."""


@njit(cache=True, nogil=True)
def add_votes(
    marks: npt.NDArray[np.uint8],
    T_sheet_raster: npt.NDArray[np.float64],
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
def count_agreements(occupied: npt.NDArray[np.uint16], free: npt.NDArray[np.uint16]) -> tuple[int, int]:
    """How often, over all cells and all two maps that know a cell, they agree on it, and how often they do not."""
    agree, disagree = 0, 0
    for o, f in zip(occupied.flat, free.flat):  # noqa: B905  # numba knows no strict
        agree += (int(o) * (int(o) - 1) + int(f) * (int(f) - 1)) // 2
        disagree += int(o) * int(f)
    return agree, disagree


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
