"""Small runs whose every range is known: robots in a box with a block in it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from merger import se2
from sim.config import SimConfig, SourceConfig, SourceKind
from sim.datasets.dataset import make_dataset
from sim.maps.submap_mapping import MappingConfig, PoseSource
from sim.maps.submaps import SubmapsConfig
from sim.recordings.scan_log import write_scan_log
from sim.robot_run import LidarSpec, RobotRun, Trajectory

MakeRuns = Callable[..., list[RobotRun]]

_BOX = [(0.0, 0.0, 8.0, 6.0), (3.5, 2.5, 4.5, 3.5)]


def _segments() -> npt.NDArray[np.float64]:
    """(8, 2, 2) walls of the box and of the block in it."""
    walls = []
    for x0, y0, x1, y1 in _BOX:
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        walls += [np.stack([corners[k], corners[(k + 1) % 4]]) for k in range(4)]
    return np.stack(walls)


def cast(origin: npt.NDArray[np.float64], angles: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Exact ranges from a point, one for each angle."""
    a, b = _segments()[:, 0], _segments()[:, 1]
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, None]
    edge, to_start = (b - a)[None], (a - origin)[None]
    denominator = direction[..., 0] * edge[..., 1] - direction[..., 1] * edge[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (to_start[..., 0] * edge[..., 1] - to_start[..., 1] * edge[..., 0]) / denominator
        s = (to_start[..., 0] * direction[..., 1] - to_start[..., 1] * direction[..., 0]) / denominator
    return np.where((t > 0) & (s >= 0) & (s <= 1), t, np.inf).min(axis=1)


def circle_block(
    num_robots: int = 1, num_scans: int = 40, num_beams: int = 90, period_s: float = 0.2
) -> list[RobotRun]:
    """Runs of robots that circle around the block; their scans are so short that skew is below a millimetre."""
    lidar = LidarSpec(
        num_beams, -np.pi, 2 * np.pi / num_beams, 0.1, 5.5, period_s, 1e-5, T_robot_lidar=(0.1, 0.02, 0.3)
    )
    runs = []
    for robot in range(num_robots):
        phase = np.linspace(0.0, 1.2 * np.pi, num_scans) + 0.8 * np.pi * robot
        T = se2.make_motion(4.0 + 2.6 * np.cos(phase), 3.0 + 1.9 * np.sin(phase), phase + np.pi / 2)
        drift = se2.exp(np.arange(num_scans)[:, None] * np.array([0.002, 0.0, 0.001]))
        T_odom = se2.invert(T[0]) @ T @ drift
        T_world_lidar = T @ lidar.pose_on_robot
        angles = se2.angle_of(T_world_lidar)[:, None] + lidar.angles_rad
        exact = np.stack([cast(p[:2, 2], a) for p, a in zip(T_world_lidar, angles, strict=True)])
        ranges = np.round(exact, 3).astype(np.float32)
        ranges[ranges > 5.5] = np.inf
        ranges[:, 3] = -np.inf
        stamps = np.arange(num_scans) * period_s + 0.013 * robot
        runs.append(RobotRun(Trajectory(f"robot_{robot}", stamps, T, T_odom), lidar, _reader(ranges)))
    return runs


def _reader(ranges: npt.NDArray[np.float32]) -> Callable[[int, int], npt.NDArray[np.float32]]:
    return lambda start, stop: ranges[start:stop]


@pytest.fixture(scope="session")
def make_runs() -> MakeRuns:
    """Makes runs of robots that circle around the block."""
    return circle_block


@pytest.fixture(scope="session")
def tiny_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A CARMEN log of two robots in a box."""
    path = tmp_path_factory.mktemp("log") / "tiny.log"
    write_scan_log(path, circle_block(num_robots=2), "tiny")
    return path


@pytest.fixture(scope="session")
def tiny_config(tiny_log: Path) -> SimConfig:
    """What makes a dataset of four submaps from that log."""
    return SimConfig(
        source=SourceConfig(SourceKind.CARMEN, str(tiny_log)),
        submaps=SubmapsConfig(count=4, overlap=0.3),
        mapping=MappingConfig(PoseSource.TRUTH),
    )


@pytest.fixture(scope="session")
def tiny_dataset(tiny_config: SimConfig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That dataset; not to be changed."""
    return make_dataset(tiny_config, tmp_path_factory.mktemp("datasets") / "tiny")
