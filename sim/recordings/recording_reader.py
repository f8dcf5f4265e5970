"""What a recording says of the truth, read back for checks."""

import struct
from array import array
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from rosbags.serde import SerdeError
from zstandard import ZstdError

from merger import grid_map, se2
from merger.grid_map import GridMap
from sim.recordings.recording_messages import EPOCH_NS, typestore

Array = npt.NDArray[np.float64]

_DAMAGES = (McapError, ZstdError, SerdeError, LookupError, ValueError, OverflowError, AttributeError, struct.error)
"""What reading a damaged recording may end in."""


@dataclass(frozen=True)
class RecordedTruth:
    """Places, maps and true poses in a recording."""

    maps: dict[str, GridMap]
    """The submaps, by name."""
    T_world_submap: Array
    """(N, 3, 3) transforms ``world -> submap_K``."""
    T_world_pose: Array
    """(N, 3, 3) poses of the submaps in the pose array."""
    trajectories: dict[str, tuple[Array, Array]]
    """For each robot (K,) stamps, seconds since the run began, and (K, 3, 3) true poses."""
    num_scans: dict[str, int]
    """Scans of each robot."""
    truth_json: bytes
    """The attachment."""
    config_json: bytes
    """The attachment."""
    metadata: dict[str, str]
    """Name, seed and version of the dataset, and where it came from."""


def read_recorded_truth(path: Path) -> RecordedTruth:
    """Read what a recording says of the truth.

    Raises:
        ValueError: the file is missing, damaged or not a recording of ours.
    """
    try:
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            return _read(reader)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except _DAMAGES as error:
        raise ValueError(f"{path}: not a sound recording ({type(error).__name__}: {error})") from None


def _read(reader: McapReader) -> RecordedTruth:
    maps: dict[str, GridMap] = {}
    poses: defaultdict[str, array[float]] = defaultdict(lambda: array("d"))
    scans: defaultdict[str, int] = defaultdict(int)
    places: dict[int, Array] = {}
    listed = np.zeros((0, 3, 3))
    for schema, channel, message in reader.iter_messages():
        words = channel.topic.strip("/").split("/")
        if words[-1] == "scan":
            scans[words[0]] += 1
            continue
        if channel.topic == "/tf" or words[-1] in ("odom", "path"):
            continue
        decoded: Any = typestore().deserialize_cdr(message.data, schema.name if schema else "")
        if channel.topic == "/tf_static":
            places.update(_submap_places(decoded))
        elif channel.topic == "/submaps/ground_truth/poses":
            listed = np.stack([_pose_motion(pose.position, pose.orientation) for pose in decoded.poses])
        elif words[0] == "submaps":
            maps[words[-1]] = _grid(words[-1], decoded)
        elif words[1:] == ["ground_truth", "pose"]:
            position, quaternion = decoded.pose.position, decoded.pose.orientation
            stamp_s = (message.log_time - EPOCH_NS) / 1e9
            poses[words[0]].extend((stamp_s, position.x, position.y, quaternion.z, quaternion.w))
    attached = {item.name: item.data for item in reader.iter_attachments()}
    return RecordedTruth(
        maps,
        np.stack([places[k] for k in range(len(places))]),
        listed,
        {robot: _trajectory(values) for robot, values in poses.items()},
        dict(scans),
        attached.get("truth.json", b""),
        attached.get("config.json", b""),
        {key: value for item in reader.iter_metadata() for key, value in item.metadata.items()},
    )


def _submap_places(message: Any) -> dict[int, Array]:
    """Places of the submaps by their numbers, from a TFMessage."""
    return {
        int(stamped.child_frame_id.removeprefix("submap_")): _pose_motion(
            stamped.transform.translation, stamped.transform.rotation
        )
        for stamped in message.transforms
        if stamped.child_frame_id.startswith("submap_")
    }


def _trajectory(values: "array[float]") -> tuple[Array, Array]:
    """Stamps and poses of rows stamp, x, y, qz, qw."""
    stamps_s, x, y, qz, qw = np.array(values).reshape(-1, 5).T
    return stamps_s, se2.make_motion(x, y, 2.0 * np.arctan2(qz, qw))


def _pose_motion(position: Any, quaternion: Any) -> Array:
    """(3, 3) motion of a planar pose."""
    return se2.make_motion(position.x, position.y, 2.0 * np.arctan2(quaternion.z, quaternion.w))


def _grid(name: str, message: Any) -> GridMap:
    cells = np.asarray(message.data, dtype=np.int8).reshape(message.info.height, message.info.width)
    log_odds = np.zeros(cells.shape, dtype=np.float32)
    log_odds[cells == 0], log_odds[cells == 100] = grid_map.LOG_ODDS_FREE, grid_map.LOG_ODDS_OCCUPIED
    origin = message.info.origin
    return GridMap(name, log_odds, message.info.resolution, _pose_motion(origin.position, origin.orientation))
