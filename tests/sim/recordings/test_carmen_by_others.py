"""MRPT, written by others, reads from our logs the scans and poses that our own reader reads; never a dependency."""

import gzip
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from merger import se2
from sim.recordings.carmen import read_carmen

PROGRAMS = ("carmen2rawlog", "rawlog-edit", "carmen2simplemap")
MISSING = [program for program in PROGRAMS if shutil.which(program) is None]
pytestmark = pytest.mark.skipif(bool(MISSING), reason=f"no {', '.join(MISSING)} (Debian package mrpt-apps)")


@pytest.fixture(scope="module")
def scans_log(tiny_log: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log in a folder of its own: MRPT writes beside what it reads."""
    return Path(shutil.copy(tiny_log, tmp_path_factory.mktemp("mrpt") / "scans.log"))


def call(folder: Path, *words: str) -> None:
    """Run a program in a folder: MRPT exports beside the file only if that is named without a folder."""
    done = subprocess.run(words, cwd=folder, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def in_file_order(runs, of_run):
    """What a function gives for each run, one row a scan, in the order of the log."""
    stamps = np.concatenate([run.trajectory.stamps_s for run in runs])
    return np.concatenate([of_run(run) for run in runs])[np.argsort(stamps, kind="stable")]


def test_mrpt_reads_the_same_ranges_and_odometry(scans_log):
    call(scans_log.parent, "carmen2rawlog", "-q", "-i", "scans.log", "-o", "scans.rawlog")
    call(scans_log.parent, "rawlog-edit", "-q", "-i", "scans.rawlog", "--export-txt")
    scans = np.loadtxt(scans_log.parent / "scans_FLASER.txt", comments="%")
    odometry = np.loadtxt(scans_log.parent / "scans_ODOMETRY.txt", comments="%")[:, 1:4]

    runs = read_carmen(scans_log)
    ranges = in_file_order(runs, lambda run: run.read_ranges(0, run.num_scans))
    told = in_file_order(runs, lambda run: run.trajectory.T_world_odom @ run.trajectory.T_odom_robot)
    theirs, valid = np.hsplit(scans[:, 1:], 2)
    assert theirs.shape == ranges.shape
    assert np.array_equal(valid > 0.0, np.isfinite(ranges))
    assert np.abs(theirs - ranges)[valid > 0.0].max() < 1e-3
    assert np.abs(se2.make_motion(*odometry.T) - told).max() < 1e-5


def test_mrpt_reads_the_same_true_poses_of_the_lidar(scans_log):
    call(scans_log.parent, "carmen2simplemap", "-q", "-i", "scans.log", "-o", "scans.simplemap")
    poses = poses_in_stream(gzip.decompress((scans_log.parent / "scans.simplemap").read_bytes()))

    runs = read_carmen(scans_log)
    T_world_lidar = in_file_order(runs, lambda run: run.trajectory.T_world_robot @ run.lidar.pose_on_robot)
    assert len(poses) == 2 * len(T_world_lidar)  # of each scan the robot's by odometry, and the lidar's on the robot
    assert np.abs(poses[0::2] @ poses[1::2] - T_world_lidar).max() < 1e-9


def poses_in_stream(data: bytes) -> np.ndarray:
    """(N, 3, 3) planar part of each pose in MRPT's stream: three coordinates, then a rotation by rows, as doubles."""
    starts = [found.end() for found in re.finditer(rb"mrpt::poses::CPose3D\x03", data)]
    values = np.stack([np.frombuffer(data, dtype="<f8", count=12, offset=start) for start in starts])
    T = np.tile(np.eye(3), (len(values), 1, 1))
    T[:, :2, :2] = values[:, 3:].reshape(-1, 3, 3)[:, :2, :2]
    T[:, :2, 2] = values[:, :2]
    return T
