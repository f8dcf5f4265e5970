"""``scans.log``: a dataset's scans in CARMEN's format, so that tools and readers of that format need no converter.

Each scan is three lines: ``ODOM`` (the pose by odometry, which begins at the true start), ``TRUEPOS`` (the true pose,
beside odometry) and ``FLASER``, whose pose is the true pose of the lidar, as the corrected pose of published logs is.
Times are seconds since the run began; the host is the robot's name. Readings: no return is ``robot_front_laser_max``,
too near and invalid are 0.
"""

import heapq
import math
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from merger import se2
from sim.robot_run import LidarSpec, RobotRun

_CHUNK_SCANS = 256
"""Scans of a robot that are in memory at a time."""
_NUM_TEXTS = 100_000
"""Ranges below so many millimetres are written by looking up their text."""
_BEYOND_M = 0.01
"""No return is written as this much more than the farthest range."""


def write_scan_log(path: Path, runs: Sequence[RobotRun], name: str) -> None:
    """Write the scans of all runs in the order of time; `sim.recordings.carmen.read_carmen` gives the same runs back.

    Args:
        path: The file to write.
        runs: Runs with one lidar model (the first one's is described).
        name: Name of the dataset, for the head of the file.
    """
    streams = [_scan_lines(robot, run) for robot, run in enumerate(runs)]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"# {name}: CARMEN log written by mapmerge-bench\n")
        file.write("# message formats defined: PARAM ODOM TRUEPOS FLASER\n")
        file.writelines(f"PARAM {key} {value!r} nohost 0\n" for key, value in _parameters(runs[0].lidar))
        for _, _, lines in heapq.merge(*streams, key=lambda event: event[:2]):
            file.write(lines)


def _parameters(lidar: LidarSpec) -> list[tuple[str, float]]:
    """What the count of beams alone does not say of the lidar."""
    return [
        ("robot_frontlaser_offset", float(lidar.T_robot_lidar[0])),
        ("robot_front_laser_max", _no_return_m(lidar)),
        ("laser_front_laser_resolution", math.degrees(lidar.angle_increment_rad)),
        ("laser_front_laser_start_angle", math.degrees(lidar.angle_min_rad)),
        ("laser_front_laser_range_min", float(lidar.range_min_m)),
        ("laser_front_laser_range_max", float(lidar.range_max_m)),
        ("laser_front_laser_scan_period", float(lidar.scan_period_s)),
        ("laser_front_laser_time_increment", float(lidar.time_increment_s)),
    ]


def _no_return_m(lidar: LidarSpec) -> float:
    return round(lidar.range_max_m + _BEYOND_M, 6)


def _scan_lines(robot: int, run: RobotRun) -> Iterator[tuple[float, int, str]]:
    """Stamp, robot and lines of each scan."""
    trajectory, host = run.trajectory, run.trajectory.robot
    for start in range(0, run.num_scans, _CHUNK_SCANS):
        stop = min(start + _CHUNK_SCANS, run.num_scans)
        true = trajectory.T_world_robot[start:stop]
        poses = [se2.parameters_of(T).tolist() for T in (true, true @ run.lidar.pose_on_robot)]
        odometry = se2.parameters_of(trajectory.T_world_odom @ trajectory.T_odom_robot[start:stop]).tolist()
        readings = _readings(run.read_ranges(start, stop), run.lidar)
        stamps = trajectory.stamps_s[start:stop].tolist()
        for stamp, robot_pose, lidar_pose, odom, reading in zip(stamps, *poses, odometry, readings, strict=True):
            end = f"{stamp!r} {host} {stamp!r}\n"
            odom_words = _words(odom)
            yield (
                stamp,
                robot,
                f"ODOM {odom_words} 0 0 0 {end}TRUEPOS {_words(robot_pose)} {odom_words} {end}"
                f"FLASER {run.lidar.num_beams} {reading} {_words(lidar_pose)} {odom_words} {end}",
            )


def _readings(ranges_m: npt.NDArray[np.float32], lidar: LidarSpec) -> list[str]:
    """(S, B) ranges as one text a scan; each number reads back to the same float32."""
    values = np.where(np.isposinf(ranges_m), np.float32(_no_return_m(lidar)), ranges_m)
    values = np.where(np.isfinite(values), values, np.float32(0.0)).astype(np.float32)
    millimetres = np.rint(values.astype(np.float64) * 1000.0)
    exact = np.array_equal((millimetres / 1000.0).astype(np.float32), values)
    if exact and millimetres.min() >= 0.0 and millimetres.max() < _NUM_TEXTS:
        return _join_words(_millimetre_words()[millimetres.astype(np.int64)])
    return [" ".join([f"{value:.9g}" for value in row]) for row in values.tolist()]


@cache
def _millimetre_words() -> npt.NDArray[np.uint8]:
    """(_NUM_TEXTS, L) metres as text and a space, filled up with zeros: looking up is faster than formatting."""
    words = [f"{k / 1000.0!r} " for k in range(_NUM_TEXTS)]
    return np.array(words, dtype=np.bytes_).view(np.uint8).reshape(_NUM_TEXTS, -1)


def _join_words(words: npt.NDArray[np.uint8]) -> list[str]:
    """One text for each row of (S, B, L) words, as `_millimetre_words` has them."""
    written = words != 0
    text = words[written].tobytes().decode("ascii")
    ends = np.cumsum(np.count_nonzero(written, axis=(1, 2))).tolist()
    return [text[start : end - 1] for start, end in zip([0, *ends], ends, strict=False)]


def _words(values: Sequence[float]) -> str:
    return " ".join(map(repr, values))
