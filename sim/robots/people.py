"""Who walks about, and everything that moves, as discs over time."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_LEG_RADIUS_M = 0.07


@dataclass(frozen=True)
class PeopleConfig:
    """Who walks about."""

    num_people: int = 0
    """How many, >= 0."""
    speed_mps: float = 0.9
    """Walking speed, in (0, 3]."""
    mean_pause_s: float = 15.0
    """Mean time that a person stands at each goal, >= 0."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        if self.num_people < 0:
            raise ValueError(f"num_people must be >= 0, got {self.num_people}")
        if not 0.0 < self.speed_mps <= 3.0:
            raise ValueError(f"people.speed_mps must be in (0, 3], got {self.speed_mps}")
        if not (0.0 <= self.mean_pause_s < math.inf):
            raise ValueError(f"mean_pause_s must be >= 0, got {self.mean_pause_s}")


@dataclass(frozen=True)
class MovingDiscs:
    """Discs that move: robots and the legs of people."""

    stamps_s: Array
    """(S,) times, strictly increasing, from 0."""
    positions_m: Array
    """(S, K, 2) centres, frame ``world``; a robot that has left is far away from everything."""
    radii_m: Array
    """(K,) radii."""
    robots: npt.NDArray[np.int64]
    """(K,) index of the robot that a disc is, which does not see itself; -1 for people."""

    def positions_at(self, stamps_s: Array) -> Array:
        """(n, K, 2) centres at (n,) times, interpolated linearly, and held before the first and after the last."""
        right = np.clip(np.searchsorted(self.stamps_s, stamps_s), 1, max(len(self.stamps_s) - 1, 1))
        right = np.minimum(right, len(self.stamps_s) - 1)
        left = np.maximum(right - 1, 0)
        span = np.where(right > left, self.stamps_s[right] - self.stamps_s[left], 1.0)
        share = np.clip((stamps_s - self.stamps_s[left]) / span, 0.0, 1.0)[:, None, None]
        return np.asarray(self.positions_m[left] * (1.0 - share) + self.positions_m[right] * share)


def leg_radii(num_people: int) -> Array:
    """(2 * num_people,) radii of legs."""
    return np.full(2 * num_people, _LEG_RADIUS_M)
