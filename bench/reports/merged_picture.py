"""Maps laid over each other as an image: each map's walls in its own colour, free space as a shade."""

import math
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from bench.reports.drawing import map_colours
from bench.scoring.map_raster import Raster, count_votes, make_sheet
from merger import se2
from merger.grid_map import GridMap

Array = npt.NDArray[np.float64]
_BRUSH = np.ones((2, 2), dtype=np.uint8)
_FREE = (0.5, 0.5, 0.5, 0.16)


def draw_merge(
    maps: Sequence[GridMap], T_world_map: Array, raster: Raster, members: Sequence[int] | None = None
) -> npt.NDArray[np.uint8]:
    """Paint maps at their poses.

    Args:
        maps: N maps; map k has the k-th colour whatever else is shown.
        T_world_map: (N, 3, 3) poses; a map whose pose is NaN is left out.
        raster: The part of the world that is shown.
        members: Which maps to show; none: all.

    Returns:
        (rows, cols, 4) RGBA, transparent where nothing is known, north up.
    """
    image = np.zeros((raster.rows, raster.cols, 4))
    colours = map_colours(len(maps))
    shown = [k for k in (range(len(maps)) if members is None else members) if np.isfinite(T_world_map[k]).all()]
    walls = []
    for k in shown:
        occupied, free = count_votes([make_sheet(maps[k])], T_world_map[k : k + 1], raster)
        image[(free > 0) & (image[..., 3] == 0.0)] = _FREE
        walls.append((colours[k], cv2.dilate((occupied > 0).astype(np.uint8), _BRUSH) > 0))
    for colour, mask in walls:
        image[mask] = (*colour, 1.0)
    return np.asarray(np.rint(image[::-1] * 255.0), dtype=np.uint8)


def frame_of(maps: Sequence[GridMap], T_world_map: Array, max_pixels: int = 600) -> Raster:
    """A raster that holds the walls of the maps at these poses, with a margin, at most so many pixels wide or high."""
    points = np.concatenate([_known_corners(m, T) for m, T in zip(maps, T_world_map, strict=True)])
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    cell = max(min(m.resolution_m for m in maps), float((high - low).max()) / max_pixels)
    cols, rows = (math.ceil(v / cell) for v in high - low)
    return Raster(float(low[0]), float(low[1]), cell, rows, cols)


def _known_corners(grid: GridMap, T_world_map: Array) -> Array:
    centres = grid.cell_centers(grid.occupied)
    if not len(centres):
        centres = grid.cell_centers(np.ones_like(grid.occupied))
    return se2.transform_points(T_world_map, centres)
