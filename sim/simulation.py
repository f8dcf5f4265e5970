"""Let robots drive through a building and scan it, one another, and the people in it."""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from sim.buildings.world import World
from sim.robot_run import LidarSpec, RobotRun
from sim.robots.drive import DriveConfig, drive
from sim.robots.people import MovingDiscs
from sim.sensors.lidar import Scene, make_scene, scan_run
from sim.sensors.lidar_noise import NoiseConfig
from sim.sensors.range_store import keep_ranges

Array = npt.NDArray[np.float64]

_KEPT_BYTES = 256 * 2**20
"""Memory for the ranges of all robots together."""


@dataclass(frozen=True)
class Sensor:
    """The lidar that every robot carries."""

    lidar: LidarSpec
    """Its geometry."""
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    """What goes wrong with it."""


def simulate(
    world: World,
    config: DriveConfig,
    sensor: Sensor,
    num_robots: int,
    seed: int,
    *,
    noise_seed: int | None = None,
) -> list[RobotRun]:
    """Drive robots through a building and let each of them scan it, the others and the people.

    Args:
        world: The building.
        config: How robots drive.
        sensor: Their lidar and what goes wrong with it.
        num_robots: How many, >= 1.
        seed: Of routes and people.
        noise_seed: Of odometry and lidar; none: as ``seed``.

    Returns:
        One run for each robot; scans are cast when they are first read.

    Raises:
        ValueError: as `drive`, or the lidar is impossible.
    """
    noise_seed = seed if noise_seed is None else noise_seed
    driven = drive(world, config, num_robots, sensor.lidar.scan_period_s, seed, noise_seed=noise_seed)
    walls = make_scene(world.segments, world.materials)
    runs = []
    for k, trajectory in enumerate(driven.trajectories):
        scene = _with_others(walls, driven.moving, k)
        run = scan_run(scene, trajectory, sensor.lidar, sensor.noise, seed=noise_seed)
        runs.append(keep_ranges(run, _KEPT_BYTES // num_robots))
    return runs


def _with_others(walls: Scene, moving: MovingDiscs, robot: int) -> Scene:
    """What one robot's lidar sees: walls, people, and the other robots."""
    others = moving.robots != robot
    if not others.any():
        return walls

    def obstacles_at(stamps_s: Array) -> Array:
        return moving.positions_at(stamps_s)[:, others]

    return replace(walls, obstacle_radii_m=moving.radii_m[others], obstacles_at=obstacles_at)
