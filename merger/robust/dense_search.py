"""Dense search: every rotation and every shift of one map over another, by correlation (FFT).

The score of a motion is taken in both directions: how well the source's walls fall on the target's walls (their
likelihood) minus how much they fall into its free space, plus the same for the target's walls in the source. Because
free space counts, a corridor laid over a room scores low although its walls find partners.

Source: correlative scan matching [Olson 2009], with the free space of grid maps, in Fourier space.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.correlation import Image, correlate, find_spectrum, half_turn, turn_image
from merger.robust.peak_kernel import find_peaks
from merger.robust.wall_directions import are_parallel, describe_directions
from merger.robust.wall_kernels import FREE
from merger.robust.wall_structure import WallStructure

Array = npt.NDArray[np.float64]

_CORE_QUANTILES = (0.01, 0.99)
"""The walls between these quantiles are searched."""
_NOTHING = 1e-3
"""Rewards smaller than this are none."""


@dataclass(frozen=True)
class DenseSearchConfig:
    """Settings of the dense search.

    Raises:
        ValueError: a setting is out of its range.
    """

    cell_m: float = 0.4
    """Step of the shifts and width of the likelihood, metres, > 0."""
    step_deg: float = 4.0
    """Step of the rotations, degrees, in (0, 90]."""
    free_weight: float = 4.0
    """Cost of a wall in free space relative to the gain of a wall on a wall, >= 0."""
    free_width_cells: float = 1.0
    """Free space nearer to a wall than about this counts less: rotations and shifts are tried in steps; > 0."""
    min_parallel: float = 0.5
    """Rotations that lay fewer walls parallel or square, relative to the best one, are not tried, in [0, 1]; 0: all
    are."""
    num_peaks: int = 36
    """Hypotheses to return, at least 1."""
    num_peaks_rotation: int = 8
    """Peaks to keep of each rotation, at least 1."""
    min_share: float = 0.3
    """Peaks whose score is below this share of the best one's are hopeless, in [0, 1]. Of the true motions of maps that
    overlap by 0.1 or more, the worst had 0.44."""
    separation_m: float = 1.0
    """Two hypotheses nearer than this, and than three rotation steps, are one, metres, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("cell_m", "free_width_cells", "separation_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0 m, got {getattr(self, name)}")
        if not 0.0 < self.step_deg <= 90.0:
            raise ValueError(f"step_deg must be in (0, 90], got {self.step_deg}")
        if not self.free_weight >= 0.0:
            raise ValueError(f"free_weight must be >= 0, got {self.free_weight}")
        for name in ("min_parallel", "min_share"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be in [0, 1], got {getattr(self, name)}")
        if min(self.num_peaks, self.num_peaks_rotation) < 1:
            raise ValueError("num_peaks and num_peaks_rotation must be >= 1")

    @property
    def angles_rad(self) -> Array:
        """(R,) rotations that are tried: those of the first half turn, then the same turned by half a turn."""
        half = np.arange(0.0, np.pi - 1e-9, np.radians(self.step_deg))
        return np.concatenate([half, half + np.pi])


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


@dataclass(frozen=True)
class _Crop:
    """The part of a target that is worth its time."""

    walls: Image
    reward: Image
    first_row: int
    first_col: int


@dataclass(frozen=True)
class Peak:
    """One hypothesis of a pair."""

    T_target_source: Array
    """(3, 3) motion between the frames ``map``, metres."""
    score: float
    """Coarse cells of wall that agree, minus the cost of those in free space."""


def coarsen(structure: WallStructure, config: DenseSearchConfig) -> CoarseMap:
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


def search_motions(targets: Sequence[CoarseMap], source: CoarseMap, config: DenseSearchConfig) -> list[list[Peak]]:
    """Find the motions under which a map agrees best with each of several others.

    Args:
        targets: The maps that stay, at least one.
        source: The map that moves.
        config: The settings; the same as those of `coarsen`.

    Returns:
        For each target at most ``num_peaks`` hypotheses, best first, apart from each other.
    """
    last = len(source.walls) - 1
    crops = [_crop(target) for target in targets]
    shape = tuple(cv2.getOptimalDFTSize(last + max(side)) for side in zip(*(c.walls.shape for c in crops), strict=True))
    spectra = [(find_spectrum(crop.walls, shape), find_spectrum(crop.reward, shape)) for crop in crops]
    flip = half_turn(last, shape)
    found: list[list[Array]] = [[] for _ in targets]
    least = np.full(len(targets), -np.inf)
    angles = config.angles_rad[: len(config.angles_rad) // 2]
    tried = np.array(
        [are_parallel(target.directions, source.directions, angles, config.min_parallel) for target in targets]
    )
    for angle, by in zip(angles, tried.T, strict=True):
        if not by.any():
            continue
        walls, reward = (
            find_spectrum(turn_image(image, float(angle)), shape) for image in (source.walls, source.reward)
        )
        # The spectrum of an image turned by half a turn is the conjugate one, but for a shift.
        turned = ((angle, np.conj(walls) * flip, np.conj(reward) * flip), (angle + np.pi, walls, reward))
        for angle_rad, w, r in turned:
            for number in np.flatnonzero(by):
                scores = correlate((w, r), spectra[number], shape)
                value, row, col = find_peaks(scores, config.num_peaks_rotation, float(least[number]))
                found[number].append(np.stack([value, np.full(len(row), angle_rad), row, col], axis=-1))
                least[number] = max(least[number], _least_worth(found[number][-1], config))
    return [
        _separate(np.concatenate(peaks), target, crop, source, config)
        for peaks, target, crop in zip(found, targets, crops, strict=True)
    ]


def _least_worth(found: Array, config: DenseSearchConfig) -> float:
    """The score below which other peaks are hopeless beside these (P, 4), value first."""
    best = float(found[:, 0].max(initial=-np.inf))
    return config.min_share * best if best > 0.0 else -np.inf


def _crop(target: CoarseMap) -> _Crop:
    """The part of a map that has walls, or free space: the rest only costs time."""
    used = (target.walls > 0.0) | (np.abs(target.reward) > _NOTHING)
    rows, cols = np.flatnonzero(used.any(axis=1)), np.flatnonzero(used.any(axis=0))
    if len(rows) == 0:
        return _Crop(target.walls, target.reward, 0, 0)
    part = (slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1))
    return _Crop(target.walls[part], target.reward[part], int(rows[0]), int(cols[0]))


def _separate(found: Array, target: CoarseMap, crop: _Crop, source: CoarseMap, config: DenseSearchConfig) -> list[Peak]:
    """Turn (P, 4) peaks, value, angle, row and column, into motions, without the weaker of two nearly the same."""
    found = found[found[:, 0] >= _least_worth(found, config)]
    found = found[np.lexsort((*found.T[:0:-1], -found[:, 0]))]
    angle = found[:, 1]
    middle = 0.5 * (len(source.walls) + len(target.walls)) - 1.0
    shift = (found[:, [3, 2]] + [crop.first_col, crop.first_row] - middle) * config.cell_m
    kept: list[int] = []
    left = np.ones(len(found), dtype=np.bool_)
    while left.any() and len(kept) < config.num_peaks:
        best = int(left.argmax())
        kept.append(best)
        apart = np.abs(se2.wrap_angle(angle - angle[best])) > np.radians(3.0 * config.step_deg)
        left &= apart | (np.hypot(*(shift - shift[best]).T) > config.separation_m)
    T_centers = se2.make_motion(shift[kept, 0], shift[kept, 1], angle[kept])
    T = target.T_map_center @ T_centers @ se2.invert(source.T_map_center)
    return [Peak(motion, float(score)) for motion, score in zip(T, found[kept, 0], strict=True)]
