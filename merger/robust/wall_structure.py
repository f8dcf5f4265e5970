"""What the robust method compares of a map: its walls as weighted points, and fields that answer look-ups in O(1).

Frame ``field``: the grid's axes, origin in the lower-left corner of the padded grid; all coordinates are >= 0.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap
from merger.robust.wall_kernels import FREE, OCCUPIED, UNKNOWN, Fields, View, Walls
from merger.robust.wall_surroundings import Surroundings, describe_surroundings

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class WallStructureConfig:
    """How walls are described.

    Raises:
        ValueError: a setting is out of its range.
    """

    spacing_m: float = 0.05
    """Wall points closer than this are joined into one, > 0; coarser maps keep one point a cell."""
    metre_m: float = 0.1
    """Side of the squares in which wall length is counted, >= ``spacing_m``: a wall through a square counts once."""
    normal_radius_m: float = 0.25
    """Half side of the window that gives a wall point its direction, > 0."""
    support_m: float = 0.25
    """Wall cells with less wall about them count less, metres, > 0: people and stray hits say little."""
    free_spacing_m: float = 0.2
    """Spacing of the samples of free space, metres, > 0."""
    padding_m: float = 1.0
    """Border around the grid in which distances to walls are still known, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("spacing_m", "normal_radius_m", "support_m", "free_spacing_m", "padding_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0 m, got {getattr(self, name)}")
        if self.metre_m < self.spacing_m:
            raise ValueError(f"metre_m must be >= spacing_m = {self.spacing_m}, got {self.metre_m}")


@dataclass(frozen=True)
class WallStructure:
    """The walls and the free space of one map, made for look-ups."""

    name: str
    """Name of the map."""
    walls: Walls
    """Its wall points."""
    fields: Fields
    """Its look-up fields."""
    free_points: Array
    """(F, 2) samples of the free space, metres, frame ``field``."""
    free_point_m2: float
    """Area that each of them stands for."""
    T_map_field: Array
    """(3, 3) pose of frame ``field`` in the map's frame."""

    @cached_property
    def length_m(self) -> float:
        """Metres of wall."""
        return float(self.walls.lengths_m.sum())

    @cached_property
    def wall_per_floor(self) -> float:
        """Metres of wall for each square metre of free area, as if there were half a metre and half a square more."""
        return (self.length_m + 0.5) / (len(self.free_points) * self.free_point_m2 + 0.5)

    @cached_property
    def center_m(self) -> Array:
        """(2,) middle of the wall points' bounding box, frame ``field``; the origin without walls."""
        points = self.walls.points
        return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0))) if len(points) else np.zeros(2)

    @cached_property
    def center_map(self) -> Array:
        """(2,) the same in frame ``map``."""
        return np.asarray(se2.transform_points(self.T_map_field, self.center_m[None])[0])

    @cached_property
    def T_field_map(self) -> Array:
        """(3, 3) inverse of ``T_map_field``."""
        return se2.invert(self.T_map_field)

    def sample(self, count: int | None) -> Walls:
        """About ``count`` of the wall points, taken evenly, whose lengths have the same sum; None: all."""
        step = max(1, round(len(self.walls.points) / count)) if count else 1
        if step not in self._samples:
            thinned = Walls(self.walls.table[::step].copy())
            thinned.lengths_m[:] *= step
            self._samples[step] = thinned
        return self._samples[step]

    def view(self, count: int | None) -> View:
        """The map as a partner of others, of which about ``count`` wall points are compared; None: all."""
        return View(self.sample(count), self.walls, self.fields)

    @cached_property
    def _samples(self) -> dict[int, Walls]:
        """Samples that were asked for before, by their step."""
        return {}


