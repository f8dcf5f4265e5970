"""A map in the coarse cells of the dense search: where its walls are, and what a wall of another map is worth there."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.correlation import Image
from merger.robust.wall_directions import describe_directions
from merger.robust.wall_kernels import FREE
from merger.robust.wall_structure import WallStructure

Array = npt.NDArray[np.float64]

_CORE_QUANTILES = (0.01, 0.99)
"""The walls between these quantiles are searched."""


@dataclass(frozen=True)
class CoarseMapConfig:
    """Settings of the coarse cells.

    Raises:
        ValueError: a setting is out of its range.
    """

    cell_m: float = 0.4
    """Step of the shifts and width of the likelihood, metres, > 0."""
    free_weight: float = 4.0
    """Cost of a wall in free space relative to the gain of a wall on a wall, >= 0."""
    free_width_cells: float = 1.0
    """Free space nearer to a wall than about this counts less: rotations and shifts are tried in steps; > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("cell_m", "free_width_cells"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        if not self.free_weight >= 0.0:
            raise ValueError(f"free_weight must be >= 0, got {self.free_weight}")


@dataclass(frozen=True)
class CoarseMap:
    """A map in coarse cells about its middle, ready to be turned."""

    walls: Image
    """(S, S) share of each cell that is wall."""
    reward: Image
    """(S, S) what a wall in this cell is worth: 1 on a wall, ``-free_weight`` in free space, 0 in the unknown."""
    directions: npt.NDArray[np.complex128]
    """(17,) Fourier coefficients of the wall length by direction, folded to a quarter turn."""
    T_map_center: Array
    """(3, 3) pose of its frame ``center`` in frame ``map``: origin in the middle, axes along the cells."""


def coarsen(structure: WallStructure, config: CoarseMapConfig) -> CoarseMap:
    """Reduce a map to the cells of the dense search."""
    walls = structure.walls
    center, radius_m = _circle(walls.points)
    side = 2 * int(np.ceil(radius_m / config.cell_m)) + 3
    cells = np.floor((walls.points - center) / config.cell_m + 0.5 * side).astype(np.int64)
    inside = ((cells >= 0) & (cells < side)).all(axis=1)
    flat = cells[inside, 1] * side + cells[inside, 0]
    filled = np.bincount(flat, walls.lengths_m[inside], side * side).reshape(side, side).astype(np.float32)
    filled = np.minimum(filled / np.float32(config.cell_m), np.float32(1.0))
    distance = cv2.distanceTransform((filled == 0.0).astype(np.uint8), cv2.DIST_L2, 5)
    distance = np.minimum(distance, np.float32(10.0))
    likelihood = np.exp(-0.5 * distance**2)
    clearance = np.float32(1.0) - np.exp(-0.5 * (distance / np.float32(config.free_width_cells)) ** 2)
    space = _free_share(structure, center, side, config.cell_m) * clearance
    reward = likelihood - np.float32(config.free_weight) * space
    T_map_center = structure.T_map_field @ se2.make_motion(center[0], center[1], 0.0)
    return CoarseMap(filled, reward.astype(np.float32), describe_directions(walls), T_map_center)


def _free_share(structure: WallStructure, center: Array, side: int, cell_m: float) -> Image:
    """(S, S) share of each coarse cell that is free."""
    state, resolution_m = structure.fields.state, structure.fields.resolution_m
    count = (state == FREE).astype(np.float32)
    for axis in (0, 1):  # a coarse cell is a run of rows, and of columns
        middles_m = (np.arange(state.shape[axis]) + 0.5) * resolution_m
        number = np.floor((middles_m - center[1 - axis]) / cell_m + 0.5 * side)
        count = _sum_runs(count.T, np.searchsorted(number, np.arange(side + 1)))
    return np.asarray(np.minimum(count * np.float32((resolution_m / cell_m) ** 2), np.float32(1.0)), np.float32)


def _sum_runs(values: Image, starts: npt.NDArray[np.intp]) -> Image:
    """(N, K) sums over the K runs of columns that begin at (K + 1,) rising places, each up to the next one."""
    ended = np.pad(values, ((0, 0), (0, 1)))
    sums = np.add.reduceat(ended, starts, axis=1)[:, :-1]
    sums[:, np.diff(starts) == 0] = 0.0  # reduceat answers for an empty run with its first element
    return np.asarray(sums, np.float32)


def _circle(points: Array) -> tuple[Array, float]:
    """A centre and a radius, metres, that hold all walls but the few farthest: stray far hits would cost much time."""
    if len(points) == 0:
        return np.zeros(2), 0.0
    low, high = np.quantile(points, _CORE_QUANTILES, axis=0)
    center = 0.5 * (low + high)
    return center, float(np.quantile(np.hypot(*(points - center).T), _CORE_QUANTILES[1]))
