"""The lines of a CARMEN log: what they say of scans, true poses and parameters, still as the file has it."""

import gzip
import math
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

_OWN_ROBOT = re.compile(r"robot_\d+")
"""Host names that tell several robots of one log apart."""


class LogError(ValueError):
    """A log cannot be used; the message is one line that names the file and the fault."""


@dataclass
class LoggedScans:
    """What has been read of one robot."""

    ranges_m: list[npt.NDArray[np.float32]] = field(default_factory=list)
    """(B,) readings of each scan, metres."""
    lidar_pose: list[tuple[float, ...]] = field(default_factory=list)
    """x, y, theta of each scan's first pose."""
    odometry: list[tuple[float, ...]] = field(default_factory=list)
    """x, y, theta of each scan's second pose."""
    stamps_s: list[float] = field(default_factory=list)
    """Time of each scan."""
    true_pose: dict[float, tuple[float, ...]] = field(default_factory=dict)
    """x, y, theta of the TRUEPOS lines, by their times."""


@dataclass
class CarmenLog:
    """What has been read of a log."""

    parameters: dict[str, str] = field(default_factory=dict)
    """The PARAM lines; where ROBOTLASER1 lines are read, what the last one says of its lidar."""
    robots: dict[str, LoggedScans] = field(default_factory=dict)
    """The FLASER lines by robot; one alone is ``robot_0``."""
    newer: LoggedScans = field(default_factory=LoggedScans)
    """The ROBOTLASER1 lines, which later versions of CARMEN write, some besides the FLASER lines of the same scans."""
    newer_lidar: dict[str, str] = field(default_factory=dict)
    """What the last of them says of its lidar, as PARAM lines would."""


def parse_log(path: Path) -> CarmenLog:
    """Read the lines of a log, gzipped or not.

    Raises:
        LogError: the file is missing, cannot be read, holds no scan, or a line of it is malformed.
    """
    log = CarmenLog()
    for number, words in _read_lines(path):
        try:
            _add_line(words, log)
        except (ValueError, IndexError) as error:
            raise LogError(f"{path}: line {number}: malformed {words[0]} line ({error})") from None
    log.robots = {name: scans for name, scans in log.robots.items() if scans.ranges_m}
    if not log.robots and log.newer.ranges_m:
        log.robots = {"robot_0": log.newer}
        log.parameters.update(log.newer_lidar)
    if not log.robots:
        raise LogError(f"{path}: the log holds no scan (no FLASER or ROBOTLASER1 line)")
    return log


def _read_lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and words of each line, not counting comments and empty ones."""
    try:
        with path.open("rb") as start:
            compressed = start.read(2) == b"\x1f\x8b"
        with gzip.open(path, "rb") if compressed else path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                words = line.decode("utf-8", errors="replace").split()
                if words and not words[0].startswith("#"):
                    yield number, words
    except FileNotFoundError:
        raise LogError(f"{path}: no such file") from None
    except (OSError, EOFError, zlib.error) as error:
        raise LogError(f"{path}: cannot be read ({' '.join(str(error).split()) or type(error).__name__})") from None


def _add_line(words: list[str], log: CarmenLog) -> None:
    """Store what one line says."""
    if words[0] == "PARAM" and len(words) >= 3:
        log.parameters[words[1]] = words[2]
    elif words[0] == "FLASER":
        count = int(words[1])
        if count < 1 or len(words) < count + 11:
            raise ValueError(f"{count} readings need at least {count + 11} fields, got {len(words)}")
        scans = log.robots.setdefault(_robot_of(words[9 + count]), LoggedScans())
        _add_scan(scans, words[2 : 2 + count], words[2 + count : 9 + count])
    elif words[0] == "ROBOTLASER1":
        _add_newer_line(words, log)
    elif words[0] == "TRUEPOS" and len(words) >= 9:
        values = _finite(words[1:8])
        log.robots.setdefault(_robot_of(words[8]), LoggedScans()).true_pose[values[6]] = values[:3]


def _add_newer_line(words: list[str], log: CarmenLog) -> None:
    """Store a scan that names its lidar: after readings and remissions the poses of lidar and robot, and the time."""
    count = int(words[8])
    after = words[10 + count + int(words[9 + count]) :] if count >= 1 else []
    if len(after) < 12:
        raise ValueError(f"{count} readings need more fields than {len(words)}")
    first_rad, _, step_rad, max_m = _finite(words[2:6])
    log.newer_lidar = {
        "laser_front_laser_start_angle": str(math.degrees(first_rad)),
        "laser_front_laser_resolution": str(math.degrees(step_rad)),
        "robot_front_laser_max": str(max_m),
    }
    _add_scan(log.newer, words[9 : 9 + count], [*after[:6], after[11]])


def _add_scan(scans: LoggedScans, readings: list[str], numbers: list[str]) -> None:
    """Add a scan: its readings, then x, y, theta of both poses and the time."""
    *poses, stamp_s = _finite(numbers)
    scans.ranges_m.append(_readings(readings))
    scans.lidar_pose.append(tuple(poses[:3]))
    scans.odometry.append(tuple(poses[3:]))
    scans.stamps_s.append(stamp_s)
    if len(scans.ranges_m[0]) != len(readings):
        raise ValueError(f"{len(readings)} readings after scans of {len(scans.ranges_m[0])}")


def _robot_of(host: str) -> str:
    return host if _OWN_ROBOT.fullmatch(host) else "robot_0"


def _finite(words: list[str]) -> tuple[float, ...]:
    values = tuple(float(word) for word in words)
    if not all(math.isfinite(value) for value in values):
        raise ValueError("a value is not finite")
    return values


def _readings(words: list[str]) -> npt.NDArray[np.float32]:
    ranges = np.array(words, dtype=np.float32)
    if np.isnan(ranges).any():
        raise ValueError("a reading is not a number")
    return ranges
