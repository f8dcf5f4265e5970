"""People who walk about and stop to talk, and everything else that moves, as discs over time."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.robots.routing import Router

Array = npt.NDArray[np.float64]

_LEG_RADIUS_M = 0.07
_STANCE_M = 0.1
"""Half the distance between a person's legs."""
_STRIDE_M = 0.18
"""Half a step: how far a leg is before or behind the body."""
_STRIDE_LENGTH_M = 1.3
"""Way of a person in two steps."""
_KEEP_AWAY_M = 0.55
"""A person does not walk closer than this to a robot's centre."""
_FARTHEST_GOAL_M = 20.0
_NUDGE_M = 1.3
"""A person who stands nearer to a robot than this walks on."""
_LEAVE_S = 25.0
_PATIENCE_S = 1.5
"""A person who is in a robot's way, or has one in the way, goes somewhere else after this time."""


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


class Walker:
    """One person on the way between places."""

    def __init__(self, router: Router, config: PeopleConfig, robots: Array, rng: np.random.Generator) -> None:
        """Stand somewhere on the router's floor, away from the (R, 2) robots."""
        self._router, self._config, self._rng = router, config, rng
        self._places = np.nonzero(router.passable.ravel())[0]
        self.position = np.zeros(2)
        self._appear(robots)
        self.heading_rad, self.walked_m = float(rng.uniform(-math.pi, math.pi)), 0.0
        self._path, self._next = np.zeros((0, 2)), 0
        self._pause_s, self._waited_s = float(rng.exponential(config.mean_pause_s)), 0.0
        self._hemmed_s = 0.0

    def walk(self, robots: Array, step_s: float) -> None:
        """Walk for a step; (R, 2) robots are given way to."""
        near = np.hypot(*(robots - self.position).T).min(initial=np.inf)
        if self._next >= len(self._path):
            self._pause_s = min(self._pause_s, _PATIENCE_S) if near < _NUDGE_M else self._pause_s
            self._pause_s -= step_s
            if self._pause_s <= 0.0:
                self._set_out()
            return
        target = self._path[self._next]
        way = target - self.position
        length = float(np.hypot(*way))
        move = min(self._config.speed_mps * step_s, length)
        ahead = self.position + way * (move / max(length, 1e-9))
        if np.hypot(*(robots - ahead).T).min(initial=np.inf) < min(_KEEP_AWAY_M, near):
            self._wait(robots, step_s)
            return
        self.position, self._waited_s, self._hemmed_s = ahead, 0.0, 0.0
        self.walked_m += move
        if length > 1e-6:
            self.heading_rad = math.atan2(way[1], way[0])
        if move >= length:
            self._next += 1
            if self._next >= len(self._path):
                self._pause_s = float(self._rng.exponential(self._config.mean_pause_s))

    def legs(self) -> Array:
        """(2, 2) centres of both legs, which swing with the way walked."""
        along = np.array([math.cos(self.heading_rad), math.sin(self.heading_rad)])
        across = np.array([-along[1], along[0]]) * _STANCE_M
        swing = along * (_STRIDE_M * math.sin(2.0 * math.pi * self.walked_m / _STRIDE_LENGTH_M))
        return np.stack([self.position + across + swing, self.position - across - swing])

    def _wait(self, robots: Array, step_s: float) -> None:
        """Wait for a robot, then go elsewhere; whom robots hem in for long leaves, and appears somewhere else."""
        self._waited_s += step_s
        self._hemmed_s += step_s
        if self._hemmed_s > _LEAVE_S:
            self._appear(robots)
            self._hemmed_s = 0.0
        if self._waited_s > _PATIENCE_S:
            self._set_out()

    def _appear(self, robots: Array) -> None:
        """Stand somewhere away from the (R, 2) robots, if there is such a place."""
        for _ in range(50):
            self.position = self._router.point_of(self._rng.choice(self._places))
            if np.hypot(*(robots - self.position).T).min(initial=np.inf) > 4.0 * _KEEP_AWAY_M:
                break

    def _set_out(self) -> None:
        """Choose a place not too far away, and the way there."""
        path = self._router.wander(self._router.node_at(self.position), _FARTHEST_GOAL_M, self._rng)
        self._path, self._next, self._waited_s = path[1:], 0, 0.0
        self._pause_s = _PATIENCE_S


def leg_radii(num_people: int) -> Array:
    """(2 * num_people,) radii of legs."""
    return np.full(2 * num_people, _LEG_RADIUS_M)
