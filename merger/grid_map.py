"""The occupancy grid that every package passes around.

Frames: ``map`` is the metric frame of the grid's `map_server` YAML. ``grid`` has its origin in the lower-left
corner of the lower-left cell, x along the columns and y along the rows: cell (row, col) covers
``[col, col + 1) x [row, row + 1)`` times the resolution, and row 0 has the smallest y.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from merger import se2

OCCUPIED_PROBABILITY = 0.65
"""A cell above it is occupied (map_server's ``occupied_thresh``)."""
FREE_PROBABILITY = 0.196
"""A cell below it is free (map_server's ``free_thresh``; at 0.25 the grey of "unknown" would load as free)."""

_RESOLUTION_RANGE_M = (0.001, 100.0)
"""Finest and coarsest side of a cell: beyond, units have been mistaken."""
_FARTHEST_M = 1e8
"""Where a grid may lie: farther away its cells would have no exact places."""

LOG_ODDS_OCCUPIED = 2.0
"""Log-odds given to an occupied cell of a trinary map."""
LOG_ODDS_FREE = -2.0
"""Log-odds given to a free cell of a trinary map."""


@dataclass(frozen=True)
class GridMap:
    """An occupancy grid with its name and its place in the frame ``map``.

    Raises:
        ValueError: the name is no text, the cells are not a finite, non-empty 2D array, the resolution is out of its
            range, or ``T_map_grid`` is not a rigid motion or leads out of reach.
    """

    name: str
    """Unique among the maps of one merge."""
    log_odds: npt.NDArray[np.float32]
    """(H, W) log-odds of occupancy, row 0 at the smallest y of frame ``grid``; 0 is unknown."""
    resolution_m: float
    """Side of a cell, metres, in [0.001, 100]."""
    T_map_grid: npt.NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    """(3, 3) pose of the grid's lower-left corner in frame ``map``: the YAML's ``origin``, yaw included."""

    def __post_init__(self) -> None:
        """Refuse what is no grid."""
        if any("\ud800" <= letter <= "\udfff" for letter in self.name):
            raise ValueError(f"map {self.name!a}: its name is not in UTF-8")
        if self.log_odds.ndim != 2 or self.log_odds.size == 0:
            raise ValueError(f"map '{self.name}': cells must be a non-empty 2D array, got shape {self.log_odds.shape}")
        if not np.isfinite(self.log_odds).all():
            raise ValueError(f"map '{self.name}': log-odds must be finite")
        if fault := resolution_fault(self.resolution_m):
            raise ValueError(f"map '{self.name}': {fault}")
        R = self.T_map_grid[:2, :2]
        if self.T_map_grid.shape != (3, 3) or not np.allclose(R.T @ R, np.eye(2), atol=1e-6):
            raise ValueError(f"map '{self.name}': T_map_grid must be a (3, 3) rigid motion")
        if not (np.abs(self.T_map_grid[:2, 2]) <= _FARTHEST_M).all():
            raise ValueError(f"map '{self.name}': its origin must lie within {_FARTHEST_M:g} m")

    @property
    def occupied(self) -> npt.NDArray[np.bool_]:
        """(H, W) mask of occupied cells."""
        return self.log_odds > np.float32(logit(OCCUPIED_PROBABILITY))

    @property
    def free(self) -> npt.NDArray[np.bool_]:
        """(H, W) mask of free cells."""
        return self.log_odds < np.float32(logit(FREE_PROBABILITY))

    @property
    def size_m(self) -> tuple[float, float]:
        """Width (along x) and height (along y) of the grid, metres."""
        rows, cols = self.log_odds.shape
        return cols * self.resolution_m, rows * self.resolution_m

    def cell_centers(self, mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
        """(N, 2) centres of the cells where the (H, W) mask holds, metres in frame ``map``, row by row."""
        rows, cols = np.nonzero(mask)
        return self.points_map_from_cells(np.stack([rows, cols], axis=-1).astype(np.float64) + 0.5)

    def points_map_from_cells(self, cells: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Map (N, 2) continuous cell coordinates (row, col) to (N, 2) points in metres, frame ``map``.

        The centre of cell (r, c) is (r + 0.5, c + 0.5).
        """
        return se2.transform_points(self.T_map_grid, cells[..., ::-1] * self.resolution_m)

    def cells_from_points_map(self, points_map: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Map (N, 2) points in metres, frame ``map``, to continuous cell coordinates (row, col).

        The inverse of `points_map_from_cells`; ``floor`` gives the cell that holds a point.
        """
        points_grid = se2.transform_points(se2.invert(self.T_map_grid), points_map)
        return points_grid[..., ::-1] / self.resolution_m


def crop_to_known(grid: GridMap) -> GridMap:
    """Cut off rows and columns without a known cell; a map that knows nothing, or all its borders, stays as it is."""
    known = grid.log_odds != 0.0
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if len(rows) == 0 or (int(rows[-1] - rows[0]) + 1, int(cols[-1] - cols[0]) + 1) == known.shape:
        return grid
    log_odds = grid.log_odds[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1].copy()
    T_grid_cropped = se2.make_motion(cols[0] * grid.resolution_m, rows[0] * grid.resolution_m, 0.0)
    return replace(grid, log_odds=log_odds, T_map_grid=grid.T_map_grid @ T_grid_cropped)


def resolution_fault(resolution_m: float) -> str | None:
    """What is wrong with the side of a cell, metres; None if it can be used."""
    finest_m, coarsest_m = _RESOLUTION_RANGE_M
    if finest_m <= resolution_m <= coarsest_m:
        return None
    return f"resolution must be in [{finest_m:g}, {coarsest_m:g}] m, got {resolution_m:g}"


def logit(probability: float) -> float:
    """Log-odds of a probability in (0, 1)."""
    return math.log(probability / (1.0 - probability))


def log_odds_from_probability(
    probability: npt.NDArray[np.float64], occupied: npt.NDArray[np.bool_], free: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float32]:
    """Log-odds of cells read from a file, so that the file's own thresholds keep their meaning.

    Args:
        probability: (H, W) probability of occupancy, 0..1.
        occupied: (H, W) cells that the file calls occupied; they get at least `LOG_ODDS_OCCUPIED`.
        free: (H, W) cells that the file calls free; they get at most `LOG_ODDS_FREE`.
    """
    clipped = np.clip(probability, 0.02, 0.98)
    log_odds = np.log(clipped / (1.0 - clipped)).astype(np.float32)
    log_odds[free] = np.minimum(log_odds[free], LOG_ODDS_FREE)
    log_odds[occupied] = np.maximum(log_odds[occupied], LOG_ODDS_OCCUPIED)
    return log_odds
