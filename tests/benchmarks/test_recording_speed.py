"""How fast scans are written: the aim is 20,000 scans of 360 beams a second into MCAP."""

from pathlib import Path

import numpy as np
import pytest

from merger import se2
from merger.grid_map import GridMap
from sim.recordings.recording import PlacedSubmap, Recording, write_recording
from sim.recordings.scan_log import write_scan_log
from sim.robot_run import LidarSpec, RobotRun, Trajectory

NUM_SCANS = 10_000


@pytest.fixture(scope="module")
def run() -> RobotRun:
    """A robot on a circle whose ranges wander as real ones do."""
    rng = np.random.default_rng(0)
    wandering = rng.uniform(2.0, 12.0, (1, 360)) + np.cumsum(rng.normal(0.0, 0.01, (256, 360)), axis=0)
    ranges = np.round(wandering, 3).astype(np.float32)
    stamps = np.arange(NUM_SCANS) * 0.1
    T = se2.make_motion(np.cos(stamps / 10), np.sin(stamps / 10), stamps / 10)
    lidar = LidarSpec(360, -np.pi, 2 * np.pi / 360, 0.1, 20.0)
    return RobotRun(
        Trajectory("robot_0", stamps, T, se2.invert(T[0]) @ T), lidar, lambda start, stop: ranges[: stop - start]
    )


def test_speed_of_writing_a_recording_with_scans_odometry_true_poses_and_transforms(benchmark, run, tmp_path):
    grid = GridMap("map_00", np.zeros((100, 100), dtype=np.float32), 0.05)
    recording = Recording([run], [PlacedSubmap(grid, np.eye(3), 0, NUM_SCANS - 1)], grid)
    benchmark.extra_info["scans"] = NUM_SCANS
    assert benchmark(write_recording, Path(tmp_path / "x.mcap"), recording, "benchmark") == NUM_SCANS


def test_speed_of_writing_a_scan_log(benchmark, run, tmp_path):
    benchmark.extra_info["scans"] = NUM_SCANS
    benchmark(write_scan_log, Path(tmp_path / "scans.log"), [run], "benchmark")