def extract_structure(grid: GridMap, config: WallStructureConfig) -> WallStructure:
    """Describe a map's walls and free space.

    Args:
        grid: The map, of any resolution.
        config: The settings.

    Returns:
        The structure; it has no points if the map has no occupied cell.
    """
    pad = int(np.ceil(config.padding_m / grid.resolution_m))
    state = np.full(grid.log_odds.shape, UNKNOWN, dtype=np.uint8)
    state[grid.free] = FREE
    state[grid.occupied] = OCCUPIED
    state = np.pad(state, pad)
    occupied = state == OCCUPIED
    surface = occupied & (cv2.erode(occupied.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0)
    rows, cols = np.nonzero(surface)
    cells = np.asarray((np.stack([cols, rows], axis=-1) + 0.5) * grid.resolution_m, dtype=np.float64)
    about = describe_surroundings(surface, state == FREE, (rows, cols), config.normal_radius_m / grid.resolution_m)
    group = _groups(cells, config.spacing_m)
    support = np.clip((about.num_cells - 1.0) * grid.resolution_m / config.support_m, 0.0, 1.0)
    points, normals, linearity, facing = _join(cells, about, group)
    distance_m, nearest = _nearest_fields(surface, rows, cols, group, grid.resolution_m)
    lengths_m = _lengths(points, max(config.metre_m, grid.resolution_m)) * _group_max(support, group)
    walls = Walls(np.column_stack([points, normals, facing, linearity, lengths_m]))
    fields = Fields(distance_m, nearest, state, grid.resolution_m)
    free_points, free_point_m2 = _sample_free(state, grid.resolution_m, config.free_spacing_m)
    T_grid_field = se2.make_motion(-pad * grid.resolution_m, -pad * grid.resolution_m, 0.0)
    return WallStructure(grid.name, walls, fields, free_points, free_point_m2, grid.T_map_grid @ T_grid_field)


def _group_max(values: Array, group: npt.NDArray[np.int64]) -> Array:
    """The largest value of each group."""
    largest = np.zeros(int(group.max(initial=-1)) + 1)
    np.maximum.at(largest, group, values)
    return largest


def _groups(points: Array, side_m: float) -> npt.NDArray[np.int64]:
    """Number of the square of a given side that holds each point, 0..G-1."""
    squares: npt.NDArray[np.int64] = np.floor(points / side_m + 1e-6).astype(np.int64)
    _, group = np.unique(squares[:, 0] * (1 << 32) + squares[:, 1], return_inverse=True)
    return np.asarray(group, dtype=np.int64)


def _join(cells: Array, about: Surroundings, group: npt.NDArray[np.int64]) -> tuple[Array, Array, Array, Array]:
    """One point a group: its mean place and facing, and the direction of its most line-like cell."""
    count = np.bincount(group)
    points, faces = (
        np.stack([np.bincount(group, values[:, k]) / count for k in range(2)], axis=-1)
        for values in (cells, about.facing)
    )
    best = np.lexsort((about.linearity, group))[np.cumsum(count) - 1]
    return points, about.normals[best], about.linearity[best], faces


def _lengths(points: Array, side_m: float) -> Array:
    """Metres of wall that each point stands for: a square's side, shared by the points in it."""
    group = _groups(points, side_m)
    return side_m / np.bincount(group)[group] if len(points) else np.zeros(0)


def _nearest_fields(
    surface: npt.NDArray[np.bool_],
    rows: npt.NDArray[np.int64],
    cols: npt.NDArray[np.int64],
    group: npt.NDArray[np.int64],
    resolution_m: float,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """Distance to the nearest wall, and its point's index, for every cell."""
    if len(rows) == 0:
        return np.full(surface.shape, np.inf, np.float32), np.zeros(surface.shape, np.int32)
    free_of_walls = (~surface).astype(np.uint8)
    distance, labels = cv2.distanceTransformWithLabels(free_of_walls, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    point_of_label = np.zeros(int(labels.max()) + 1, dtype=np.int32)
    point_of_label[labels[rows, cols]] = group
    distance *= np.float32(resolution_m)
    for edge in (distance[0], distance[-1], distance[:, 0], distance[:, -1]):
        edge[:] = np.inf  # they answer for all places outside
    return np.asarray(distance, np.float32), point_of_label.take(np.asarray(labels, np.int32))


def _sample_free(state: npt.NDArray[np.uint8], resolution_m: float, spacing_m: float) -> tuple[Array, float]:
    """Free places on a square lattice, and the area that each stands for, square metres."""
    step = max(1, round(spacing_m / resolution_m))
    first = step // 2
    rows, cols = np.nonzero(state[first::step, first::step] == FREE)
    cells = np.stack([cols, rows], axis=-1) * float(step) + (first + 0.5)
    return np.asarray(cells * resolution_m, dtype=np.float64), (step * resolution_m) ** 2
