"""Nearest edge points of a map: by a table in constant time, or exactly by a k-d tree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_MARGIN_M = 1.0
"""How far the table reaches beyond the edge points; farther points take the answer of its border."""


@dataclass(frozen=True)
class EdgeIndex:
    """The edge points of one map, ready to be searched."""

    points_grid: npt.NDArray[np.float64]
    """(N, 2) edge points in metres, frame ``grid``."""
    table: npt.NDArray[np.int32]
    """(H, W) index of the edge point that is nearest to each cell, up to a cell or so."""
    corner_m: npt.NDArray[np.float64]
    """(2,) corner of the table's first cell, frame ``grid``."""
    cell_m: float
    """Side of the table's cells."""
    tree: cKDTree
    """The same points as a k-d tree."""


def index_edges(points_grid: npt.NDArray[np.float64], cell_m: float) -> EdgeIndex:
    """Prepare (N, 2) edge points in metres, frame ``grid``, N >= 1, for look-ups with cells of side ``cell_m``."""
    from scipy.spatial import cKDTree  # noqa: PLC0415 # slow to import, and the method robust does without

    corner_m = points_grid.min(axis=0) - 0.5 * cell_m - np.ceil(_MARGIN_M / cell_m) * cell_m
    cols, rows = np.floor((points_grid - corner_m) / cell_m).astype(np.intp).T
    margin = int(np.ceil(_MARGIN_M / cell_m)) + 1
    empty = np.ones((rows.max() + margin, cols.max() + margin), dtype=np.uint8)
    empty[rows, cols] = 0
    _, labels = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    index_of_label = np.zeros(labels.max() + 1, dtype=np.int32)
    index_of_label[labels[rows, cols]] = np.arange(len(points_grid), dtype=np.int32)
    return EdgeIndex(points_grid, index_of_label[labels], corner_m, cell_m, cKDTree(points_grid))


def find_nearest_quickly(index: EdgeIndex, points_grid: npt.NDArray[np.float64]) -> npt.NDArray[np.int32]:
    """Look up the indices (M,) of the edge points nearest to (M, 2) points: right but for about a cell."""
    rows, cols = index.table.shape
    scaled = (points_grid - index.corner_m) * (1.0 / index.cell_m)
    col = np.clip(scaled[:, 0], 0, cols - 1).astype(np.int32)
    row = np.clip(scaled[:, 1], 0, rows - 1).astype(np.int32)
    return np.asarray(index.table.ravel()[row * cols + col])


def find_nearest(index: EdgeIndex, points_grid: npt.NDArray[np.float64]) -> npt.NDArray[np.int32]:
    """Find the indices (M,) of the edge points nearest to (M, 2) points.

    Exact for points within four cells of an edge point; farther ones keep the table's answer.
    """
    nearest = find_nearest_quickly(index, points_grid)
    offset = points_grid - index.points_grid[nearest]
    near = np.flatnonzero(np.einsum("ij,ij->i", offset, offset) < (4.0 * index.cell_m) ** 2)
    nearest[near] = index.tree.query(points_grid[near])[1]
    return nearest
