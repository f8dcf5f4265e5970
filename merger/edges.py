"""Edge points of a grid: where its walls are seen."""

import cv2
import numpy as np
import numpy.typing as npt

from merger.grid_map import GridMap


def extract_edge_points(grid: GridMap) -> npt.NDArray[np.float64]:
    """Find the centres of the occupied cells that touch a free cell: the faces of the walls.

    An edge detector on the picture would also answer at the border of the explored area, which moves from map to
    map, and on both sides of every wall.

    Args:
        grid: The map.

    Returns:
        (N, 2) points in metres, frame ``grid``, row by row. Where no occupied cell touches a free one (a map
        without free space), every occupied cell.
    """
    occupied = grid.occupied
    near_free = cv2.dilate(grid.free.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)).astype(np.bool_)
    edges = occupied & near_free
    rows, cols = np.nonzero(edges if edges.any() else occupied)
    return np.asarray((np.stack([cols, rows], axis=-1) + 0.5) * grid.resolution_m, dtype=np.float64)
