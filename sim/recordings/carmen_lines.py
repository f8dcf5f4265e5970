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
    """The PARAM lines."""
    robots: dict[str, LoggedScans] = field(default_factory=dict)
    """By robot; one alone is ``robot_0``."""


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
    if not log.robots:
        raise LogError(f"{path}: the log holds no scan (no FLASER line)")
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
        pose = _finite(words[2 + count : 8 + count])
        scans = log.robots.setdefault(_robot_of(words[9 + count]), LoggedScans())
        scans.ranges_m.append(_readings(words[2 : 2 + count]))
        scans.lidar_pose.append(pose[:3])
        scans.odometry.append(pose[3:])
        scans.stamps_s.append(_finite(words[8 + count : 9 + count])[0])
        if len(scans.ranges_m[0]) != count:
            raise ValueError(f"{count} readings after scans of {len(scans.ranges_m[0])}")
    elif words[0] == "TRUEPOS" and len(words) >= 9:
        values = _finite(words[1:8])
        log.robots.setdefault(_robot_of(words[8]), LoggedScans()).true_pose[values[6]] = values[:3]


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
