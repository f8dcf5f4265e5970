"""People who walk about and stop to talk, all of them a step at a time; each has a random stream of their own."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from sim.robots.people import PeopleConfig
from sim.robots.routing import Router

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

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


class Crowd:
    """Where P people are, and where they are going."""

    def __init__(
        self, router: Router, config: PeopleConfig, robots: Array, rngs: Sequence[np.random.Generator]
    ) -> None:
        """Stand on the router's floor, away from the (R, 2) robots; one generator for each person."""
        self._router, self._config, self._rngs = router, config, rngs
        self._places = np.nonzero(router.passable.ravel())[0]
        count = len(rngs)
        self.positions = np.array([self._free_place(robots, rng) for rng in rngs]).reshape(count, 2)
        self._heading_rad = np.array([rng.uniform(-math.pi, math.pi) for rng in rngs])
        self._walked_m, self._waited_s, self._hemmed_s = np.zeros(count), np.zeros(count), np.zeros(count)
        self._pause_s = np.array([rng.exponential(config.mean_pause_s) for rng in rngs])
        self._paths = [np.zeros((0, 2))] * count
        self._next, self._num_points = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
        self._target = self.positions.copy()

    def walk(self, robots: Array, step_s: float) -> None:
        """Walk for a step; (R, 2) robots are given way to."""
        near = _nearest(self.positions, robots)
        stands = self._next >= self._num_points
        self._stand(np.flatnonzero(stands), near, step_s)
        self._go(np.flatnonzero(~stands), near, robots, step_s)

    def legs(self) -> Array:
        """(2 P, 2) centres of everybody's legs, which swing with the way walked."""
        along = np.stack([np.cos(self._heading_rad), np.sin(self._heading_rad)], axis=-1)
        across = np.stack([-along[:, 1], along[:, 0]], axis=-1) * _STANCE_M
        swing = along * (_STRIDE_M * np.sin(2.0 * math.pi * self._walked_m / _STRIDE_LENGTH_M))[:, None]
        return np.stack([self.positions + across + swing, self.positions - across - swing], axis=1).reshape(-1, 2)

    def _stand(self, people: Indices, near: Array, step_s: float) -> None:
        """Those who have arrived wait for their pause to end; robots shorten it."""
        pause = self._pause_s[people]
        nudged = near[people] < _NUDGE_M
        self._pause_s[people] = np.where(nudged, np.minimum(pause, _PATIENCE_S), pause) - step_s
        for person in people[self._pause_s[people] <= 0.0].tolist():
            self._set_out(person)

    def _go(self, people: Indices, near: Array, robots: Array, step_s: float) -> None:
        """The others walk towards the next point of their path, or wait for a robot."""
        way = self._target[people] - self.positions[people]
        length = np.sqrt((way * way).sum(axis=1))
        move = np.minimum(self._config.speed_mps * step_s, length)
        ahead = self.positions[people] + way * (move / np.maximum(length, 1e-9))[:, None]
        blocked = _nearest(ahead, robots) < np.minimum(_KEEP_AWAY_M, near[people])
        self._wait(people[blocked], robots, step_s)
        walk = ~blocked
        walkers = people[walk]
        self.positions[walkers] = ahead[walk]
        self._waited_s[walkers], self._hemmed_s[walkers] = 0.0, 0.0
        self._walked_m[walkers] += move[walk]
        turns = walk & (length > 1e-6)
        self._heading_rad[people[turns]] = np.arctan2(way[turns, 1], way[turns, 0])
        for person in people[walk & (move >= length)].tolist():
            self._reach_point(person)

    def _wait(self, people: Indices, robots: Array, step_s: float) -> None:
        """Wait for a robot, then go elsewhere; whom robots hem in for long leaves, and appears somewhere else."""
        self._waited_s[people] += step_s
        self._hemmed_s[people] += step_s
        leave = self._hemmed_s[people] > _LEAVE_S
        for person in people[leave].tolist():
            self.positions[person] = self._free_place(robots, self._rngs[person])
            self._hemmed_s[person] = 0.0
        for person in people[leave | (self._waited_s[people] > _PATIENCE_S)].tolist():
            self._set_out(person)

    def _reach_point(self, person: int) -> None:
        """Go on to the next point of the path, or pause at its end."""
        self._next[person] += 1
        if self._next[person] < self._num_points[person]:
            self._target[person] = self._paths[person][self._next[person]]
        else:
            self._pause_s[person] = self._rngs[person].exponential(self._config.mean_pause_s)

    def _set_out(self, person: int) -> None:
        """Choose a place not too far away, and the way there."""
        start = self._router.node_at(self.positions[person])
        path = self._router.wander(start, _FARTHEST_GOAL_M, self._rngs[person])[1:]
        self._paths[person], self._next[person], self._num_points[person] = path, 0, len(path)
        self._target[person] = path[0] if len(path) else self.positions[person]
        self._waited_s[person], self._pause_s[person] = 0.0, _PATIENCE_S

    def _free_place(self, robots: Array, rng: np.random.Generator) -> Array:
        """(2,) a place away from the (R, 2) robots, if there is such a one."""
        for _ in range(50):
            place = self._router.point_of(rng.choice(self._places))
            if _nearest(place[None], robots)[0] > 4.0 * _KEEP_AWAY_M:
                break
        return place


def _nearest(points: Array, robots: Array) -> Array:
    """(P,) distance of each of (P, 2) points to the nearest of (R, 2) robots; infinite without robots."""
    away = points[:, None] - robots[None]
    return np.asarray(np.sqrt((away * away).sum(axis=-1).min(axis=1, initial=np.inf)))
