"""How far every place of a building is from the nearest surface, on a grid, and which places a robot reaches."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_PARTS = 5
"""Surfaces are drawn in cells so many times finer (odd): a clearance is exact to about 0.15 of a cell."""
_FARTHEST_M = 2.0
"""Clearances are cut off here: nothing that plans needs to know more."""
_BORDER_CELLS = 3
"""Cells around the building that belong to the outside."""


@dataclass(frozen=True)
class FreeSpace:
    """Clearance on a grid; cell (row, col) covers ``origin + [col, col + 1) x [row, row + 1)`` cells, y up."""

    clearance_m: Array
    """(H, W) distance from a cell's centre to the nearest surface, at most 2 m."""
    resolution_m: float
    """Side of a cell."""
    origin_m: tuple[float, float]
    """Lower-left corner of the grid, frame ``world``."""

    def cells_of(self, points: Array) -> npt.NDArray[np.int64]:
        """(..., 2) cells (row, col) that hold (..., 2) points in metres, clipped to the grid."""
        cells = np.floor((points - self.origin_m) / self.resolution_m).astype(np.int64)[..., ::-1]
        return np.clip(cells, 0, np.array(self.clearance_m.shape) - 1)

    def centers_of(self, cells: npt.NDArray[np.int64]) -> Array:
        """(..., 2) centres in metres of (..., 2) cells (row, col)."""
        return np.asarray((cells[..., ::-1] + 0.5) * self.resolution_m + self.origin_m)

    def reachable(self, start: Array, radius_m: float) -> Mask:
        """(H, W) cells that a disc of this radius reaches from a (2,) start; all False if it cannot stand there."""
        passable = self.clearance_m > radius_m
        _, labels = cv2.connectedComponents(passable.astype(np.uint8), connectivity=4)
        row, col = self.cells_of(start[:2])
        label = labels[row, col]
        return np.asarray((labels == label) & (label > 0))


def measure_free_space(segments: Array, resolution_m: float = 0.1) -> FreeSpace:
    """Measure the clearance of every cell of a building.

    Args:
        segments: (N, 2, 2) surfaces in metres.
        resolution_m: Side of a cell.

    Returns:
        The grid, with a border of cells outside the building.
    """
    low = segments.min(axis=(0, 1)) - _BORDER_CELLS * resolution_m
    high = segments.max(axis=(0, 1)) + _BORDER_CELLS * resolution_m
    cols, rows = (math.ceil(v) for v in (high - low) / resolution_m)
    part_m = resolution_m / _PARTS
    free = np.ones((rows * _PARTS, cols * _PARTS), dtype=np.uint8)
    x, y = np.floor((sample_segments(segments, part_m) - low) / part_m).astype(np.int64).T
    free[y, x] = 0
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    middle = _PARTS // 2
    # OpenCV's number of threads chooses between two codes, whose last bits differ; but squared distances are whole.
    squares = np.rint(np.square(distance[middle::_PARTS, middle::_PARTS], dtype=np.float64))
    clearance = np.sqrt(squares) * part_m
    return FreeSpace(np.minimum(clearance, _FARTHEST_M), resolution_m, (float(low[0]), float(low[1])))


def sample_segments(segments: Array, spacing_m: float) -> Array:
    """(M, 2) points along (N, 2, 2) segments, both ends included, at most this far apart."""
    vectors = segments[:, 1] - segments[:, 0]
    counts = np.ceil(np.hypot(vectors[:, 0], vectors[:, 1]) / spacing_m).astype(np.int64) + 1
    owner = np.repeat(np.arange(len(segments)), counts)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = step / (counts - 1)[owner]
    return np.asarray(segments[owner, 0] + share[:, None] * vectors[owner])
