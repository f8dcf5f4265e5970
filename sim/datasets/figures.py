"""Pictures of a dataset: the building with the robots' ways, and the submaps laid over it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from merger.grid_map import GridMap
from sim.datasets.canvas import Canvas, draw_way, finish_page, lay_cells, make_canvas, make_colours
from sim.robot_run import Trajectory

_INK, _GREY = (0.0, 0.0, 0.0), (190.0, 190.0, 190.0)
_WALL, _FLOOR = 0.75, 0.04
"""Opacity of the building's cells, in black."""
_OCCUPIED, _FREE = 0.9, 0.1
"""Opacity of a submap's cells."""


def draw_world(path: Path, building: GridMap, trajectories: Sequence[Trajectory]) -> None:
    """Draw the true map and each robot's true way, its start marked.

    Args:
        path: The PNG to write.
        building: The true map, in frame ``world``.
        trajectories: Of the robots.
    """
    canvas = make_canvas(building)
    lay_cells(canvas, building, np.eye(3), _INK, (_WALL, _FLOOR))
    image, colours = _to_image(canvas), make_colours(len(trajectories))
    for trajectory, colour in zip(trajectories, colours, strict=True):
        draw_way(image, canvas, trajectory.T_world_robot[:, :2, 2], colour)
    names = [trajectory.robot for trajectory in trajectories]
    path.write_bytes(finish_page(canvas, image, list(zip(names, colours, strict=True))))


def draw_overview(path: Path, building: GridMap, maps: Sequence[GridMap], T_world_map: npt.NDArray[np.float64]) -> None:
    """Draw every submap in a colour of its own at its true place, over the true map in grey.

    Args:
        path: The PNG to write.
        building: The true map, in frame ``world``.
        maps: The N submaps.
        T_world_map: (N, 3, 3) their true places.
    """
    canvas, colours = make_canvas(building), make_colours(len(maps))
    lay_cells(canvas, building, np.eye(3), _GREY, (1.0, 0.0))
    for grid, T, colour in zip(maps, T_world_map, colours, strict=True):
        lay_cells(canvas, grid, T, colour, (_OCCUPIED, _FREE))
    names = [grid.name for grid in maps]
    path.write_bytes(finish_page(canvas, _to_image(canvas), list(zip(names, colours, strict=True))))


def _to_image(canvas: Canvas) -> npt.NDArray[np.uint8]:
    return np.ascontiguousarray(np.moveaxis(np.rint(canvas.pixels).astype(np.uint8), 0, -1))
