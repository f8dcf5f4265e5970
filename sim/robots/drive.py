"""Let robots drive through a building: true and told poses at every scan, and everything that moved meanwhile."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pymunk

from merger import se2
from sim.buildings.free_space import measure_free_space
from sim.buildings.world import World
from sim.buildings.world_check import check_reach
from sim.robot_run import Trajectory
from sim.robots.coverage import CoverageConfig
from sim.robots.crowd import Crowd
from sim.robots.driver import Driver
from sim.robots.errands import Errands
from sim.robots.people import MovingDiscs, PeopleConfig, leg_radii
from sim.robots.robot import Robot, RobotConfig, make_space
from sim.robots.routing import Router
from sim.robots.stepping import Clock, Recording, run_space
from sim.robots.work import place_robots, share_work
from sim.sensors.odometry import OdometryConfig, integrate_odometry
from sim.streams import Purpose, make_stream

Array = npt.NDArray[np.float64]

_MARGIN_M = 0.04
"""Planned ways keep this distance between a robot's body and walls."""
_FLOOR_OF_A_PERSON_M2 = 2.0
"""Where more people stand, robots hardly move."""
_DAY_S = 86_400.0
_FAR_AWAY_M = 1e6
"""Where a robot is that has left the building."""


@dataclass(frozen=True)
class DriveConfig:
    """How robots drive."""

    robot: RobotConfig = field(default_factory=RobotConfig)
    """Their size and wheels."""
    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    """What they visit, unless the world has waypoints."""
    people: PeopleConfig = field(default_factory=PeopleConfig)
    """Who else moves."""
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    """How their wheels err."""
    duration_s: float | None = None
    """Every robot drives just so long, over its tour again and again; none: until its tour is over."""
    max_duration_s: float = 7200.0
    """No run is longer, whatever is left of its tour, in (0, 86400]."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        for name, most_s in (("max_duration_s", _DAY_S), ("duration_s", self.max_duration_s)):
            value = getattr(self, name)
            if value is not None and not 0.0 < value <= most_s:
                limit = "max_duration_s = " if name == "duration_s" else ""
                raise ValueError(f"{name} must be in (0, {limit}{most_s:g}] s, got {value:g}")


@dataclass(frozen=True)
class Drive:
    """What happened in the building."""

    trajectories: tuple[Trajectory, ...]
    """One for each robot, at the stamps of its scans."""
    moving: MovingDiscs
    """Robots and people."""


def drive(
    world: World,
    config: DriveConfig,
    num_robots: int,
    scan_period_s: float,
    seed: int,
    *,
    noise_seed: int | None = None,
) -> Drive:
    """Drive robots through a building.

    Args:
        world: The building.
        config: How robots drive.
        num_robots: How many, >= 1.
        scan_period_s: Time between two scans, > 0.
        seed: Of routes and people; the same seed gives the same run, whatever the noise.
        noise_seed: Of odometry; none: as ``seed``.

    Returns:
        Trajectories ``robot_0``, ``robot_1``, ... and what moved.

    Raises:
        ValueError: there is no robot, the period is not positive, or the robots are too large for the building.
    """
    if num_robots < 1:
        raise ValueError(f"num_robots must be >= 1, got {num_robots}")
    if not (0.0 < scan_period_s < math.inf):
        raise ValueError(f"scan_period_s must be > 0, got {scan_period_s}")
    router = _make_router(world, config.robot.radius_m)
    rngs = [make_stream(seed, Purpose.DRIVE, k) for k in range(num_robots)]
    starts = place_robots(world, router, num_robots, config.robot.radius_m)
    errands = share_work(world, router, starts, config.coverage, rngs, endless=config.duration_s is not None)
    crowd = _make_crowd(world, router, config.people, starts, seed)
    space = make_space(world.segments)
    drivers = _make_drivers(space, config.robot, router, starts, errands)
    clock = Clock(scan_period_s, min(config.duration_s or math.inf, config.max_duration_s))
    recording = run_space(space, drivers, crowd, router, clock)
    trajectories = _trajectories(recording, clock, config.odometry, seed if noise_seed is None else noise_seed)
    return Drive(trajectories, _moving(recording, clock, config.robot.radius_m))


def _make_router(world: World, radius_m: float) -> Router:
    """The floor that robots of this radius reach from the first start; refuses a building that is too narrow."""
    if len(world.starts) == 0:
        raise ValueError(f"world '{world.name}' has no start")
    space = measure_free_space(world.segments)
    check_reach(world.name, space, world.rooms, world.starts, radius_m + _MARGIN_M)
    return Router(space, space.reachable(world.starts[0], radius_m + _MARGIN_M), radius_m + _MARGIN_M)


def _make_crowd(world: World, router: Router, config: PeopleConfig, starts: Array, seed: int) -> Crowd | None:
    """The people of a building, if there are any; refuses more than have room beside the robots."""
    most = int(router.floor_m2 / _FLOOR_OF_A_PERSON_M2)
    if config.num_people > most:
        raise ValueError(
            f"num_people must be at most {most} in world '{world.name}' ({_FLOOR_OF_A_PERSON_M2:g} m² of the floor "
            f"that robots reach for each), got {config.num_people}"
        )
    rngs = [make_stream(seed, Purpose.PEOPLE, k) for k in range(config.num_people)]
    return Crowd(router, config, starts[:, :2], rngs) if rngs else None


def _make_drivers(
    space: pymunk.Space, robot: RobotConfig, router: Router, starts: Array, errands: list[Errands]
) -> list[Driver]:
    """A robot at each start, with its errands."""
    return [
        Driver(Robot(space, start, robot), router, router.node_at(start[:2]), errand)
        for start, errand in zip(starts, errands, strict=True)
    ]


def _trajectories(
    recording: Recording, clock: Clock, odometry: OdometryConfig, noise_seed: int
) -> tuple[Trajectory, ...]:
    """Poses at the scans, and what the wheels made of them."""
    trajectories = []
    for k, poses in enumerate(recording.poses):
        T_world_robot = se2.make_motion(*np.array(poses)[:: clock.steps_per_scan].T)
        stamps_s = np.arange(len(T_world_robot), dtype=np.float64) * clock.scan_period_s
        T_odom_robot = integrate_odometry(T_world_robot, odometry, make_stream(noise_seed, Purpose.ODOMETRY, k))
        trajectories.append(Trajectory(f"robot_{k}", stamps_s, T_world_robot, T_odom_robot))
    return tuple(trajectories)


def _moving(recording: Recording, clock: Clock, radius_m: float) -> MovingDiscs:
    """Robots and legs at every step."""
    num_steps, num_robots = max(len(poses) for poses in recording.poses), len(recording.poses)
    num_legs = len(recording.legs_m[0]) if recording.legs_m else 0
    positions = np.full((num_steps, num_robots + num_legs, 2), _FAR_AWAY_M)
    for k, poses in enumerate(recording.poses):
        positions[: len(poses), k] = np.array(poses)[:, :2]
    if recording.legs_m:
        np.stack(recording.legs_m[:num_steps], out=positions[:, num_robots:])
    radii = np.concatenate([np.full(num_robots, radius_m), leg_radii(num_legs // 2)])
    robots = np.concatenate([np.arange(num_robots), np.full(num_legs, -1)])
    stamps_s = np.arange(num_steps, dtype=np.float64) * clock.step_s
    return MovingDiscs(stamps_s, positions, radii, robots)
