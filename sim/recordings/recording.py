"""``recording.mcap``: a whole run as ROS 2 messages, written as it is produced.

Frames: ``world`` (truth), ``robot_N/odom``, ``robot_N/base_link``, ``robot_N/lidar``, ``submap_K``. The tree
``world -> robot_N/odom -> robot_N/base_link`` follows odometry, which begins at the robot's true start (so that
tools that compare it with the truth need no alignment) and then drifts; the true poses are on
``/robot_N/ground_truth/pose``. MCAP: profile ros2, CDR, chunks compressed by zstd, indexed; see mcap.dev/spec.
"""

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from merger import se2
from merger.grid_map import GridMap
from sim.recordings import recording_messages as messages
from sim.recordings import scan_messages
from sim.recordings.recording_channels import Channels
from sim.recordings.recording_messages import EPOCH_NS
from sim.robot_run import RobotRun

_CHUNK_SCANS = 256
"""Scans of a robot that are in memory at a time."""
_PATH_POSES = 2000
"""Poses of a path at most."""


@dataclass(frozen=True)
class PlacedSubmap:
    """A submap, and when and where it belongs."""

    grid: GridMap
    """The map."""
    T_world_map: "messages.Array"
    """(3, 3) its true place."""
    robot: int
    """Index of the run that made it."""
    last_scan: int
    """Index of its last scan; the map is published with it."""


@dataclass(frozen=True)
class Recording:
    """What a recording holds."""

    runs: Sequence[RobotRun]
    """One for each robot."""
    submaps: Sequence[PlacedSubmap]
    """The submaps, by name."""
    ground_truth: GridMap
    """The true map of the building, in frame ``world``."""
    attachments: Mapping[str, bytes] = field(default_factory=dict)
    """Files to be attached, by name."""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """Provenance."""


def write_recording(path: Path, recording: Recording, library: str) -> int:
    """Write a recording; memory does not grow with its length.

    Args:
        path: The file to write.
        recording: What it holds.
        library: Name and version of the writer, for the file's header.

    Returns:
        The number of scans.
    """
    with path.open("wb") as file:
        channels = Channels(Writer(file, compression=CompressionType.ZSTD))
        channels.writer.start(profile="ros2", library=library)
        channels.writer.add_metadata("mapmerge_bench", dict(recording.metadata))
        for name, data in recording.attachments.items():
            media_type = "application/json" if name.endswith(".json") else "text/plain"
            channels.writer.add_attachment(EPOCH_NS, EPOCH_NS, name, media_type, data)
        _write_static(channels, recording)
        num_scans = _write_runs(channels, recording)
        channels.writer.finish()  # type: ignore[no-untyped-call] # mcap does not say that it returns None
    return num_scans


def submap_topic(name: str) -> str:
    """Topic of a submap's grid; its last word is the map's name."""
    return f"/submaps/{name}"


def _write_static(channels: Channels, recording: Recording) -> None:
    """Everything that holds from the beginning: fixed transforms, true places, the building's map."""
    poses = messages.planar_poses(np.stack([submap.T_world_map for submap in recording.submaps]))
    transforms = [("world", f"submap_{k}", pose) for k, pose in enumerate(poses)]
    for run in recording.runs:
        name = run.trajectory.robot
        transforms.append(("world", f"{name}/odom", messages.planar_poses(np.eye(3))))
        transforms.append((f"{name}/base_link", f"{name}/lidar", messages.planar_poses(run.lidar.pose_on_robot)))
    data = messages.transform_message(EPOCH_NS, transforms)
    channels.write("/tf_static", messages.TRANSFORMS, EPOCH_NS, data, latched=True)
    data = messages.grid_message("world", EPOCH_NS, recording.ground_truth)
    channels.write("/map_ground_truth", messages.GRID, EPOCH_NS, data, latched=True)
    data = messages.pose_array_message("world", EPOCH_NS, poses)
    channels.write("/submaps/ground_truth/poses", messages.POSES, EPOCH_NS, data, latched=True)
    for run in recording.runs:
        _write_paths(channels, run)


