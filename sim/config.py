"""Everything that makes a dataset, in one tree: the same tree and version give the same dataset, byte for byte."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sim.buildings.floor_plan import OfficeConfig
from sim.buildings.furnishing import FurnishConfig
from sim.maps.submap_mapping import MappingConfig
from sim.maps.submaps import SubmapsConfig
from sim.robot_run import LidarSpec
from sim.robots.coverage import CoverageConfig
from sim.robots.drive import DriveConfig
from sim.robots.people import PeopleConfig
from sim.robots.robot import RobotConfig
from sim.sensors.lidar import check_lidar
from sim.sensors.lidar_noise import NoiseConfig
from sim.sensors.lidar_presets import LIDAR_PRESETS
from sim.sensors.odometry import OdometryConfig

_NUM_SUBMAPS = MappingProxyType({"tim": 4, "intel": 8, "fr079": 11})
"""Submaps of the paper's data sets."""
_OTHER_NUM_SUBMAPS = 8
"""Submaps of other buildings, and of logs."""
_LARGEST_SEED = 2**63 - 1


class SourceKind(StrEnum):
    """Where scans come from."""

    SIMULATED = "simulated"
    """Robots drive through a world."""
    CARMEN = "carmen"
    """A log in CARMEN's format."""


@dataclass(frozen=True)
class SourceConfig:
    """Where scans come from."""

    kind: SourceKind = SourceKind.SIMULATED
    """Simulated, or a log."""
    path: str | None = None
    """The log, ``.log`` or ``.log.gz``."""

    def __post_init__(self) -> None:
        """Refuse a log without a path, and a path without a log."""
        if self.kind is SourceKind.CARMEN and not self.path:
            raise ValueError("source.path must name a CARMEN log when source=carmen")
        if self.kind is SourceKind.SIMULATED and self.path:
            raise ValueError(f"source.path is read only with source=carmen, got '{self.path}'")


@dataclass(frozen=True)
class SimConfig:
    """What makes a dataset."""

    seed: int = 0
    """Seed of everything that is drawn, >= 0."""
    name: str | None = None
    """Name of the dataset, fit for a folder; none: the building and the seed."""
    world: str = "intel"
    """The building: a name under ``worlds/``, ``office``, or the path of a world file or of a `map_server` map."""
    office: OfficeConfig = field(default_factory=OfficeConfig)
    """What a generated building (``world=office``) must be like; the seed draws the rest."""
    furnish: FurnishConfig = field(default_factory=FurnishConfig)
    """How full rooms are that are furnished by a seed."""
    source: SourceConfig = field(default_factory=SourceConfig)
    """Where scans come from."""
    num_robots: int = 2
    """Robots that are simulated, >= 1."""
    duration_s: float | None = None
    """Every robot drives just so long, at most ``max_duration_s``; none: until it has seen its part of the building."""
    max_duration_s: float = 7200.0
    """No run is longer, in (0, 86400]."""
    robot: RobotConfig = field(default_factory=RobotConfig)
    """Size and wheels of the robots."""
    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    """What the robots visit."""
    people: PeopleConfig = field(default_factory=PeopleConfig)
    """Who else moves."""
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    """How wheels err; laid over a log that carries no odometry, too."""
    lidar: LidarSpec = field(default_factory=lambda: LIDAR_PRESETS["sick_lms_180"])
    """The lidar that every simulated robot carries."""
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    """What goes wrong with it."""
    noise_seed: int | None = None
    """Seed of odometry and lidar noise alone, >= 0; none: as ``seed``."""
    submaps: SubmapsConfig = field(default_factory=SubmapsConfig)
    """How runs are cut into submaps."""
    mapping: MappingConfig = field(default_factory=MappingConfig)
    """How a submap is made from scans."""

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        for key, seed in (("seed", self.seed), ("noise_seed", self.noise_seed)):
            if seed is not None and not 0 <= seed <= _LARGEST_SEED:
                raise ValueError(f"{key} must be {'>= 0' if seed < 0 else 'below 2^63'}, got {seed}")
        if self.name is not None and (not self.name or "/" in self.name or self.name.startswith(".")):
            raise ValueError(f"name must be a folder's name (no '/', no '.' first), got '{self.name}'")
        if self.num_robots < 1:
            raise ValueError(f"num_robots must be >= 1, got {self.num_robots}")
        drive_config(self)
        check_lidar(self.lidar)
        if math.hypot(*self.lidar.T_robot_lidar[:2]) > self.robot.radius_m:
            raise ValueError(
                f"lidar.T_robot_lidar must be within robot.radius_m = {self.robot.radius_m:g} of the robot's centre, "
                f"got {tuple(self.lidar.T_robot_lidar)}"
            )
        _check_finite("", to_plain_dict(self))


def _check_finite(prefix: str, values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        if isinstance(value, dict):
            _check_finite(f"{prefix}{key}.", value)
        elif isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{prefix}{key} must be finite, got {value}")


def drive_config(config: SimConfig) -> DriveConfig:
    """How robots drive, as the simulation takes it."""
    return DriveConfig(
        config.robot, config.coverage, config.people, config.odometry, config.duration_s, config.max_duration_s
    )


def num_submaps(config: SimConfig) -> int:
    """Submaps of the whole dataset: as the config says, else what the style of the building has."""
    if config.submaps.count is not None:
        return config.submaps.count
    simulated = config.source.kind is SourceKind.SIMULATED
    return _NUM_SUBMAPS.get(config.world, _OTHER_NUM_SUBMAPS) if simulated else _OTHER_NUM_SUBMAPS


def dataset_name(config: SimConfig) -> str:
    """Name of the dataset: as the config says, else the building and the seed."""
    return config.name or f"{building_name(config)}-{config.seed}"


def building_name(config: SimConfig) -> str:
    """What the world or the log is called: its file's name without endings."""
    log = config.source.path if config.source.kind is SourceKind.CARMEN else None
    return Path(log or config.world).name.split(".")[0]


def to_plain_dict(config: Any) -> dict[str, Any]:
    """A config dataclass as nested dictionaries of numbers, strings and lists; enums by their values."""
    return {field.name: _plain(getattr(config, field.name)) for field in dataclasses.fields(config)}


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return to_plain_dict(value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value
