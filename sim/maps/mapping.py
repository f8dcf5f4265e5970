"""Occupancy grid mapping with known poses: log-odds, each cell updated once a scan, hits before misses.

Source: Moravec and Elfes, "High resolution maps from wide angle sonar", 1985; Thrun, Burgard and Fox,
"Probabilistic Robotics", 2005, table 9.1, with the cells of each beam found exactly.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap
from sim.maps.beam_tracing import BeamModel, Sweep, beam_extent, integrate_scans
from sim.robot_run import LidarSpec

_GROWTH_CELLS = 128
"""Cells that a grid grows beyond what is needed, so that it does not grow at every scan."""

_MOST_CELLS = 500_000_000
"""Larger grids, of 2 GB, are refused."""


@dataclass(frozen=True)
class OccupancyConfig:
    """How scans become cells.

    Raises:
        ValueError: a value is out of its range.
    """

    resolution_m: float = 0.05
    """Side of a cell, 0.002 to 1: finer grids do not fit into memory."""
    max_range_m: float = 20.0
    """Usable range, > 0: a longer beam frees cells up to it, and hits none."""
    no_return_free_m: float = 0.0
    """A beam without return frees cells up to this range, 0 to ``max_range_m``; 0 ignores such beams."""
    log_odds_hit: float = 1.7
    """Added to a cell that ends a beam, > 0: one hit outweighs two misses, since walls are grazed by many beams."""
    log_odds_miss: float = -0.75
    """Added to a cell that a beam crosses, < 0: two misses make a cell free."""
    log_odds_limit: float = 10.0
    """Bound of a cell's absolute log-odds, >= the larger of a hit and a miss."""

    def __post_init__(self) -> None:
        """Refuse what no map can be made with."""
        _require("resolution_m", "in [0.002, 1]", self.resolution_m, 0.002 <= self.resolution_m <= 1.0)
        _require("max_range_m", "> 0", self.max_range_m, self.max_range_m > 0.0)
        free_m = self.no_return_free_m
        _require("no_return_free_m", f"in [0, {self.max_range_m:g}]", free_m, 0.0 <= free_m <= self.max_range_m)
        _require("log_odds_hit", "> 0", self.log_odds_hit, self.log_odds_hit > 0.0)
        _require("log_odds_miss", "< 0", self.log_odds_miss, self.log_odds_miss < 0.0)
        least = max(self.log_odds_hit, -self.log_odds_miss)
        _require("log_odds_limit", f">= {least:g}", self.log_odds_limit, self.log_odds_limit >= least)


class OccupancyMapper:
    """A grid that grows with the scans that are added to it; its cells are aligned with the axes of frame ``map``."""

    def __init__(self, lidar: LidarSpec, config: OccupancyConfig) -> None:
        """Begin an empty grid in a frame ``map`` of the caller's choice."""
        self._resolution_m = config.resolution_m
        self._model = BeamModel(
            config.max_range_m,
            config.no_return_free_m,
            config.log_odds_hit,
            config.log_odds_miss,
            config.log_odds_limit,
        )
        self._directions = np.stack([np.cos(lidar.angles_rad), np.sin(lidar.angles_rad)], axis=-1)
        self._T_robot_lidar = lidar.pose_on_robot
        self._log_odds = np.zeros((0, 0), dtype=np.float32)
        self._first_cell = np.zeros(2, dtype=np.int64)

    def add_scans(
        self,
        ranges_m: npt.NDArray[np.float32],
        T_map_robot: npt.NDArray[np.float64],
        motions: npt.NDArray[np.float64] | None = None,
    ) -> None:
        """Add scans in their order.

        Args:
            ranges_m: (S, B) ranges, by REP 117.
            T_map_robot: (S, 3, 3) poses of the robot.
            motions: (S, 3) of the lidar from beam to beam: `sim.maps.scan_skew.motion_per_beam`; none: it stands.

        Raises:
            ValueError: the map would be too large for memory.
        """
        if len(ranges_m) == 0:
            return
        T_map_lidar = T_map_robot @ self._T_robot_lidar
        sweep = Sweep(self._directions, np.zeros((len(ranges_m), 3)) if motions is None else motions)
        self._grow(beam_extent(ranges_m, T_map_lidar, sweep, self._model))
        T_cells_lidar = T_map_lidar / self._resolution_m
        T_cells_lidar[:, :2, 2] -= self._first_cell
        T_cells_lidar[:, 2, 2] = 1.0
        integrate_scans(self._log_odds, ranges_m, T_cells_lidar, sweep, self._model)

    def grid(self, name: str) -> GridMap:
        """The map so far, cut to the cells that have been seen; a single unknown cell where there is none."""
        seen_rows = np.flatnonzero(self._log_odds.any(axis=1))
        seen_columns = np.flatnonzero(self._log_odds.any(axis=0))
        if len(seen_rows) == 0:
            return GridMap(name, np.zeros((1, 1), dtype=np.float32), self._resolution_m)
        row, column = seen_rows[0], seen_columns[0]
        cells = self._log_odds[row : seen_rows[-1] + 1, column : seen_columns[-1] + 1].copy()
        x_m, y_m = (self._first_cell + np.array([column, row])) * self._resolution_m
        return GridMap(name, cells, self._resolution_m, se2.make_motion(x_m, y_m, 0.0))

    def _grow(self, extent_m: npt.NDArray[np.float64]) -> None:
        """Enlarge the grid until it holds the box x_min, y_min, x_max, y_max, metres."""
        low = np.floor(extent_m[:2] / self._resolution_m) - 1.0
        high = np.floor(extent_m[2:] / self._resolution_m) + 2.0
        rows, columns = self._log_odds.shape
        first, end = self._first_cell, self._first_cell + np.array([columns, rows])
        if self._log_odds.size and (low >= first).all() and (high <= end).all():
            return
        if self._log_odds.size:
            low = np.where(low < first, np.minimum(low, first) - _GROWTH_CELLS, first)
            high = np.where(high > end, np.maximum(high, end) + _GROWTH_CELLS, end)
        _refuse_too_large(high - low, self._resolution_m)
        corner = low.astype(np.int64)
        grown = np.zeros((int(high[1] - low[1]), int(high[0] - low[0])), dtype=np.float32)
        column, row = first - corner if self._log_odds.size else (0, 0)
        grown[row : row + rows, column : column + columns] = self._log_odds
        self._log_odds, self._first_cell = grown, corner


def _refuse_too_large(num_cells: npt.NDArray[np.float64], resolution_m: float) -> None:
    """Refuse (2,) columns and rows for which there is no memory: poses lie far apart, mostly because one is wrong."""
    if not num_cells.prod() <= _MOST_CELLS:
        width_m, depth_m = (float(side) for side in num_cells * resolution_m)
        raise ValueError(
            f"a map of {width_m:.4g} x {depth_m:.4g} m in cells of {resolution_m:g} m is too large, at most "
            f"{_MOST_CELLS:.3g} cells are allowed: is a pose wrong?"
        )


def _require(name: str, allowed: str, value: float, holds: bool) -> None:
    if not (holds and math.isfinite(value)):
        raise ValueError(f"mapping: {name} must be {allowed}, got {value:g}")
