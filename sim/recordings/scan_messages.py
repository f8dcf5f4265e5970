"""The messages that come with every scan, many at a time: one is encoded, the others are filled in from arrays."""

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.recordings.message_template import MessageTemplate, fill_template, find_values
from sim.recordings.recording_messages import (
    ODOMETRY,
    POSE,
    SCAN,
    Array,
    encode,
    make_header,
    make_message,
    make_pose,
    transform_message,
)
from sim.robot_run import LidarSpec

_MARK = 123456.7
_MARK_NS = 1_123_456_789_987_654_321
_MARK_STAMP = np.array([1_123_456_789, 987_654_321], dtype="<u4").tobytes()
"""Values that mark their places in a template."""


def scan_messages(
    lidar: LidarSpec, frame: str, stamps_ns: npt.NDArray[np.int64], ranges_m: npt.NDArray[np.float32]
) -> list[bytes]:
    """LaserScans of (C, B) ranges by REP 117 at (C,) stamps."""
    return fill_template(
        _scan_template(lidar, frame), [_stamp_bytes(stamps_ns), ranges_m.astype(np.float32, copy=False)]
    )


def odometry_messages(
    frames: tuple[str, str], stamps_ns: npt.NDArray[np.int64], poses: Array, speeds: Array
) -> list[bytes]:
    """Odometry in frames (odom, robot): (C, 4) x, y, qz, qw, and (C, 2) forward and turning speed, m/s and rad/s."""
    return fill_template(_odometry_template(frames), _stamped_columns(stamps_ns, np.hstack([poses, speeds])))


def pose_messages(frame: str, stamps_ns: npt.NDArray[np.int64], poses: Array) -> list[bytes]:
    """PoseStamped of (C, 4) x, y, qz, qw."""
    return fill_template(_pose_template(frame), _stamped_columns(stamps_ns, poses))


def transform_messages(frames: tuple[str, str], stamps_ns: npt.NDArray[np.int64], poses: Array) -> list[bytes]:
    """TFMessage of one transform each, frames (parent, child): (C, 4) x, y, qz, qw of the child in the parent."""
    return fill_template(_transform_template(frames), _stamped_columns(stamps_ns, poses))


@cache
def _scan_template(lidar: LidarSpec, frame: str) -> MessageTemplate:
    marks = np.full(lidar.num_beams, _MARK, dtype=np.float32) + np.arange(lidar.num_beams, dtype=np.float32)
    data = encode(
        SCAN,
        header=make_header(_MARK_NS, frame),
        angle_min=lidar.angle_min_rad,
        angle_max=lidar.angle_max_rad,
        angle_increment=lidar.angle_increment_rad,
        time_increment=lidar.time_increment_s,
        scan_time=lidar.scan_period_s,
        range_min=lidar.range_min_m,
        range_max=lidar.range_max_m,
        ranges=marks,
        intensities=np.zeros(0, dtype=np.float32),
    )
    return find_values(data, [_MARK_STAMP, marks.astype("<f4").tobytes()])


@cache
def _odometry_template(frames: tuple[str, str]) -> MessageTemplate:
    marks = _marks(6)
    twist = make_message(
        "geometry_msgs/msg/Twist",
        linear=make_message("geometry_msgs/msg/Vector3", x=marks[4], y=0.0, z=0.0),
        angular=make_message("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=marks[5]),
    )
    none = np.zeros(36)
    data = encode(
        ODOMETRY,
        header=make_header(_MARK_NS, frames[0]),
        child_frame_id=frames[1],
        pose=make_message("geometry_msgs/msg/PoseWithCovariance", pose=make_pose(marks[:4]), covariance=none),
        twist=make_message("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=none),
    )
    return find_values(data, [_MARK_STAMP, *(mark.tobytes() for mark in marks)])


@cache
def _pose_template(frame: str) -> MessageTemplate:
    marks = _marks(4)
    data = encode(POSE, header=make_header(_MARK_NS, frame), pose=make_pose(marks))
    return find_values(data, [_MARK_STAMP, *(mark.tobytes() for mark in marks)])


@cache
def _transform_template(frames: tuple[str, str]) -> MessageTemplate:
    marks = _marks(4)
    return find_values(
        transform_message(_MARK_NS, [(*frames, marks)]), [_MARK_STAMP, *(mark.tobytes() for mark in marks)]
    )


def _marks(count: int) -> Array:
    """(count,) doubles that no message holds by chance."""
    return np.arange(count, dtype="<f8") + _MARK


def _stamped_columns(stamps_ns: npt.NDArray[np.int64], values: Array) -> list[npt.NDArray[Any]]:
    """Stamps, and each column of (C, K) doubles."""
    return [_stamp_bytes(stamps_ns), *(values[:, k] for k in range(values.shape[1]))]


def _stamp_bytes(stamps_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.uint32]:
    """(C, 2) seconds and nanoseconds as builtin_interfaces/Time holds them."""
    return np.stack([stamps_ns // 1_000_000_000, stamps_ns % 1_000_000_000], axis=-1).astype("<u4")
