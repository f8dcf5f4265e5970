"""The true map of a building: its surfaces as cells, the floor that robots could stand on as free."""

import math

import cv2
import numpy as np

from merger import se2
from merger.grid_map import LOG_ODDS_FREE, LOG_ODDS_OCCUPIED, GridMap
from sim.buildings.free_space import sample_segments
from sim.buildings.world import World

_BORDER_CELLS = 4
"""Unknown cells around the building."""


def draw_building(world: World, resolution_m: float, name: str = "map_ground_truth") -> GridMap:
    """Draw a world as an occupancy grid in frame ``world``.

    Cells that a surface passes through are occupied; cells connected to a start (8 neighbours are not enough: a ray
    does not pass between two walls that touch at a corner) are free; the rest is unknown.

    Args:
        world: The building.
        resolution_m: Side of a cell, > 0.
        name: Name of the map.
    """
    x_min, y_min, x_max, y_max = world.bounds_m
    origin = np.floor(np.array([x_min, y_min]) / resolution_m) - _BORDER_CELLS
    cols, rows = (math.ceil(v) + 2 * _BORDER_CELLS for v in np.array([x_max - x_min, y_max - y_min]) / resolution_m)
    log_odds = np.zeros((rows + 1, cols + 1), dtype=np.float32)
    points = sample_segments(world.segments, resolution_m / 4.0)
    cells = np.floor(points / resolution_m - origin).astype(np.int64)
    open_floor = np.ones(log_odds.shape, dtype=np.uint8)
    open_floor[cells[:, 1], cells[:, 0]] = 0
    _, labels = cv2.connectedComponents(open_floor, connectivity=4)
    starts = np.floor(world.starts[:, :2] / resolution_m - origin).astype(np.int64)
    reached = np.setdiff1d(labels[starts[:, 1], starts[:, 0]], [0, labels[0, 0]])
    log_odds[np.isin(labels, reached)] = LOG_ODDS_FREE
    log_odds[open_floor == 0] = LOG_ODDS_OCCUPIED
    x_m, y_m = origin * resolution_m
    return GridMap(name, log_odds, resolution_m, se2.make_motion(x_m, y_m, 0.0))