def _write_paths(channels: Channels, run: RobotRun) -> None:
    """The whole true way and the whole way by odometry, thinned out, for those who look at them."""
    trajectory = run.trajectory
    every = slice(None, None, math.ceil(run.num_scans / _PATH_POSES))
    stamps = messages.stamps_ns(trajectory.stamps_s[every])
    told = trajectory.T_world_odom @ trajectory.T_odom_robot[every]
    for name, frame, T in (
        ("ground_truth/path", "world", trajectory.T_world_robot[every]),
        ("odom/path", f"{trajectory.robot}/odom", told),
    ):
        data = messages.path_message(frame, EPOCH_NS, stamps, messages.planar_poses(T))
        channels.write(f"/{trajectory.robot}/{name}", messages.PATH, EPOCH_NS, data, latched=True)


def _write_runs(channels: Channels, recording: Recording) -> int:
    """Scans, poses and finished submaps, in the order of time; returns the number of scans."""
    due: dict[tuple[int, int], list[int]] = {}
    for k, submap in enumerate(recording.submaps):
        due.setdefault((submap.robot, submap.last_scan), []).append(k)
    topics = [_topics(run.trajectory.robot) for run in recording.runs]
    streams = [_encode_run(robot, run) for robot, run in enumerate(recording.runs)]
    num_scans = 0
    for stamp_ns, robot, scan, encoded in heapq.merge(*streams, key=lambda event: event[:3]):
        for (topic, message_type), data in zip(topics[robot], encoded, strict=True):
            channels.write(topic, message_type, stamp_ns, data)
        for k in due.get((robot, scan), []):
            grid = recording.submaps[k].grid
            data = messages.grid_message(f"submap_{k}", stamp_ns, grid)
            channels.write(submap_topic(grid.name), messages.GRID, stamp_ns, data, latched=True)
        num_scans += 1
    return num_scans


def _topics(robot: str) -> tuple[tuple[str, str], ...]:
    """Topic and type of the messages that go with each scan."""
    return (
        ("/tf", messages.TRANSFORMS),
        (f"/{robot}/odom", messages.ODOMETRY),
        (f"/{robot}/ground_truth/pose", messages.POSE),
        (f"/{robot}/scan", messages.SCAN),
    )


def _encode_run(robot: int, run: RobotRun) -> Iterator[tuple[int, int, int, tuple[bytes, ...]]]:
    """Stamp, robot, scan and the messages (by `_topics`) of each scan of a run, in the run's order."""
    trajectory, name = run.trajectory, run.trajectory.robot
    odom, base, lidar = f"{name}/odom", f"{name}/base_link", f"{name}/lidar"
    for start in range(0, run.num_scans, _CHUNK_SCANS):
        stop = min(start + _CHUNK_SCANS, run.num_scans)
        ranges = run.read_ranges(start, stop)
        stamps = messages.stamps_ns(trajectory.stamps_s[start:stop])
        truth = messages.planar_poses(trajectory.T_world_robot[start:stop])
        estimate = messages.planar_poses(trajectory.T_world_odom @ trajectory.T_odom_robot[start:stop])
        encoded = zip(
            scan_messages.transform_messages((odom, base), stamps, estimate),
            scan_messages.odometry_messages((odom, base), stamps, estimate, _speeds(run, start, stop)),
            scan_messages.pose_messages("world", stamps, truth),
            scan_messages.scan_messages(run.lidar, lidar, stamps, ranges),
            strict=True,
        )
        for scan, (stamp, data) in enumerate(zip(stamps.tolist(), encoded, strict=True), start=start):
            yield stamp, robot, scan, data


def _speeds(run: RobotRun, start: int, stop: int) -> messages.Array:
    """(stop - start, 2) forward (m/s) and turning (rad/s) speed by odometry since the scan before; 0 for the first."""
    first = max(start - 1, 0)
    T = run.trajectory.T_odom_robot[first:stop]
    steps = se2.log(se2.invert(T[:-1]) @ T[1:])[:, [0, 2]]
    seconds = np.diff(run.trajectory.stamps_s[first:stop])[:, None]
    rates = np.divide(steps, seconds, out=np.zeros_like(steps), where=seconds > 0.0)
    return rates if start else np.concatenate([np.zeros((1, 2)), rates])
