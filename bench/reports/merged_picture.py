"""Maps laid over each other as an image: each map's walls in its own colour, free space as a shade."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from bench.reports.drawing import MOST_MAP_COLOURS, map_colours
from bench.reports.png import PaletteImage
from bench.scoring.map_raster import Raster, Sheet, bounds_m, count_votes, make_sheet
from merger import se2
from merger.grid_map import GridMap

Array = npt.NDArray[np.float64]
_BRUSH = np.ones((2, 2), dtype=np.uint8)
_GROUND = ((0.0, 0.0, 0.0, 0.0), (0.5, 0.5, 0.5, 0.16))
"""Colours of what is unknown, and of what is free."""


@dataclass(frozen=True)
class MergePicture:
    """Maps at their poses, as far as they lie in a picture."""

    image: PaletteImage
    """The picture, transparent where nothing is known, north up."""
    num_outside: int
    """Maps that lie wholly beside it."""


def draw_merge(maps: Sequence[GridMap], T_world_map: Array, raster: Raster) -> MergePicture:
    """Paint maps at their poses.

    Args:
        maps: N maps; map k has the k-th colour whatever else is shown, and its walls lie on those of maps before it.
        T_world_map: (N, 3, 3) poses; a map whose pose is NaN is left out.
        raster: The part of the world that is shown.
    """
    paint, num_outside = np.zeros((raster.rows, raster.cols), dtype=np.uint8), 0  # 0 unknown, 1 free, then walls
    for k in map(int, np.flatnonzero(np.isfinite(T_world_map).all(axis=(1, 2)))):
        sheet = make_sheet(maps[k])
        window, part = _window_of(sheet, T_world_map[k], raster)
        if not part.rows or not part.cols:
            num_outside += 1
            continue
        occupied, free = count_votes([sheet], T_world_map[k : k + 1], part)
        shown = paint[window]
        shown[(free > 0) & (shown == 0)] = 1
        shown[cv2.dilate((occupied > 0).astype(np.uint8), _BRUSH) > 0] = len(_GROUND) + k % MOST_MAP_COLOURS
    walls = [(*colour, 1.0) for colour in map_colours(len(maps))[:MOST_MAP_COLOURS]]
    palette = np.rint(np.array([*_GROUND, *walls]) * 255.0).astype(np.uint8)
    return MergePicture(PaletteImage(paint[::-1], palette), num_outside)


def _window_of(sheet: Sheet, T_world_map: Array, raster: Raster) -> tuple[tuple[slice, slice], Raster]:
    """The rows and columns of a raster that a map touches, brush included, and the raster that they are."""
    low, high = bounds_m([sheet], T_world_map[None])
    corner, most = np.array([raster.x_min_m, raster.y_min_m]), [raster.cols, raster.rows]
    left, below = np.clip(np.floor((low - corner) / raster.cell_m), 0, most).astype(int)
    right, above = np.clip(np.ceil((high - corner) / raster.cell_m) + 1, [left, below], most).astype(int)
    x_m, y_m = corner + raster.cell_m * np.array([left, below])
    part = Raster(float(x_m), float(y_m), raster.cell_m, int(above - below), int(right - left))
    return (slice(below, above), slice(left, right)), part


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
