"""One robot at work: it drives from place to place along its tour, and out of others' way when asked to."""

import math
from enum import Enum

import numpy as np
import numpy.typing as npt

from sim.robots.errands import Errands
from sim.robots.path_following import CREEP_MPS, PathFollower
from sim.robots.robot import Robot, RobotConfig
from sim.robots.routing import Router

Array = npt.NDArray[np.float64]

_PLAN_AHEAD_POINTS = 6
_STUCK_S = 4.0
"""A robot that wants to drive and has not moved for so long plans anew, and then gives up its goal."""
_MOVED_M = 0.1


class Mode(Enum):
    """What a robot is doing."""

    TOURING = 0
    """It drives its tour."""
    MAKING_WAY = 1
    """It drives out of somebody's way, or waits there."""
    DONE = 2
    """Its tour is over."""
    GONE = 3
    """It has left the building."""


class Driver:
    """The state of one robot's drive."""

    def __init__(self, robot: Robot, router: Router, start: int, errands: Errands) -> None:
        """Begin at a router's node; the robot's body stands there."""
        self.robot, self.mode, self.hold, self.waited_s = robot, Mode.TOURING, False, 0.0
        self._router, self._errands, self._goal = router, errands, start
        self._follower = PathFollower(router.point_of(np.array([start])))
        self._moved_at = (*robot.pose[:2], 0.0)
        self._tries, self.attempts = 0, 0

    @property
    def position(self) -> Array:
        """(2,) where the robot is, metres."""
        return np.array(self.robot.pose[:2])

    def path_ahead(self, length_m: float) -> Array:
        """(M, 2) points of the way before the robot, its own place first."""
        points = self._follower.ahead(round(length_m / self._router.space.resolution_m))
        return np.array([self.robot.pose[:2], *points])

    def step(self, step_s: float, now_s: float) -> None:
        """Plan if need be, and ask the wheels for a speed."""
        pose = self.robot.pose
        if self.mode is Mode.TOURING and self._follower.num_points_left < _PLAN_AHEAD_POINTS:
            self._plan_next(pose)
        waiting = self.mode is Mode.MAKING_WAY and self._follower.arrived(*pose[:2])
        if self.hold or waiting or self.mode is Mode.DONE:
            self._moved_at = (pose[0], pose[1], now_s)
            self.robot.drive(0.0, 0.0, step_s)
            return
        limits = self.robot.config
        spare_m = self._router.clearance_at(pose[0], pose[1]) - limits.radius_m
        speed, turn = self._follower.steer(pose, spare_m, _top_speed(limits, spare_m))
        turn = min(max(turn, -limits.max_turn_radps), limits.max_turn_radps)
        self.robot.drive(min(speed, limits.max_speed_mps), turn, step_s)
        self._watch(pose, now_s)

    def make_way(self, path: Array) -> None:
        """Leave the tour for a while, along (M, 2) points."""
        self.mode, self._follower = Mode.MAKING_WAY, PathFollower(path)

    def resume(self, avoid: list[tuple[Array, float]] | None = None) -> bool:
        """Go on to the goal from here, around discs (centre, radius) if asked; False if there is no way."""
        path = self._router.route(self._router.node_at(self.position), self._goal, avoid=avoid or [])
        if len(path) == 0:
            return False
        self.mode, self._follower, self.waited_s = Mode.TOURING, PathFollower(path), 0.0
        return True

    def skip_goal(self) -> None:
        """Give up the present goal, and go on to the one after it."""
        errand = next(self._errands, None)
        if errand is None:
            self.mode = Mode.DONE
            return
        self._goal = errand[0]
        self.resume()

    def _plan_next(self, pose: tuple[float, float, float]) -> None:
        errand = next(self._errands, None)
        if errand is None:
            if self._follower.arrived(*pose[:2]):
                self.mode = Mode.DONE
            return
        path = self._router.route(self._goal, errand[0], errand[1])
        if len(path):
            self._goal = errand[0]
            self._follower.extend(path)

    def _watch(self, pose: tuple[float, float, float], now_s: float) -> None:
        """Notice being stuck, and do something about it."""
        x, y, since_s = self._moved_at
        if (pose[0] - x) ** 2 + (pose[1] - y) ** 2 > _MOVED_M**2:
            self._moved_at, self._tries = (pose[0], pose[1], now_s), 0
        elif now_s - since_s > _STUCK_S:
            self._moved_at = (pose[0], pose[1], now_s)
            self._tries += 1
            if self._tries > 1 or not self.resume():
                self.skip_goal()


def _top_speed(limits: RobotConfig, spare_m: float) -> float:
    """The speed, m/s, from which a robot stops before it touches anything, wherever it is heading."""
    return min(limits.max_speed_mps, CREEP_MPS + math.sqrt(2.0 * limits.acceleration_mps2 * max(spare_m, 0.0)))
