"""Maps into one grid: the sum of their log-odds under their global motions (last line of Algorithm 4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap

_Array = npt.NDArray[np.float64]

_STRIP_ROWS = 32
"""Rows of the merged grid that are filled at once: few enough for the processor's cache."""


@dataclass(frozen=True)
class CompositingConfig:
    """Settings of the merged grid.

    Raises:
        ValueError: a setting is out of its range.
    """

    max_cells: int = 100_000_000
    """Larger grids are refused, >= 1."""
    max_log_odds: float = 100.0
    """The sum is limited to plus or minus this, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.max_cells < 1:
            raise ValueError(f"compositing.max_cells must be >= 1, got {self.max_cells}")
        if not self.max_log_odds > 0.0:
            raise ValueError(f"compositing.max_log_odds must be > 0, got {self.max_log_odds}")


@dataclass(frozen=True)
class _Lattice:
    """The cells of the merged grid: corner and size in a lattice fixed to the reference map."""

    T_ref_lattice: _Array
    cell_m: float
    first_row: int
    first_col: int
    num_rows: int
    num_cols: int


def composite_maps(
    maps: Sequence[GridMap],
    T_ref_map: _Array,
    T_ref_lattice: _Array,
    resolution_m: float,
    config: CompositingConfig,
) -> GridMap:
    """Add up the log-odds of maps where they lie; each merged cell takes the map's cell that holds its centre.

    Where the merged cells are coarser than a map's, finer ones are filled first and reduced, and a wall wins over
    the free space beside it, so that walls do not vanish.

    Args:
        maps: M maps, at least one.
        T_ref_map: (M, 3, 3) their motions into the reference's frame ``map``.
        T_ref_lattice: (3, 3) pose of a corner of the merged cells: the reference's own ``T_map_grid`` keeps its cells.
        resolution_m: Side of a merged cell, metres.
        config: Settings.

    Returns:
        The grid ``merged`` over the known cells of all maps, in the reference's frame ``map``.

    Raises:
        ValueError: the grid would have more cells than allowed.
    """
    split = max(1, int(np.ceil(resolution_m / min(grid.resolution_m for grid in maps) - 1e-6)))
    lattice = _span_lattice(maps, T_ref_map, T_ref_lattice, resolution_m, split)
    num_cells = lattice.num_rows * lattice.num_cols
    if num_cells > config.max_cells:
        raise ValueError(
            f"the merged map at {resolution_m:g} m would need {num_cells:.3g} cells, at most {config.max_cells:.3g} "
            "are allowed: choose a larger resolution"
        )
    total = np.zeros((lattice.num_rows, lattice.num_cols), dtype=np.float32)
    for grid, T in zip(maps, T_ref_map, strict=True):
        _add_map(total, grid, T, lattice)
    total = np.clip(_reduce_blocks(total, split), -config.max_log_odds, config.max_log_odds)
    corner = np.array([lattice.first_col, lattice.first_row]) * lattice.cell_m
    return GridMap("merged", total, resolution_m, T_ref_lattice @ se2.make_motion(corner[0], corner[1], 0.0))


def _span_lattice(
    maps: Sequence[GridMap], T_ref_map: _Array, T_ref_lattice: _Array, resolution_m: float, split: int
) -> _Lattice:
    """The lattice over the known cells of all maps, its sides multiples of ``split`` cells."""
    cell_m = resolution_m / split
    corners = np.concatenate([_known_corners(grid, T, T_ref_lattice) for grid, T in zip(maps, T_ref_map, strict=True)])
    # Rounding must not open a new row for a corner that lies on the lattice.
    first = np.floor(corners.min(axis=0) / resolution_m + 1e-6).astype(np.int64) * split
    last = np.ceil(corners.max(axis=0) / resolution_m - 1e-6).astype(np.int64) * split
    cols, rows = (max(split, int(side)) for side in last - first)
    return _Lattice(T_ref_lattice, cell_m, int(first[1]), int(first[0]), rows, cols)


def _known_corners(grid: GridMap, T_ref_map: _Array, T_ref_lattice: _Array) -> _Array:
    """(4, 2) corners of the map's known cells in metres, frame ``lattice``; of all its cells if none is known."""
    known = grid.log_odds != 0.0
    if not known.any():
        known = np.ones_like(known)
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    low, high = (rows[0], cols[0]), (rows[-1] + 1, cols[-1] + 1)
    cells = np.array([[r, c] for r in (low[0], high[0]) for c in (low[1], high[1])], dtype=np.float64)
    return se2.transform_points(se2.invert(T_ref_lattice) @ T_ref_map, grid.points_map_from_cells(cells))


def _add_map(total: npt.NDArray[np.float32], grid: GridMap, T_ref_map: _Array, lattice: _Lattice) -> None:
    """Add one map to the rows and columns of the merged grid that it covers."""
    corners = _known_corners(grid, T_ref_map, lattice.T_ref_lattice) / lattice.cell_m
    corners -= np.array([lattice.first_col, lattice.first_row])
    left, bottom = np.maximum(np.floor(corners.min(axis=0) + 1e-6).astype(np.intp), 0)
    right, top = np.minimum(np.ceil(corners.max(axis=0) - 1e-6).astype(np.intp), total.shape[::-1])
    T_grid_lattice = se2.invert(T_ref_map @ grid.T_map_grid) @ lattice.T_ref_lattice
    A, t = T_grid_lattice[:2, :2] * lattice.cell_m / grid.resolution_m, T_grid_lattice[:2, 2] / grid.resolution_m
    x = np.arange(left, right) + lattice.first_col + 0.5
    y = np.arange(bottom, top) + lattice.first_row + 0.5
    part = total[bottom:top, left:right]
    for first in range(0, len(y), _STRIP_ROWS):
        strip = slice(first, first + _STRIP_ROWS)
        col = np.add.outer(A[0, 1] * y[strip], A[0, 0] * x + t[0])
        row = np.add.outer(A[1, 1] * y[strip], A[1, 0] * x + t[1])
        part[strip] += _look_up(grid.log_odds, row, col)


def _look_up(log_odds: npt.NDArray[np.float32], row: _Array, col: _Array) -> npt.NDArray[np.float32]:
    """Log-odds of the cells that hold places of a grid, in cells; 0 outside. The places are overwritten."""
    num_rows, num_cols = log_odds.shape
    rows, cols = (np.floor(place, out=place).astype(np.int64) for place in (row, col))
    # Seen as unsigned, a negative number is larger than any size.
    inside = (rows.view(np.uint64) < num_rows) & (cols.view(np.uint64) < num_cols)
    values: npt.NDArray[np.float32] = log_odds.take(rows * num_cols + cols, mode="clip")
    values *= inside
    return values


def _reduce_blocks(total: npt.NDArray[np.float32], split: int) -> npt.NDArray[np.float32]:
    """One cell of each block of ``split`` by ``split``: the largest log-odds if occupied, else the smallest."""
    if split == 1:
        return total
    rows, cols = total.shape
    blocks = total.reshape(rows // split, split, cols // split, split)
    high, low = blocks.max(axis=(1, 3)), blocks.min(axis=(1, 3))
    return np.asarray(np.where(high > 0.0, high, low), dtype=np.float32)
