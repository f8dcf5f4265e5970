"""Several hypotheses of the motion between two maps, as a sum of Gaussians [Blanco13]."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.rigid_fit import fit_motion

_Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MotionModesConfig:
    """Settings of the hypotheses.

    Raises:
        ValueError: a setting is out of its range.
    """

    num_candidates: int = 3
    """Each keypoint is matched with as many of the other map's, many to many, >= 1."""
    num_draws: int = 20_000
    """Pairs of candidates drawn, >= 1."""
    num_guesses: int = 200
    """Of those pairs that keep their distance at most as many are tested, >= 1."""
    min_baseline_m: float = 1.0
    """The two places of a pair are at least this far apart, > 0."""
    match_distance_m: float = 0.25
    """A candidate supports a guess that brings it this close, > 0."""
    min_support: int = 6
    """A mode with less support, in keypoints, is dropped, >= 3."""
    max_modes: int = 8
    """The heaviest modes are kept, >= 1."""
    merge_distance_m: float = 0.5
    """Modes nearer than this in the middle of the source are one, > 0."""
    merge_angle_rad: float = 0.1
    """Modes whose angles differ by less are one, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        limits = {"num_candidates": 1, "num_draws": 1, "num_guesses": 1, "min_support": 3, "max_modes": 1}
        for name, least in limits.items():
            if getattr(self, name) < least:
                raise ValueError(f"modes.{name} must be >= {least}, got {getattr(self, name)}")
        for name in ("min_baseline_m", "match_distance_m", "merge_distance_m", "merge_angle_rad"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"modes.{name} must be > 0, got {getattr(self, name)}")


@dataclass(frozen=True)
class MotionMode:
    """One Gaussian of the sum."""

    T_target_source: _Array
    """(3, 3) its mean: the best supported guess of the mode."""
    covariance: _Array
    """(3, 3) spread of the mode's guesses, of v in ``T_target_source @ exp(v)``."""
    weight: float
    """Share of the whole sum, 0..1."""
    support: int
    """Source keypoints that its mean brings onto one of their candidates."""


def find_modes(
    points_target: _Array,
    points_source: _Array,
    matches: npt.NDArray[np.intp],
    config: MotionModesConfig,
    rng: np.random.Generator,
) -> list[MotionMode]:
    """Guess motions from pairs of candidates and gather them into modes, the heaviest first.

    Args:
        points_target: (N, 2) keypoints in the target frame, metres.
        points_source: (M, 2) keypoints in the source frame.
        matches: (K, 2) candidates ``(target, source)``, many to many.
        config: Settings.
        rng: Draws the pairs.

    Returns:
        At most ``max_modes`` modes whose weights sum to 1; none if nothing is supported enough.
    """
    matches = matches[np.argsort(matches[:, 1], kind="stable")]
    target, source = points_target[matches[:, 0]], points_source[matches[:, 1]]
    guesses = _guess(target, source, config, rng)
    support = count_support(guesses, target, source, matches[:, 1], config.match_distance_m)
    order = np.argsort(-support, kind="stable")
    order = order[support[order] >= config.min_support]
    guesses, support = guesses[order], support[order]
    modes: list[MotionMode] = []
    while len(guesses) and len(modes) < config.max_modes:
        near = agree(guesses, guesses[0], source.mean(axis=0), config)
        offsets = se2.log(se2.invert(guesses[0]) @ guesses[near])
        covariance = (offsets * support[near, None]).T @ offsets / support[near].sum()
        modes.append(MotionMode(guesses[0], covariance, float(support[near].sum()), int(support[0])))
        guesses, support = guesses[~near], support[~near]
    total = sum(mode.weight for mode in modes)
    modes.sort(key=lambda mode: -mode.weight)
    return [replace(mode, weight=mode.weight / total) for mode in modes]


def count_support(
    guesses: _Array, target: _Array, source: _Array, source_index: npt.NDArray[np.intp], match_distance_m: float
) -> npt.NDArray[np.intp]:
    """Count (G,) source keypoints that (G, 3, 3) guesses bring onto one of their candidates.

    Args:
        guesses: Motions ``T_target_source``.
        target: (K, 2) target places of the candidates.
        source: (K, 2) source places of the candidates.
        source_index: (K,) the source keypoint of each, ascending.
        match_distance_m: How close is close.
    """
    if len(guesses) == 0 or len(source_index) == 0:
        return np.zeros(len(guesses), dtype=np.intp)
    starts = np.flatnonzero(np.diff(source_index, prepend=-1))
    counts = np.zeros(len(guesses), dtype=np.intp)
    chunk = max(1, 1_000_000 // len(source))
    for first in range(0, len(guesses), chunk):
        offsets = se2.transform_points(guesses[first : first + chunk], source) - target
        close = np.einsum("gki,gki->gk", offsets, offsets) <= match_distance_m**2
        counts[first : first + chunk] = np.logical_or.reduceat(close, starts, axis=1).sum(axis=1)
    return counts


def agree(
    T_target_source: _Array, T_other: _Array, center_source: _Array, config: MotionModesConfig
) -> npt.NDArray[np.bool_]:
    """Which (G, 3, 3) motions are one mode with another motion: near it in the middle of the source, and in angle."""
    center = center_source[None]
    shift = se2.transform_points(T_target_source, center) - se2.transform_points(T_other, center)
    turn = np.abs(se2.wrap_angle(se2.angle_of(T_target_source) - se2.angle_of(T_other)))
    near = np.hypot(shift[..., 0, 0], shift[..., 0, 1]) < config.merge_distance_m
    return np.asarray(near & (turn < config.merge_angle_rad))


def _guess(target: _Array, source: _Array, config: MotionModesConfig, rng: np.random.Generator) -> _Array:
    """(G, 3, 3) motions from pairs of candidates whose places are as far apart in both maps."""
    if len(target) < 2:
        return np.zeros((0, 3, 3))
    pairs = rng.integers(len(target), size=(config.num_draws, 2))
    apart_target = np.linalg.norm(target[pairs[:, 0]] - target[pairs[:, 1]], axis=1)
    apart_source = np.linalg.norm(source[pairs[:, 0]] - source[pairs[:, 1]], axis=1)
    keeps = (np.abs(apart_target - apart_source) <= config.match_distance_m) & (apart_source >= config.min_baseline_m)
    chosen = pairs[keeps][: config.num_guesses]
    return fit_motion(target[chosen], source[chosen])
