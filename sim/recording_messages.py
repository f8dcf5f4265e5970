"""ROS 2 messages as CDR bytes: what a recording says, field by field."""

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from merger import se2
from merger.grid_map import GridMap
from sim.message_template import MessageTemplate, fill_template, find_values
from sim.robot_run import LidarSpec

EPOCH_NS = 1_000_000_000 * 1_000_000_000
"""Stamp of second 0 of every run: 2001-09-09 01:46:40 UTC. Fixed, so that the same run gives the same bytes."""

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSES = "geometry_msgs/msg/PoseArray"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
GRID = "nav_msgs/msg/OccupancyGrid"
PATH = "nav_msgs/msg/Path"

Array = npt.NDArray[np.float64]
_MARK = 123456.7
_MARK_NS = 1_123_456_789_987_654_321
_MARK_STAMP = np.array([1_123_456_789, 987_654_321], dtype="<u4").tobytes()
"""Values that mark their places in a template."""


def schema_text(message_type: str) -> bytes:
    """Definition of a message type and of all that it uses, as `ros2msg` text."""
    return typestore().generate_msgdef(message_type, ros_version=2)[0].encode()


def type_hash(message_type: str) -> str:
    """The RIHS01 hash by which ROS 2 tells versions of a type apart."""
    return str(typestore().hash_rihs01(message_type))


@cache
def typestore() -> Typestore:
    """The message types of ROS 2 Humble."""
    return get_typestore(Stores.ROS2_HUMBLE)


def stamps_ns(stamps_s: Array) -> npt.NDArray[np.int64]:
    """(N,) nanoseconds since the Unix epoch of (N,) seconds since a run began."""
    return np.rint(stamps_s * 1e9).astype(np.int64) + EPOCH_NS


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


def pose_array_message(frame: str, stamp_ns: int, poses: Array) -> bytes:
    """PoseArray of (N, 4) x, y, qz, qw."""
    return _encode(POSES, header=_header(stamp_ns, frame), poses=[_pose(pose) for pose in poses])


def path_message(frame: str, stamp_ns: int, pose_stamps_ns: npt.NDArray[np.int64], poses: Array) -> bytes:
    """Path of (N, 4) x, y, qz, qw at (N,) stamps."""
    stamped = [
        _make(POSE, header=_header(int(stamp), frame), pose=_pose(pose))
        for stamp, pose in zip(pose_stamps_ns, poses, strict=True)
    ]
    return _encode(PATH, header=_header(stamp_ns, frame), poses=stamped)


def transform_message(stamp_ns: int, transforms: list[tuple[str, str, Array]]) -> bytes:
    """TFMessage of transforms (parent, child, (4,) x, y, qz, qw of the child in the parent)."""
    stamped = [
        _make(
            "geometry_msgs/msg/TransformStamped",
            header=_header(stamp_ns, parent),
            child_frame_id=child,
            transform=_make(
                "geometry_msgs/msg/Transform",
                translation=_make("geometry_msgs/msg/Vector3", x=float(pose[0]), y=float(pose[1]), z=0.0),
                rotation=_quaternion(pose),
            ),
        )
        for parent, child, pose in transforms
    ]
    return _encode(TRANSFORMS, transforms=stamped)


def grid_message(frame: str, stamp_ns: int, grid: GridMap) -> bytes:
    """OccupancyGrid: 100 occupied, 0 free, -1 unknown; the origin is that of the grid, yaw included."""
    height, width = grid.log_odds.shape
    cells = np.full((height, width), -1, dtype=np.int8)
    cells[grid.free], cells[grid.occupied] = 0, 100
    info = _make(
        "nav_msgs/msg/MapMetaData",
        map_load_time=_time(stamp_ns),
        resolution=grid.resolution_m,
        width=width,
        height=height,
        origin=_pose(planar_poses(grid.T_map_grid)),
    )
    return _encode(GRID, header=_header(stamp_ns, frame), info=info, data=cells.ravel())


def planar_poses(T: Array) -> Array:
    """(..., 4) x, y, qz, qw of (..., 3, 3) motions."""
    half = se2.angle_of(T) / 2.0
    return np.stack([T[..., 0, 2], T[..., 1, 2], np.sin(half), np.cos(half)], axis=-1)


@cache
def _scan_template(lidar: LidarSpec, frame: str) -> MessageTemplate:
    marks = np.full(lidar.num_beams, _MARK, dtype=np.float32) + np.arange(lidar.num_beams, dtype=np.float32)
    data = _encode(
        SCAN,
        header=_header(_MARK_NS, frame),
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
    twist = _make(
        "geometry_msgs/msg/Twist",
        linear=_make("geometry_msgs/msg/Vector3", x=marks[4], y=0.0, z=0.0),
        angular=_make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=marks[5]),
    )
    none = np.zeros(36)
    data = _encode(
        ODOMETRY,
        header=_header(_MARK_NS, frames[0]),
        child_frame_id=frames[1],
        pose=_make("geometry_msgs/msg/PoseWithCovariance", pose=_pose(marks[:4]), covariance=none),
        twist=_make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=none),
    )
    return find_values(data, [_MARK_STAMP, *(mark.tobytes() for mark in marks)])


@cache
def _pose_template(frame: str) -> MessageTemplate:
    marks = _marks(4)
    data = _encode(POSE, header=_header(_MARK_NS, frame), pose=_pose(marks))
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


def _make(message_type: str, **fields: Any) -> Any:
    return typestore().types[message_type](**fields)


def _encode(message_type: str, **fields: Any) -> bytes:
    return bytes(typestore().serialize_cdr(_make(message_type, **fields), message_type))


def _time(stamp_ns: int) -> Any:
    return _make("builtin_interfaces/msg/Time", sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000)


def _header(stamp_ns: int, frame: str) -> Any:
    return _make("std_msgs/msg/Header", stamp=_time(stamp_ns), frame_id=frame)


def _pose(pose: Array) -> Any:
    position = _make("geometry_msgs/msg/Point", x=float(pose[0]), y=float(pose[1]), z=0.0)
    return _make("geometry_msgs/msg/Pose", position=position, orientation=_quaternion(pose))


def _quaternion(pose: Array) -> Any:
    return _make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=float(pose[2]), w=float(pose[3]))
