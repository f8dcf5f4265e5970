"""ROS 2 messages as CDR bytes: what a recording says, field by field."""

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from merger import se2
from merger.grid_map import GridMap

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


def pose_array_message(frame: str, stamp_ns: int, poses: Array) -> bytes:
    """PoseArray of (N, 4) x, y, qz, qw."""
    return encode(POSES, header=make_header(stamp_ns, frame), poses=[make_pose(pose) for pose in poses])


def path_message(frame: str, stamp_ns: int, pose_stamps_ns: npt.NDArray[np.int64], poses: Array) -> bytes:
    """Path of (N, 4) x, y, qz, qw at (N,) stamps."""
    stamped = [
        make_message(POSE, header=make_header(int(stamp), frame), pose=make_pose(pose))
        for stamp, pose in zip(pose_stamps_ns, poses, strict=True)
    ]
    return encode(PATH, header=make_header(stamp_ns, frame), poses=stamped)


def transform_message(stamp_ns: int, transforms: list[tuple[str, str, Array]]) -> bytes:
    """TFMessage of transforms (parent, child, (4,) x, y, qz, qw of the child in the parent)."""
    stamped = [
        make_message(
            "geometry_msgs/msg/TransformStamped",
            header=make_header(stamp_ns, parent),
            child_frame_id=child,
            transform=make_message(
                "geometry_msgs/msg/Transform",
                translation=make_message("geometry_msgs/msg/Vector3", x=float(pose[0]), y=float(pose[1]), z=0.0),
                rotation=_quaternion(pose),
            ),
        )
        for parent, child, pose in transforms
    ]
    return encode(TRANSFORMS, transforms=stamped)


def grid_message(frame: str, stamp_ns: int, grid: GridMap) -> bytes:
    """OccupancyGrid: 100 occupied, 0 free, -1 unknown; the origin is that of the grid, yaw included."""
    height, width = grid.log_odds.shape
    cells = np.full((height, width), -1, dtype=np.int8)
    cells[grid.free], cells[grid.occupied] = 0, 100
    info = make_message(
        "nav_msgs/msg/MapMetaData",
        map_load_time=_time(stamp_ns),
        resolution=grid.resolution_m,
        width=width,
        height=height,
        origin=make_pose(planar_poses(grid.T_map_grid)),
    )
    return encode(GRID, header=make_header(stamp_ns, frame), info=info, data=cells.ravel())


def planar_poses(T: Array) -> Array:
    """(..., 4) x, y, qz, qw of (..., 3, 3) motions."""
    half = se2.angle_of(T) / 2.0
    return np.stack([T[..., 0, 2], T[..., 1, 2], np.sin(half), np.cos(half)], axis=-1)


def make_message(message_type: str, **fields: Any) -> Any:
    """A message of a type by its fields."""
    return typestore().types[message_type](**fields)


def encode(message_type: str, **fields: Any) -> bytes:
    """The CDR bytes of a message of a type by its fields."""
    return bytes(typestore().serialize_cdr(make_message(message_type, **fields), message_type))


def _time(stamp_ns: int) -> Any:
    return make_message("builtin_interfaces/msg/Time", sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000)


def make_header(stamp_ns: int, frame: str) -> Any:
    """std_msgs/Header."""
    return make_message("std_msgs/msg/Header", stamp=_time(stamp_ns), frame_id=frame)


def make_pose(pose: Array) -> Any:
    """geometry_msgs/Pose of (4,) x, y, qz, qw."""
    position = make_message("geometry_msgs/msg/Point", x=float(pose[0]), y=float(pose[1]), z=0.0)
    return make_message("geometry_msgs/msg/Pose", position=position, orientation=_quaternion(pose))


def _quaternion(pose: Array) -> Any:
    return make_message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=float(pose[2]), w=float(pose[3]))
