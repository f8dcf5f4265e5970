"""The motion that most feature matches support, guessed from two of them at a time (Eq. 7, Algorithm 1)."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.rigid_fit import fit_motion


@dataclass(frozen=True)
class RansacConfig:
    """Settings of the motion guesses.

    Raises:
        ValueError: a setting is out of its range.
    """

    num_guesses: int = 200
    """Guesses of two matches, at least 1."""
    match_distance_m: float = 0.25
    """A match is an inlier if the guess brings it this close (the paper's d_thr of Algorithm 1), > 0."""
    min_inliers: int = 4
    """Fewer inliers are no motion (the paper's gate), at least 2."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.num_guesses < 1:
            raise ValueError(f"ransac.num_guesses must be >= 1, got {self.num_guesses}")
        if not self.match_distance_m > 0.0:
            raise ValueError(f"ransac.match_distance_m must be > 0, got {self.match_distance_m}")
        if self.min_inliers < 2:
            raise ValueError(f"ransac.min_inliers must be >= 2, got {self.min_inliers}")


@dataclass(frozen=True)
class RansacResult:
    """The best guess."""

    T_target_source: npt.NDArray[np.float64]
    """(3, 3) motion of the best guess, metres."""
    inliers: npt.NDArray[np.bool_]
    """(M,) the matches that support it."""

    @property
    def num_inliers(self) -> int:
        """Matches that support the best guess."""
        return int(self.inliers.sum())


def guess_motion(
    points_target: npt.NDArray[np.float64],
    points_source: npt.NDArray[np.float64],
    config: RansacConfig,
    rng: np.random.Generator,
) -> RansacResult:
    """Guess the motion from two matches, many times, and keep the guess that most matches support.

    All guesses are tested at once; of equal ones the first wins, as in Algorithm 1.

    Args:
        points_target: (M, 2) matched keypoints in the target frame, metres.
        points_source: (M, 2) the same in the source frame.
        config: Settings.
        rng: Chooses the pairs of matches.

    Returns:
        The best guess; with fewer than two matches the identity and no inlier.
    """
    num_matches = len(points_target)
    if num_matches < 2:
        return RansacResult(np.eye(3), np.zeros(num_matches, dtype=np.bool_))
    first = rng.integers(num_matches, size=config.num_guesses)
    second = (first + rng.integers(1, num_matches, size=config.num_guesses)) % num_matches
    chosen = np.stack([first, second], axis=1)
    guesses = fit_motion(points_target[chosen], points_source[chosen])
    offsets = se2.transform_points(guesses, points_source) - points_target
    inliers = (offsets**2).sum(axis=-1) <= config.match_distance_m**2  # Eq. (7).
    best = int(np.argmax(inliers.sum(axis=1)))
    return RansacResult(guesses[best], inliers[best])
