"""Any `map_server` map as a building: the outline of its free space, traced.

What is not known to be free is solid, so the building is closed wherever its map ends.
"""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from merger.grid_map import GridMap
from merger.map_server import read_map
from sim.buildings.plan import Plan

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_MAGNIFY = 3
"""Cells are traced in so many parts: the outline lies a sixth of a cell inside the border of the free cells."""
_TOLERANCE_CELLS = 0.6
"""Straightened outlines stay this near to the border of the cells."""
_SMALLEST_UNKNOWN_M2 = 0.06
"""A smaller patch of unknown cells in free space is no obstacle."""
_SMALLEST_FLOOR_M2 = 1.0
_NUM_STARTS = 6
_START_CLEARANCE_M = 0.5


def trace_map(path: Path) -> Plan:
    """Read a map and trace its largest free area; frame ``world`` is the map's frame.

    Raises:
        ValueError: the map cannot be read, or has no free area in which a robot could work.
    """
    grid = read_map(path)
    floor = _floor(grid)
    if np.count_nonzero(floor) * grid.resolution_m**2 < _SMALLEST_FLOOR_M2:
        raise ValueError(f"{path}: the map has no free area of at least {_SMALLEST_FLOOR_M2:g} m2")
    return Plan(path.stem, (), (), _starts(grid, floor), outlines=_outlines(grid, floor))


def _floor(grid: GridMap) -> Mask:
    """(H, W) largest connected free area, small unknown patches in it included."""
    unknown = ~(grid.free | grid.occupied)
    count, patches, stats, _ = cv2.connectedComponentsWithStats(unknown.astype(np.uint8), connectivity=8)
    small = np.zeros(count, dtype=np.bool_)
    small[1:] = stats[1:, cv2.CC_STAT_AREA] * grid.resolution_m**2 < _SMALLEST_UNKNOWN_M2
    _, areas, stats, _ = cv2.connectedComponentsWithStats((grid.free | small[patches]).astype(np.uint8), connectivity=4)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])) if len(stats) > 1 else -1
    return np.asarray(areas == largest)


def _outlines(grid: GridMap, floor: Mask) -> Array:
    """(N, 2, 2) segments in metres around the floor and around what stands on it."""
    padded = np.pad(floor, 1).astype(np.uint8)
    fine = padded.repeat(_MAGNIFY, axis=0).repeat(_MAGNIFY, axis=1)
    contours, _ = cv2.findContours(fine, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    segments = []
    for contour in contours:
        corners = cv2.approxPolyDP(contour, _TOLERANCE_CELLS * _MAGNIFY, True)[:, 0]
        if len(corners) < 3:
            continue
        cells = (corners[:, ::-1].astype(np.float64) + 0.5) / _MAGNIFY - 1.0
        points = grid.points_map_from_cells(cells)
        segments.append(np.stack([points, np.roll(points, -1, axis=0)], axis=1))
    return np.concatenate(segments)


def _starts(grid: GridMap, floor: Mask) -> Array:
    """(K, 3) open places far from each other, the most open one first."""
    clearance = cv2.distanceTransform(np.pad(floor, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    needed = min(_START_CLEARANCE_M / grid.resolution_m, 0.8 * float(clearance.max()))
    _, areas = cv2.connectedComponents((clearance >= needed).astype(np.uint8), connectivity=4)
    middle = np.unravel_index(int(np.argmax(clearance)), clearance.shape)
    cells = np.argwhere(areas == areas[middle])
    chosen = [np.array(middle)]
    while len(chosen) < min(_NUM_STARTS, len(cells)):
        away = np.min([np.hypot(*(cells - cell).T) for cell in chosen], axis=0)
        chosen.append(cells[int(np.argmax(away))])
    points = grid.points_map_from_cells(np.array(chosen, dtype=np.float64) + 0.5)
    return np.column_stack([points, np.zeros(len(points))])
