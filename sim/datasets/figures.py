"""Pictures of a dataset: the building with the robots' ways, and the submaps laid over it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import Affine2D

from merger.grid_map import GridMap
from sim.robot_run import Trajectory

_LONGER_SIDE_IN = 8.0
_LEAST_HEIGHT_IN = 2.0
_LEFT_IN, _BOTTOM_IN, _TOP_IN, _LEGEND_IN = 0.7, 0.5, 0.1, 1.3
_DOTS_PER_INCH = 150
_OUTLIERS = 0.001
"""Share of the seen cells that may lie beyond each edge of a picture: a beam through a window."""
_MARGIN_M = 1.0
_FREE_TINT = 0.10
"""Opacity of a submap's free cells."""
_WALL = (0.25, 0.25, 0.25, 1.0)
_FLOOR = (0.96, 0.96, 0.96, 1.0)

Array = npt.NDArray[np.float64]


def draw_world(path: Path, building: GridMap, trajectories: Sequence[Trajectory]) -> None:
    """Draw the true map and each robot's true way, its start marked.

    Args:
        path: The PNG to write.
        building: The true map, in frame ``world``.
        trajectories: Of the robots.
    """
    figure, axes = _begin(building)
    _show(axes, building, np.eye(3), _WALL, _FLOOR)
    handles = []
    for trajectory, color in zip(trajectories, _colors(len(trajectories)), strict=True):
        x, y = trajectory.T_world_robot[:, 0, 2], trajectory.T_world_robot[:, 1, 2]
        axes.plot(x, y, color=color, linewidth=1.0, alpha=0.9)
        axes.plot(x[:1], y[:1], marker="o", markersize=5, color=color, markeredgecolor="black")
        handles.append(Line2D([], [], color=color, label=trajectory.robot))
    _finish(figure, axes, path, handles)


def draw_overview(path: Path, building: GridMap, maps: Sequence[GridMap], T_world_map: Array) -> None:
    """Draw every submap in a colour of its own at its true place, over the true map in grey.

    Args:
        path: The PNG to write.
        building: The true map, in frame ``world``.
        maps: The N submaps.
        T_world_map: (N, 3, 3) their true places.
    """
    figure, axes = _begin(building)
    _show(axes, building, np.eye(3), (0.75, 0.75, 0.75, 1.0), (1.0, 1.0, 1.0, 0.0))
    colors = _colors(len(maps))
    for grid, T, color in zip(maps, T_world_map, colors, strict=True):
        _show(axes, grid, T, (*color, 0.9), (*color, _FREE_TINT))
    handles = [
        Line2D([], [], color=color, marker="s", linestyle="", label=grid.name)
        for grid, color in zip(maps, colors, strict=True)
    ]
    _finish(figure, axes, path, handles)


def _begin(building: GridMap) -> tuple[Figure, Axes]:
    """A figure whose axes show the seen part of the building in metres."""
    points = building.cell_centers(building.occupied | building.free)
    points = points if len(points) else np.zeros((1, 2))
    low = np.quantile(points, _OUTLIERS, axis=0) - _MARGIN_M
    high = np.quantile(points, 1.0 - _OUTLIERS, axis=0) + _MARGIN_M
    width, height = (high - low) * (_LONGER_SIDE_IN / (high - low).max())
    full_width, full_height = width + _LEFT_IN + _LEGEND_IN, max(height, _LEAST_HEIGHT_IN) + _BOTTOM_IN + _TOP_IN
    figure = Figure(figsize=(full_width, full_height), dpi=_DOTS_PER_INCH)
    FigureCanvasAgg(figure)
    axes = figure.add_axes(
        (_LEFT_IN / full_width, _BOTTOM_IN / full_height, width / full_width, height / full_height), anchor="NW"
    )
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel("x / m")
    axes.set_ylabel("y / m")
    return figure, axes


def _show(axes: Axes, grid: GridMap, T_world_map: Array, occupied: tuple[float, ...], free: tuple[float, ...]) -> None:
    """Lay a grid's cells over the axes at its place."""
    pixels = np.zeros((*grid.log_odds.shape, 4), dtype=np.uint8)
    pixels[grid.free] = np.rint(np.array(free) * 255.0)
    pixels[grid.occupied] = np.rint(np.array(occupied) * 255.0)
    rows, cols = grid.log_odds.shape
    extent = (0.0, cols * grid.resolution_m, 0.0, rows * grid.resolution_m)
    limits = axes.get_xlim(), axes.get_ylim()
    image = axes.imshow(pixels, origin="lower", extent=extent, interpolation="antialiased", resample=True)
    image.set_transform(Affine2D(T_world_map @ grid.T_map_grid) + axes.transData)
    axes.set_xlim(limits[0])
    axes.set_ylim(limits[1])


def _finish(figure: Figure, axes: Axes, path: Path, handles: list[Line2D]) -> None:
    columns = 1 + (len(handles) - 1) // 24
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.01), frameon=False, ncols=columns, fontsize=8)
    figure.savefig(path, metadata={"Software": "mapmerge-bench"})


def _colors(count: int) -> list[tuple[float, float, float]]:
    """Colours that differ as much as so many can."""
    if count <= 20:
        table = colormaps["tab10" if count <= 10 else "tab20"](np.arange(count))
    else:
        table = colormaps["nipy_spectral"](np.linspace(0.05, 0.95, count))
    return [(float(r), float(g), float(b)) for r, g, b, _ in table]
