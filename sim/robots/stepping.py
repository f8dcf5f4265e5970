"""Step a building through time: robots drive, people walk, and the space settles who touches what."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pymunk

from sim.robots.crowd import Crowd
from sim.robots.driver import Driver, Mode
from sim.robots.routing import Router
from sim.robots.traffic import direct_traffic

Array = npt.NDArray[np.float64]

_LONGEST_STEP_S = 0.05
_TRAFFIC_PERIOD_S = 0.2


@dataclass(frozen=True)
class Clock:
    """How time is cut."""

    scan_period_s: float
    """Time between two scans."""
    max_duration_s: float
    """The run is at most so long: ``round(max_duration_s / scan_period_s)`` scans, at least one."""

    @property
    def steps_per_scan(self) -> int:
        """Steps of the space between two scans."""
        return math.ceil(self.scan_period_s / _LONGEST_STEP_S)

    @property
    def step_s(self) -> float:
        """Length of a step."""
        return self.scan_period_s / self.steps_per_scan

    @property
    def num_steps(self) -> int:
        """Steps until the last scan."""
        return max(round(self.max_duration_s / self.scan_period_s) - 1, 0) * self.steps_per_scan


@dataclass(frozen=True)
class Recording:
    """What was where at every step."""

    poses: tuple[list[tuple[float, float, float]], ...]
    """Of each robot: x_m, y_m, theta_rad until it left."""
    legs_m: list[Array] = field(default_factory=list)
    """(2 P, 2) legs of P people, at each step; empty without people."""


def run_space(
    space: pymunk.Space, drivers: Sequence[Driver], crowd: Crowd | None, router: Router, clock: Clock
) -> Recording:
    """Run until every robot has done its errands, or time is up.

    A robot that is done leaves the building at its next scan.
    """
    recording = Recording(tuple([] for _ in drivers))
    step_s, steps_per_scan = clock.step_s, clock.steps_per_scan
    traffic_steps = max(1, round(_TRAFFIC_PERIOD_S / step_s))
    for k in range(clock.num_steps + 1):
        _record(recording, drivers, crowd)
        if k % steps_per_scan == 0:
            _let_leave(space, drivers)
        present = [driver for driver in drivers if driver.mode is not Mode.GONE]
        if not present:
            break
        if k % traffic_steps == 0 and (len(drivers) > 1 or crowd):
            people = crowd.positions if crowd else np.zeros((0, 2))
            direct_traffic(present, people, router, traffic_steps * step_s)
        for driver in present:
            driver.step(step_s, k * step_s)
        if crowd:
            crowd.walk(np.array([driver.position for driver in present]), step_s)
        space.step(step_s)
        for driver in present:
            driver.robot.sense()
    return recording


def _record(recording: Recording, drivers: Sequence[Driver], crowd: Crowd | None) -> None:
    for poses, driver in zip(recording.poses, drivers, strict=True):
        if driver.mode is not Mode.GONE:
            poses.append(driver.robot.pose)
    if crowd:
        recording.legs_m.append(crowd.legs())


def _let_leave(space: pymunk.Space, drivers: Sequence[Driver]) -> None:
    for driver in drivers:
        if driver.mode is Mode.DONE:
            driver.robot.leave(space)
            driver.mode = Mode.GONE
