"""Dense search: every rotation and every shift of one map over another, by correlation (FFT).

The score of a motion is taken in both directions: how well the source's walls fall on the target's walls (their
likelihood) minus how much they fall into its free space, plus the same for the target's walls in the source. Because
free space counts, a corridor laid over a room scores low although its walls find partners.

Source: correlative scan matching [Olson 2009], with the free space of grid maps, in Fourier space.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.coarse_map import CoarseMap, CoarseMapConfig
from merger.robust.correlation import Image, Spectrum, correlate, find_spectrum, half_turn, turn_image
from merger.robust.peak_kernel import find_peaks, least_worth, separate_peaks
from merger.robust.wall_directions import are_parallel

Array = npt.NDArray[np.float64]

_NOTHING = 1e-3
"""Rewards smaller than this are none."""


@dataclass(frozen=True)
class DenseSearchConfig(CoarseMapConfig):
    """Settings of the dense search, those of its cells included.

    Raises:
        ValueError: a setting is out of its range.
    """

    step_deg: float = 4.0
    """Step of the rotations, degrees, in (0, 90]."""
    min_parallel: float = 0.55
    """Rotations that lay fewer walls parallel or square, relative to the best one, are not tried, in [0, 1]; 0: all
    are. Of 1,654 pairs that overlap, the better of the two steps next to the true rotation had 0.83 or more."""
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
        super().__post_init__()
        if not self.separation_m > 0.0:
            raise ValueError(f"separation_m must be > 0 m, got {self.separation_m}")
        if not 0.0 < self.step_deg <= 90.0:
            raise ValueError(f"step_deg must be in (0, 90], got {self.step_deg}")
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
    tried = np.stack(
        [are_parallel(item.directions, source.directions, angles, config.min_parallel) for item in targets]
    )
    for number in np.flatnonzero(tried.any(axis=0)):
        for angle_rad, *turned in _turn(source, float(angles[number]), flip, shape):
            for k in np.flatnonzero(tried[:, number]):
                scores = correlate((turned[0], turned[1]), spectra[k], shape)
                value, row, col = find_peaks(scores, config.num_peaks_rotation, float(least[k]))
                found[k].append(np.stack([value, np.full(len(row), angle_rad), row, col], axis=-1))
                least[k] = max(least[k], least_worth(value, config.min_share))
    return [
        _choose(np.concatenate(peaks), target, crop, source, config)
        for peaks, target, crop in zip(found, targets, crops, strict=True)
    ]


def _turn(
    source: CoarseMap, angle_rad: float, flip: Spectrum, shape: tuple[int, ...]
) -> Iterator[tuple[float, Spectrum, Spectrum]]:
    """A rotation with the spectra of the walls and the reward turned by it, and the opposite rotation with its own."""
    walls, reward = (find_spectrum(turn_image(image, angle_rad), shape) for image in (source.walls, source.reward))
    # The spectrum of an image turned by half a turn is the conjugate one, but for a shift.
    yield angle_rad, np.conj(walls) * flip, np.conj(reward) * flip
    yield angle_rad + np.pi, walls, reward


def _crop(target: CoarseMap) -> _Crop:
    """The part of a map that has walls, or free space: the rest only costs time."""
    used = (target.walls > 0.0) | (np.abs(target.reward) > _NOTHING)
    rows, cols = np.flatnonzero(used.any(axis=1)), np.flatnonzero(used.any(axis=0))
    if len(rows) == 0:
        return _Crop(target.walls, target.reward, 0, 0)
    part = (slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1))
    return _Crop(target.walls[part], target.reward[part], int(rows[0]), int(cols[0]))


def _choose(found: Array, target: CoarseMap, crop: _Crop, source: CoarseMap, config: DenseSearchConfig) -> list[Peak]:
    """Turn (P, 4) peaks, value, angle, row and column, into motions: those that are apart, and not hopeless."""
    found = found[found[:, 0] >= least_worth(found[:, 0], config.min_share)]
    found = found[np.lexsort((*found.T[:0:-1], -found[:, 0]))]
    middle = 0.5 * (len(source.walls) + len(target.walls)) - 1.0
    shift = (found[:, [3, 2]] + [crop.first_col, crop.first_row] - middle) * config.cell_m
    apart = config.separation_m, np.radians(3.0 * config.step_deg)
    chosen = separate_peaks(shift, found[:, 1], apart, config.num_peaks)
    T_centers = se2.make_motion(shift[chosen, 0], shift[chosen, 1], found[chosen, 1])
    T = target.T_map_center @ T_centers @ se2.invert(source.T_map_center)
    return [Peak(motion, float(score)) for motion, score in zip(T, found[chosen, 0], strict=True)]
