"""Several hypotheses of the motion between two maps, as a sum of Gaussians: the modified RANSAC of [Blanco13].

J. L. Blanco, J. Gonzalez-Jimenez, J. A. Fernandez-Madrigal: A robust, multi-hypothesis approach to matching occupancy
grid maps, Robotica, 2013. The defaults are the settings that come with its original implementation, MRPT's program
``grid-matching`` (``gridmatch_example.ini``).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from merger.rigid_fit import fit_motion

_Array = npt.NDArray[np.float64]
_Matches = frozenset[tuple[int, int]]

_DRAWS_AT_ONCE = 4096


@dataclass(frozen=True)
class MotionModesConfig:
    """Settings of the hypotheses.

    Raises:
        ValueError: a setting is out of its range.
    """

    keypoints_per_m2: float = 0.012
    """Keypoints of a map, by the area of its known rectangle, > 0 (MRPT's featsPerSquareMeter) ..."""
    min_keypoints: int = 40
    """... but at least as many, the strongest, >= 2."""
    candidate_margin: float = 0.09
    """Candidates are the keypoints whose descriptor is this close to the best one, >= 0 (threshold_delta)."""
    place_noise_m: float = 0.2
    """Standard deviation of a keypoint's place, > 0 (ransac_SOG_sigma_m: two cells of 0.1 m)."""
    quantile: float = 0.5
    """Of the chi-square tests of distances and places, in (0, 1) (ransac_chi2_quantile)."""
    min_inlier_share: float = 0.15
    """A mode needs more inliers than this share of a map's keypoints, in (0, 1] (ransac_minSetSizeRatio)."""
    success_probability: float = 0.9999
    """Probability of a draw without a false match, which sets the number of draws, in (0, 1) (fixed in MRPT)."""
    max_divergence: float = 0.9
    """Modes are merged up to this Kullback-Leibler divergence, >= 0 (maxKLd_for_merge)."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.min_keypoints < 2:
            raise ValueError(f"modes.min_keypoints must be >= 2, got {self.min_keypoints}")
        for name in ("keypoints_per_m2", "place_noise_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"modes.{name} must be > 0, got {getattr(self, name)}")
        for name in ("candidate_margin", "max_divergence"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"modes.{name} must be >= 0, got {getattr(self, name)}")
        for name in ("quantile", "min_inlier_share", "success_probability"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise ValueError(f"modes.{name} must be in (0, 1), got {getattr(self, name)}")


@dataclass(frozen=True)
class MotionMode:
    """One Gaussian of the sum."""

    T_target_source: _Array
    """(3, 3) its mean, metres."""
    covariance: _Array
    """(3, 3) of the mean's (x, y, theta): m^2, m rad, rad^2."""
    weight: float
    """Share of the whole sum, 0..1: how often it was drawn."""
    matches: _Matches
    """Places (target, source) that its mean brings together, each in one pair only; numbers in the order of places."""


def find_modes(
    points_target: _Array,
    points_source: _Array,
    candidates: npt.NDArray[np.intp],
    config: MotionModesConfig,
    rng: np.random.Generator,
) -> list[MotionMode]:
    """Draw pairs of candidates, let each grow into the largest set of keypoints that agree, and keep the large sets.

    A pair that belongs to a set that is known already adds to its weight. The number of draws follows from the
    largest set so far. A keypoint with several orientations is one place.

    Args:
        points_target: (N, 2) keypoints in the target frame, metres.
        points_source: (M, 2) keypoints in the source frame.
        candidates: (K, 2) indices ``(target, source)``, many to many.
        config: Settings.
        rng: Draws the pairs.

    Returns:
        Modes whose weights sum to 1, the heaviest first, not yet merged; none if no set is large enough.
    """
    points_target, of_target = np.unique(points_target, axis=0, return_inverse=True)
    points_source, of_source = np.unique(points_source, axis=0, return_inverse=True)
    places = np.stack([of_target.ravel()[candidates[:, 0]], of_source.ravel()[candidates[:, 1]]], axis=1)
    pairs = _draw_pairs(points_target, points_source, np.unique(places, axis=0), config, rng)
    modes = sorted(_gather(points_target, points_source, pairs, config), key=lambda mode: -mode.weight)
    total = sum(mode.weight for mode in modes)
    return [replace(mode, weight=mode.weight / total) for mode in modes]


def _gather(
    points_target: _Array, points_source: _Array, pairs: Iterator[_Matches], config: MotionModesConfig
) -> list[MotionMode]:
    """The large sets that pairs grow into; their weights are the numbers of pairs."""
    num_places = len(points_target) + len(points_source)
    least = round(config.min_inlier_share * 0.5 * num_places)
    modes: list[MotionMode] = []
    largest, num_wanted = 0, 1
    for count, pair in enumerate(pairs):
        if count >= num_wanted:
            break
        known = next((k for k, mode in enumerate(modes) if pair <= mode.matches), None)
        if known is not None:
            modes[known] = replace(modes[known], weight=modes[known].weight + 1.0)
            continue
        mode = _grow(points_target, points_source, pair, config)
        if len(mode.matches) > least:
            modes.append(mode)
        if len(mode.matches) > largest:
            largest = len(mode.matches)
            share = largest / min(len(points_target), len(points_source))
            num_wanted = max(2 * num_places, _count_draws(share, config.success_probability))
    return modes


def _draw_pairs(
    points_target: _Array,
    points_source: _Array,
    candidates: npt.NDArray[np.intp],
    config: MotionModesConfig,
    rng: np.random.Generator,
) -> Iterator[_Matches]:
    """Pairs of candidates of four keypoints, as far apart in one map as in the other; an end, if there are few."""
    from scipy.stats import chi2  # noqa: PLC0415 # slow to import, and only the method sequential needs it

    limit = chi2.ppf(config.quantile, 1)
    most = 5 * (len(candidates) * (len(candidates) - 1) // 2)  # As in MRPT, so that it ends without a single pair.
    for _ in range(0, most, _DRAWS_AT_ONCE):
        drawn = candidates[rng.integers(len(candidates), size=(_DRAWS_AT_ONCE, 2))]
        drawn = drawn[(drawn[:, 0] != drawn[:, 1]).all(axis=1)]
        squared_target = _squared_length(points_target[drawn[:, 0, 0]] - points_target[drawn[:, 1, 0]])
        squared_source = _squared_length(points_source[drawn[:, 0, 1]] - points_source[drawn[:, 1, 1]])
        variance = 8.0 * config.place_noise_m**2 * (squared_target + squared_source)
        for a, b in drawn[(squared_target - squared_source) ** 2 <= limit * variance].tolist():
            yield frozenset((tuple(a), tuple(b)))


def _grow(points_target: _Array, points_source: _Array, pair: _Matches, config: MotionModesConfig) -> MotionMode:
    """The mode of the largest set of matches that a pair grows into."""
    from scipy.stats import chi2  # noqa: PLC0415 # see _draw_pairs

    from merger.rival.growth_kernel import grow_set  # noqa: PLC0415 # numba is slow to load

    gate = float(chi2.ppf(config.quantile, 2))
    matches = grow_set(points_target, points_source, np.array(sorted(pair)), config.place_noise_m, gate)
    chosen = points_source[matches[:, 1]]
    T = fit_motion(points_target[matches[:, 0]], chosen)
    covariance = _fit_covariance(chosen @ T[:2, :2].T, config.place_noise_m)
    return MotionMode(T, covariance, 1.0, frozenset(map(tuple, matches.tolist())))


def _fit_covariance(turned: _Array, noise_m: float) -> _Array:
    """(3, 3) covariance of (x, y, theta) fitted to (N, 2) source points, turned, whose places are off by this noise."""
    x, y = turned.T
    count, sx, sy = float(len(turned)), float(x.sum()), float(y.sum())
    H = np.array([[count, 0.0, -sy], [0.0, count, sx], [-sy, sx, float((x * x + y * y).sum())]])
    return np.asarray(np.linalg.inv(H) * noise_m**2)


def _count_draws(share: float, probability: float) -> int:
    """Draws until one of two matches is without a false one, with this probability."""
    miss = np.clip(1.0 - min(share, 1.0) ** 2, 1e-12, 1.0 - 1e-12)
    return int(np.log(1.0 - probability) / np.log(miss))


def _squared_length(offset: _Array) -> _Array:
    return np.asarray(np.einsum("ni,ni->n", offset, offset))
