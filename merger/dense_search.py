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
import scipy.fft

from merger import se2
from merger.peak_kernel import find_peaks
from merger.wall_kernels import FREE
from merger.wall_structure import WallStructure

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
Spectrum = npt.NDArray[np.complex64]

_CORE_QUANTILES = (0.01, 0.99)
"""The walls between these quantiles are searched."""


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
    free_weight: float = 5.0
    """Cost of a wall in free space relative to the gain of a wall on a wall, >= 0."""
    free_width_cells: float = 1.0
    """Free space nearer to a wall than about this counts less: rotations and shifts are tried in steps; > 0."""
    num_peaks: int = 24
    """Hypotheses to return, at least 1."""
    num_peaks_rotation: int = 6
    """Peaks to keep of each rotation, at least 1."""
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
        if min(self.num_peaks, self.num_peaks_rotation) < 1:
            raise ValueError("num_peaks and num_peaks_rotation must be >= 1")

    @property
    def angles_rad(self) -> Array:
        """(R,) rotations that are tried."""
        return np.arange(0.0, 2.0 * np.pi - 1e-9, np.radians(self.step_deg))


@dataclass(frozen=True)
class CoarseMap:
    """A map in coarse cells about its middle, ready to be turned."""

    walls: Image
    """(S, S) share of each cell that is wall."""
    reward: Image
    """(S, S) what a wall in this cell is worth: 1 on a wall, ``-free_weight`` in free space, 0 in the unknown."""
    T_map_center: Array
    """(3, 3) pose of its frame ``center`` in frame ``map``: origin in the middle, axes along the cells."""


@dataclass(frozen=True)
class Peak:
    """One hypothesis of a pair."""

    T_target_source: Array
    """(3, 3) motion between the frames ``map``, metres."""
    score: float
    """Coarse cells of wall that agree, minus the cost of those in free space."""


def coarsen(structure: WallStructure, config: DenseSearchConfig) -> CoarseMap:
    """Reduce a map to the cells of the dense search."""
    walls, resolution_m = structure.walls, structure.fields.resolution_m
    free_rows, free_cols = np.nonzero(structure.fields.state == FREE)
    free = np.asarray((np.stack([free_cols, free_rows], axis=-1) + 0.5) * resolution_m, dtype=np.float64)
    center, radius_m = _circle(walls.points)
    side = 2 * int(np.ceil(radius_m / config.cell_m)) + 3

    def splat(points: Array, weights: Array) -> Image:
        cells = np.floor((points - center) / config.cell_m + 0.5 * side).astype(np.int64)
        inside = ((cells >= 0) & (cells < side)).all(axis=1)
        flat = cells[inside, 1] * side + cells[inside, 0]
        return np.bincount(flat, weights[inside], side * side).reshape(side, side).astype(np.float32)

    filled = np.minimum(splat(walls.points, walls.lengths_m) / np.float32(config.cell_m), np.float32(1.0))
    distance = cv2.distanceTransform((filled == 0.0).astype(np.uint8), cv2.DIST_L2, 5)
    distance = np.minimum(distance, np.float32(10.0))
    likelihood = np.exp(-0.5 * distance**2)
    clearance = np.float32(1.0) - np.exp(-0.5 * (distance / np.float32(config.free_width_cells)) ** 2)
    cell_share = np.full(len(free), (resolution_m / config.cell_m) ** 2)
    space = np.minimum(splat(free, cell_share), np.float32(1.0)) * clearance
    reward = likelihood - np.float32(config.free_weight) * space
    return CoarseMap(
        filled, reward.astype(np.float32), structure.T_map_field @ se2.make_motion(center[0], center[1], 0.0)
    )


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
    source_side = len(source.walls)
    side = scipy.fft.next_fast_len(source_side + max(len(target.walls) for target in targets), real=True)
    spectra = [_spectra(target.walls, target.reward, side) for target in targets]
    found: list[list[tuple[float, int, int, int]]] = [[] for _ in targets]
    for index, angle in enumerate(config.angles_rad):
        walls, reward = _spectra(_rotate(source.walls, float(angle)), _rotate(source.reward, float(angle)), side)
        np.conj(walls, out=walls)
        np.conj(reward, out=reward)
        for peaks, (target_walls, target_reward) in zip(found, spectra, strict=True):
            score = np.asarray(
                scipy.fft.irfft2(walls * target_reward + reward * target_walls, (side, side)), np.float32
            )
            peaks += [(value, index, row, col) for value, row, col in find_peaks(score, config.num_peaks_rotation)]
    return [_separate(peaks, side, target, source, config) for peaks, target in zip(found, targets, strict=True)]


def _spectra(walls: Image, reward: Image, side: int) -> tuple[Spectrum, Spectrum]:
    return scipy.fft.rfft2(walls, (side, side)), scipy.fft.rfft2(reward, (side, side))


def _rotate(image: Image, angle_rad: float) -> Image:
    """Turn an image about its middle, counter-clockwise in the frame x = column, y = row."""
    middle = (len(image) - 1) / 2.0
    matrix = cv2.getRotationMatrix2D((middle, middle), -np.degrees(angle_rad), 1.0)
    return np.asarray(cv2.warpAffine(image, matrix, image.shape[::-1], flags=cv2.INTER_LINEAR), np.float32)


def _separate(
    found: list[tuple[float, int, int, int]], side: int, target: CoarseMap, source: CoarseMap, config: DenseSearchConfig
) -> list[Peak]:
    """Turn peaks into motions, best first, without the weaker of two that are nearly the same."""
    found.sort(key=lambda peak: (-peak[0], peak[1:]))
    target_side = len(target.walls)
    kept: list[Peak] = []
    places = np.zeros((config.num_peaks, 3))
    half = 0.5 * (len(source.walls) - len(target.walls))
    for score, index, row, col in found:
        angle = config.angles_rad[index]
        wrapped = np.array([col - side * (col >= target_side), row - side * (row >= target_side)])
        shift = (wrapped + half) * config.cell_m
        place = np.array([*shift, angle])
        apart = np.abs(se2.wrap_angle(places[: len(kept), 2] - angle)) > np.radians(3.0 * config.step_deg)
        apart |= np.linalg.norm(places[: len(kept), :2] - shift, axis=1) > config.separation_m
        if not apart.all():
            continue
        T_centers = se2.make_motion(shift[0], shift[1], angle)
        T = target.T_map_center @ T_centers @ se2.invert(source.T_map_center)
        places[len(kept)] = place
        kept.append(Peak(T, score))
        if len(kept) == config.num_peaks:
            break
    return kept
