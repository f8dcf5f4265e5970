"""Which walls a part of a run sees, without mapping it: the cells that its beams end in, under the true poses.

It tells in milliseconds about how much two parts will overlap, for a search that maps only what is promising.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from merger import se2
from sim.maps.mapping import OccupancyConfig
from sim.robot_run import RobotRun

_LARGEST_SIDE = 1500
"""Cells along the longer side: larger buildings are told in coarser cells."""
_NEAR = np.array([[0, 1, 1, 1, 0], *[[1, 1, 1, 1, 1]] * 3, [0, 1, 1, 1, 0]], dtype=np.uint8)
"""The cells within about two of a cell, see `sim.maps.truth.overlap_fractions`."""

Mask = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class SeenWalls:
    """The cells that each block of a run's scans hits."""

    block_scans: int
    """Scans of a block; the last one may have fewer."""
    num_scans: int
    """Scans of the run."""
    cells: npt.NDArray[np.int64]
    """(H,) cells (row * columns + column), block by block, each once a block."""
    first: npt.NDArray[np.int64]
    """(B + 1,) where each block's cells begin."""
    shape: tuple[int, int]
    """Rows and columns."""

    def mask(self, start: int, stop: int) -> Mask:
        """(rows, cols) 1 where the blocks from scan ``start`` to before ``stop`` hit."""
        low, high = (self.first[min(-(-scan // self.block_scans), len(self.first) - 1)] for scan in (start, stop))
        seen = np.zeros(self.shape, dtype=np.uint8)
        seen.reshape(-1)[self.cells[low:high]] = 1
        return seen


def find_seen_walls(run: RobotRun, config: OccupancyConfig, num_blocks: int) -> SeenWalls:
    """The walls that a run sees, in about so many blocks of scans."""
    block_scans = max(run.num_scans // num_blocks, 1)
    T_world_lidar = run.trajectory.T_world_robot @ run.lidar.pose_on_robot
    beams = np.stack([np.cos(run.lidar.angles_rad), np.sin(run.lidar.angles_rad)], axis=-1)
    hits = []
    for start in range(0, run.num_scans, block_scans):
        stop = min(start + block_scans, run.num_scans)
        ranges = run.read_ranges(start, stop)
        ends = np.isfinite(ranges) & (ranges <= config.max_range_m)
        points = np.where(ends, ranges, 0.0)[..., None] * beams
        hits.append(se2.transform_points(T_world_lidar[start:stop], points)[ends])
    everything = np.concatenate([*hits, T_world_lidar[:1, :2, 2]])
    low, high = everything.min(axis=0), everything.max(axis=0)
    cell_m = max(config.resolution_m, float((high - low).max()) / _LARGEST_SIDE)
    cols, rows = (int(n) + 1 for n in (high - low) // cell_m)
    cells = [np.unique(((h - low) // cell_m).astype(np.int64) @ np.array([1, cols])) for h in hits]
    first = np.concatenate([[0], np.cumsum([len(c) for c in cells])])
    return SeenWalls(block_scans, run.num_scans, np.concatenate(cells), first, (rows, cols))


def overlap_of(one: Mask, other: Mask) -> float:
    """Mean of both shares of cells that lie within about two cells of the other's; 0 where either mask is empty."""
    counts = (cv2.countNonZero(one), cv2.countNonZero(other))
    if not all(counts):
        return 0.0
    near = [cv2.countNonZero(cv2.bitwise_and(a, cv2.dilate(b, _NEAR))) for a, b in ((one, other), (other, one))]
    return (near[0] / counts[0] + near[1] / counts[1]) / 2.0
