"""Where a dataset's scans come from: robots in a simulated building, or a log; after that all is the same."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from merger.grid_map import GridMap
from sim.buildings.building_map import draw_building
from sim.buildings.plan import Material
from sim.buildings.world import OFFICE, World, read_world
from sim.config import SimConfig, SourceKind, building_name, drive_config, num_submaps
from sim.maps.submap_mapping import map_ground_truth
from sim.recordings.carmen import read_carmen
from sim.recordings.carmen_lines import LogError
from sim.robot_run import RobotRun
from sim.sensors.odometry import integrate_odometry
from sim.simulation import Sensor, simulate
from sim.streams import Purpose, make_stream

_REPEATED = 1e-6
"""Metres and radians within which odometry repeats the true poses."""


@dataclass(frozen=True)
class Source:
    """The runs, and what is known of the place."""

    building: str
    """Name of the building or of the log."""
    runs: Sequence[RobotRun]
    """One for each robot."""
    ground_truth: GridMap
    """The true map of the building, in frame ``world``: drawn from its walls, or mapped at the true poses."""
    provenance: dict[str, str]
    """Facts for the card and the recording."""
    files: dict[str, bytes] = field(default_factory=dict)
    """What else belongs to the source, by file name: the world."""


def make_source(config: SimConfig) -> Source:
    """Simulate, or read the log.

    Raises:
        ValueError: the world or log cannot be used, or the configuration asks for the impossible.
    """
    return _read_log(config) if config.source.kind is SourceKind.CARMEN else _simulate(config)


def check_source(config: SimConfig) -> None:
    """Refuse a log that is not there, and a building that is unknown or unsound, before anything runs.

    A generated building is known to be sound only when it is generated.

    Raises:
        ValueError: the log or the world cannot be used.
    """
    if config.source.kind is SourceKind.CARMEN:
        if not Path(config.source.path or "").is_file():
            raise ValueError(f"{config.source.path}: no such file")
    elif config.world != OFFICE:
        read_world(config.world, office=config.office, furnish=config.furnish, seed=config.seed)


def _simulate(config: SimConfig) -> Source:
    _check_count(config)
    world = read_world(config.world, office=config.office, furnish=config.furnish, seed=config.seed)
    sensor = Sensor(config.lidar, config.noise)
    runs = simulate(world, drive_config(config), sensor, config.num_robots, config.seed, noise_seed=config.noise_seed)
    ground_truth = draw_building(world, config.mapping.occupancy.resolution_m)
    return Source(world.name, runs, ground_truth, {"world": world.name}, {"world.json": _world_json(world)})


def _check_count(config: SimConfig) -> None:
    """Refuse more submaps than the runs can have scans, before anybody drives."""
    longest_s = min(config.duration_s or config.max_duration_s, config.max_duration_s)
    most = config.num_robots * max(round(longest_s / config.lidar.scan_period_s), 1)
    if num_submaps(config) > most:
        raise ValueError(f"submaps.count must be at most the number of scans, {most}, got {num_submaps(config)}")


def _world_json(world: World) -> bytes:
    """The surfaces of a world: both ends in metres, and the material of each."""
    surfaces = [
        {"start": np.round(a, 6).tolist(), "end": np.round(b, 6).tolist(), "material": Material(material).name.lower()}
        for (a, b), material in zip(world.segments, world.materials, strict=True)
    ]
    document = {"name": world.name, "surfaces": surfaces, "starts": np.round(world.starts, 6).tolist()}
    return (json.dumps(document) + "\n").encode()


def _read_log(config: SimConfig) -> Source:
    path = Path(config.source.path or "")
    runs = [_with_odometry(run, index, config) for index, run in enumerate(read_carmen(path))]
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    try:
        ground_truth = map_ground_truth(runs, config.mapping.occupancy)
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None
    return Source(building_name(config), runs, ground_truth, {"log": path.name, "log_sha256": digest})


def _with_odometry(run: RobotRun, index: int, config: SimConfig) -> RobotRun:
    """The run of a log; where its odometry only repeats the true poses, odometry that drifts is laid over them."""
    trajectory = run.trajectory
    T_world_told = trajectory.T_world_odom @ trajectory.T_odom_robot
    if not np.allclose(T_world_told, trajectory.T_world_robot, rtol=0.0, atol=_REPEATED):
        return run
    seed = config.seed if config.noise_seed is None else config.noise_seed
    T_odom_robot = integrate_odometry(
        trajectory.T_world_robot, config.odometry, make_stream(seed, Purpose.ODOMETRY, index)
    )
    return replace(run, trajectory=replace(trajectory, T_odom_robot=T_odom_robot))
