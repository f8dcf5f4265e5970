"""CARMEN logs as robot runs: real ones as they are published, and the ``scans.log`` of our own datasets.

Lines that count: ``FLASER n r1..rn x y theta odom_x odom_y odom_theta ipc_time host logger_time`` (a scan with the
pose of the lidar, corrected by SLAM in published logs, and of the robot by odometry), ``TRUEPOS true_x true_y
true_theta odom_x odom_y odom_theta ipc_time host logger_time`` (the true pose of the robot), ``PARAM name value``.
Where no line is FLASER: ``ROBOTLASER1 type start_angle field_of_view step range_max accuracy mode n r1..rn m e1..em``
(readings and remissions), both poses as above, five numbers about safety, and the times. Scans keep the file's order,
even where their times do not.
"""

import dataclasses
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from merger import se2
from sim.recordings.carmen_lines import LogError, LoggedScans, parse_log
from sim.robot_run import LidarSpec, RobotRun, Trajectory

_KNOWN_MAXIMA_M = (81.83, 50.0)
"""What the lidars of published logs report when nothing is in reach."""
_SATURATED_SHARE = (0.001, 0.9)
_SATURATED_COUNT = 100
_SATURATED_M = 4.0
"""A largest reading this far out, of which there are so many and such a share, is the sensor's maximum, not a wall."""
_ROUNDING_M = 1e-4
"""Two readings this close are the same one, written differently."""


def read_carmen(path: Path) -> list[RobotRun]:
    """Read a log, gzipped or not: one run for each robot.

    True poses are the TRUEPOS lines where each scan has one of its time, else the scans' corrected poses (the pose on
    the robot is then unknown, and taken as none). Odometry is that of the scans' lines; where it only repeats the
    corrected poses (published corrected logs) the run's odometry repeats the truth. Stamps count from the earliest
    scan. Angles of the beams: by the log's parameters, else 180 degrees by `beam_angles`.

    Raises:
        LogError: the file is missing, cannot be read, holds no scan, or a line of it is malformed.
    """
    log = parse_log(path)
    start_s = min(min(scans.stamps_s) for scans in log.robots.values())
    return [
        _make_run(path, name, log.robots[name], log.parameters, start_s)
        for name in sorted(log.robots, key=_robot_order)
    ]


def beam_angles(num_beams: int) -> tuple[float, float]:
    """First angle and increment, radians, of a lidar that sees 180 degrees and says no more than its beam count.

    Even counts leave out the end point (180 beams: 1 degree, 360: 0.5), odd counts include it (181, 361).
    """
    steps = num_beams if num_beams % 2 == 0 else max(num_beams - 1, 1)
    return -math.pi / 2.0, math.pi / steps


def no_return_reading(ranges_m: npt.NDArray[np.float32]) -> float:
    """The reading, in metres, at and above which (N, B) readings of a log are no return; +inf if there is none.

    A known sensor maximum (81.83, 50) that the log reaches, else its largest reading if that one is frequent.
    """
    known = _known_maximum(ranges_m)
    if math.isfinite(known):
        return known
    largest = float(ranges_m.max())
    count = int(np.count_nonzero(ranges_m >= np.float32(largest - _ROUNDING_M)))
    low, high = _SATURATED_SHARE
    saturated = low <= count / ranges_m.size <= high and count >= _SATURATED_COUNT and largest >= _SATURATED_M
    return largest if saturated else math.inf


def _known_maximum(ranges_m: npt.NDArray[np.float32]) -> float:
    """The known sensor maximum that (N, B) readings reach; +inf if they reach none."""
    largest = float(ranges_m.max())
    return next((known for known in _KNOWN_MAXIMA_M if known - _ROUNDING_M <= largest <= known + 0.1), math.inf)


def _robot_order(name: str) -> int:
    return int(name.removeprefix("robot_"))


def _make_run(path: Path, name: str, scans: LoggedScans, parameters: dict[str, str], start_s: float) -> RobotRun:
    """The run of one robot, its readings by REP 117."""
    readings = np.stack(scans.ranges_m)
    # Logs state maxima like 81.9 and 82, and mean 81.83.
    told = _parameter(path, parameters, "robot_front_laser_max", no_return_reading(readings))
    limit = min(told, _known_maximum(readings))
    ranges = np.where(readings >= np.float32(limit - _ROUNDING_M), np.float32(np.inf), readings)
    ranges[readings <= 0.0] = -np.inf
    T_world_lidar = se2.make_motion(*np.array(scans.lidar_pose).T)
    T_world_robot, mounting = _true_poses(scans, T_world_lidar)
    T_odom = se2.make_motion(*np.array(scans.odometry).T)
    stamps = np.array(scans.stamps_s) - start_s
    trajectory = Trajectory(name, stamps, T_world_robot, se2.invert(T_odom[0]) @ T_odom)
    limit = limit if math.isfinite(limit) else float(readings.max())
    lidar = _lidar(path, parameters, readings.shape[1], limit, _period(stamps))
    return RobotRun(
        trajectory, dataclasses.replace(lidar, T_robot_lidar=mounting), lambda start, stop: ranges[start:stop]
    )


def _true_poses(
    scans: LoggedScans, T_world_lidar: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float64], tuple[float, float, float]]:
    """(N, 3, 3) true poses of the robot, and the lidar's pose on it as x_m, y_m, theta_rad."""
    if not all(stamp in scans.true_pose for stamp in scans.stamps_s):
        return T_world_lidar, (0.0, 0.0, 0.0)
    T_world_robot = se2.make_motion(*np.array([scans.true_pose[stamp] for stamp in scans.stamps_s]).T)
    x, y, theta = np.round(se2.parameters_of(se2.invert(T_world_robot[0]) @ T_world_lidar[0]), 6)
    return T_world_robot, (float(x), float(y), float(theta))


def _lidar(path: Path, parameters: dict[str, str], num_beams: int, limit_m: float, period_s: float) -> LidarSpec:
    """The lidar by the log's parameters (most of them only in logs of ours) and the rule of counts."""
    first, increment = beam_angles(num_beams)
    resolution = _parameter(path, parameters, "laser_front_laser_resolution", math.degrees(increment))
    centred = math.degrees(first) * math.radians(resolution) / increment
    return LidarSpec(
        num_beams,
        math.radians(_parameter(path, parameters, "laser_front_laser_start_angle", centred)),
        math.radians(resolution),
        _parameter(path, parameters, "laser_front_laser_range_min", 0.0),
        _parameter(path, parameters, "laser_front_laser_range_max", limit_m),
        _parameter(path, parameters, "laser_front_laser_scan_period", period_s),
        _parameter(path, parameters, "laser_front_laser_time_increment", 0.0),
    )


def _period(stamps_s: npt.NDArray[np.float64]) -> float:
    """The median time between two scans, for those who ask; logs have no fixed one."""
    steps = np.diff(stamps_s)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else 0.1


def _parameter(path: Path, parameters: dict[str, str], name: str, default: float) -> float:
    try:
        value = float(parameters.get(name, default))
    except ValueError:
        value = math.nan
    positive = name in ("laser_front_laser_resolution", "robot_front_laser_max")
    if math.isnan(value) or (positive and value <= 0.0):
        raise LogError(f"{path}: PARAM {name} must be a number{' > 0' * positive}, got '{parameters.get(name)}'")
    return value
