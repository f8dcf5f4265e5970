"""A recording says what the run was, to readers that share no code with its writer."""

import json
import math
import os
import shutil
import subprocess
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from merger import se2
from merger.grid_map import GridMap
from sim.recordings.recording import PlacedSubmap, Recording, write_recording
from sim.recordings.recording_messages import EPOCH_NS, planar_poses

NODE_SCRIPT = Path(__file__).with_name("read_mcap.cjs")
NODE_MODULES = Path(os.environ.get("NODE_PATH", Path(__file__).resolve().parents[3] / "node_modules"))
LATCHED = {"/tf_static", "/map_ground_truth", "/submaps/ground_truth/poses", "/submaps/map_00", "/submaps/map_01"}
LATCHED |= {f"/robot_{k}/{kind}/path" for k in range(2) for kind in ("ground_truth", "odom")}


def grid(name: str, seed: int) -> GridMap:
    cells = np.random.default_rng(seed).choice([-2.0, 0.0, 2.0], (7, 5)).astype(np.float32)
    return GridMap(name, cells, 0.05, se2.make_motion(1.5, -2.5, 0.4 * seed))


@pytest.fixture
def recording(make_runs) -> Recording:
    runs = make_runs(num_robots=2, num_scans=12, num_beams=9)
    places = [se2.make_motion(1.0, 2.0, 0.5), se2.make_motion(-3.0, 0.25, -2.0)]
    submaps = [PlacedSubmap(grid(f"map_{k:02d}", k), places[k], k, 11) for k in range(2)]
    return Recording(runs, submaps, grid("building", 2), {"truth.json": b"{}", "note.txt": b"x"}, {"seed": "3"})


@pytest.fixture
def path(tmp_path, recording) -> Path:
    target = tmp_path / "recording.mcap"
    assert write_recording(target, recording, "test") == 24
    return target


def test_the_file_has_the_profile_schemas_and_indexes_of_ros_2(path, recording):
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        attachments = {a.name: a.data for a in reader.iter_attachments()}
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    assert attachments == dict(recording.attachments)
    assert metadata == {"mapmerge_bench": {"seed": "3"}}


def test_quality_of_service_is_given_in_integers_and_maps_and_fixed_transforms_are_latched(path):
    with path.open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    for channel in channels:
        (profile,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert {type(profile[key]) for key in ("history", "depth", "reliability", "durability", "liveliness")} == {int}
        assert profile["durability"] == (1 if channel.topic in LATCHED else 2)
    assert {channel.topic for channel in channels} == LATCHED | {"/tf"} | {
        f"/robot_{k}/{name}" for k in range(2) for name in ("scan", "odom", "ground_truth/pose")
    }


def messages_by_mcap_ros2(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Every message by the schema in the file alone."""
    found = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message, decoded in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found[channel.topic].append((message.log_time, decoded))
    return found


def test_every_scan_pose_and_transform_is_that_of_the_run(path, recording):
    found = messages_by_mcap_ros2(path)
    for run in recording.runs:
        name, trajectory, ranges = run.trajectory.robot, run.trajectory, run.read_ranges(0, 12)
        scans, odometry = found[f"/{name}/scan"], found[f"/{name}/odom"]
        truth = found[f"/{name}/ground_truth/pose"]
        assert [t for t, _ in scans] == [EPOCH_NS + round(s * 1e9) for s in trajectory.stamps_s]
        for k, ((stamp, scan), (_, odom), (_, pose)) in enumerate(zip(scans, odometry, truth, strict=True)):
            assert np.array_equal(np.array(scan.ranges, dtype=np.float32), ranges[k])
            assert scan.header.stamp.sec * 10**9 + scan.header.stamp.nanosec == stamp
            assert scan.header.frame_id == f"{name}/lidar"
            assert (odom.header.frame_id, odom.child_frame_id) == (f"{name}/odom", f"{name}/base_link")
            assert xyqq(pose.pose) == pytest.approx(planar_poses(trajectory.T_world_robot[k]), abs=1e-15)
            started = trajectory.T_world_robot[0] @ trajectory.T_odom_robot[k]
            assert xyqq(odom.pose.pose) == pytest.approx(planar_poses(started), abs=1e-12)


def test_beam_angles_keep_the_rule_that_slam_toolbox_asks_for(path, recording):
    scan = messages_by_mcap_ros2(path)["/robot_0/scan"][0][1]
    assert len(scan.ranges) == recording.runs[0].lidar.num_beams
    assert scan.angle_max == pytest.approx(scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1), abs=1e-6)
    assert scan.time_increment == pytest.approx(1e-5, rel=1e-6)
    assert math.isinf(scan.ranges[3])


def test_speeds_are_those_of_the_odometry(path, recording):
    trajectory = recording.runs[1].trajectory
    odometry = messages_by_mcap_ros2(path)["/robot_1/odom"]
    steps = se2.log(se2.invert(trajectory.T_odom_robot[:-1]) @ trajectory.T_odom_robot[1:]) / 0.2
    told = [(m.twist.twist.linear.x, m.twist.twist.angular.z) for _, m in odometry]
    assert told[0] == (0.0, 0.0)
    assert np.allclose(told[1:], steps[:, [0, 2]], atol=1e-9)


def test_paths_are_the_whole_ways_by_truth_and_by_odometry(path, recording):
    found = messages_by_mcap_ros2(path)
    for run in recording.runs:
        name, trajectory = run.trajectory.robot, run.trajectory
        for kind, T in (
            ("ground_truth", trajectory.T_world_robot),
            ("odom", trajectory.T_world_odom @ trajectory.T_odom_robot),
        ):
            ((_, message),) = found[f"/{name}/{kind}/path"]
            assert np.allclose([xyqq(pose.pose) for pose in message.poses], planar_poses(T), atol=1e-12)
            assert [pose.header.stamp.nanosec for pose in message.poses] == [
                scan.header.stamp.nanosec for _, scan in found[f"/{name}/scan"]
            ]


def test_maps_and_their_true_places_are_those_of_the_submaps(path, recording):
    found = messages_by_mcap_ros2(path)
    places = {t.child_frame_id: t for t in found["/tf_static"][0][1].transforms}
    poses = found["/submaps/ground_truth/poses"][0][1].poses
    for k, submap in enumerate(recording.submaps):
        ((stamp, message),) = found[f"/submaps/map_{k:02d}"]
        assert stamp == EPOCH_NS + round(recording.runs[k].trajectory.stamps_s[11] * 1e9)
        cells = np.array(message.data).reshape(message.info.height, message.info.width)
        assert np.array_equal(cells == 100, submap.grid.occupied)
        assert np.array_equal(cells == 0, submap.grid.free)
        assert message.header.frame_id == f"submap_{k}"
        assert xyqq(message.info.origin) == pytest.approx(planar_poses(submap.grid.T_map_grid))
        transform = places[f"submap_{k}"].transform
        told = (transform.translation.x, transform.translation.y, transform.rotation.z, transform.rotation.w)
        assert told == pytest.approx(planar_poses(submap.T_world_map))
        assert xyqq(poses[k]) == pytest.approx(planar_poses(submap.T_world_map))


def test_the_transforms_form_one_tree_from_the_world(path):
    found = messages_by_mcap_ros2(path)
    edges = [
        (t.header.frame_id, t.child_frame_id)
        for topic in ("/tf_static", "/tf")
        for _, m in found[topic]
        for t in m.transforms
    ]
    parent = {}
    for a, b in edges:
        assert parent.setdefault(b, a) == a
    for leaf in ("robot_0/lidar", "robot_1/base_link", "submap_1"):
        frame = leaf
        while frame != "world":
            frame = parent[frame]


def test_rosbags_reads_every_message_as_mcap_ros2_does(path):
    found = messages_by_mcap_ros2(path)
    counts: defaultdict[str, int] = defaultdict(int)
    with AnyReader([path]) as reader:
        for connection, stamp, raw in reader.messages():
            message: Any = reader.deserialize(raw, connection.msgtype)
            other_stamp, other = found[connection.topic][counts[connection.topic]]
            counts[connection.topic] += 1
            assert stamp == other_stamp
            assert total(message) == pytest.approx(total(other), rel=1e-12)
    assert counts == {topic: len(stamped) for topic, stamped in found.items()}


def test_foxgloves_reader_reads_every_message_as_mcap_ros2_does(path):
    node = shutil.which("node")
    if node is None or not (NODE_MODULES / "@mcap" / "core").is_dir():
        pytest.skip(
            "node or @mcap/core is not installed: npm install @mcap/core @foxglove/rosmsg "
            "@foxglove/rosmsg2-serialization @foxglove/wasm-zstd, and set NODE_PATH"
        )
    run = subprocess.run(
        [node, str(NODE_SCRIPT), str(path)],
        check=False,
        capture_output=True,
        text=True,
        env={**os.environ, "NODE_PATH": str(NODE_MODULES)},
    )
    assert run.returncode == 0, run.stderr
    report = json.loads(run.stdout)
    found = messages_by_mcap_ros2(path)
    assert report["profile"] == "ros2"
    assert report["attachments"] == ["truth.json", "note.txt"]
    assert set(report["topics"]) == set(found)
    for topic, entry in report["topics"].items():
        stamps = [stamp for stamp, _ in found[topic]]
        assert "durability: " in entry["qos"]
        assert (entry["count"], int(entry["first"]), int(entry["last"])) == (len(stamps), stamps[0], stamps[-1])
        assert entry["total"] == pytest.approx(sum(total(message) for _, message in found[topic]), rel=1e-12, abs=1e-12)


def test_the_same_run_gives_the_same_bytes(path, tmp_path, recording):
    write_recording(tmp_path / "again.mcap", recording, "test")
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()


def test_reading_stops_at_every_chunk_of_scans(tmp_path, recording):
    asked = []

    def watch(run):
        def read(start, stop):
            asked.append(stop - start)
            return run.read_ranges(start % 12, start % 12 + 1).repeat(stop - start, axis=0)

        long = replace(
            run.trajectory,
            stamps_s=np.arange(600) * 0.1,
            T_world_robot=np.tile(np.eye(3), (600, 1, 1)),
            T_odom_robot=np.tile(np.eye(3), (600, 1, 1)),
        )
        return replace(run, trajectory=long, read_ranges=read)

    runs = [watch(run) for run in recording.runs]
    submaps = [replace(submap, last_scan=599) for submap in recording.submaps]
    write_recording(tmp_path / "long.mcap", replace(recording, runs=runs, submaps=submaps), "test")
    assert sum(asked) == 1200
    assert max(asked) <= 256


def xyqq(pose: Any) -> tuple[float, float, float, float]:
    return pose.position.x, pose.position.y, pose.orientation.z, pose.orientation.w


def total(value: Any) -> float:
    """Sum of every finite number in a message but its stamps, whatever its class."""
    if isinstance(value, (int, float, np.number)):
        return float(value) if math.isfinite(value) else 0.0
    if isinstance(value, (str, bytes)):
        return 0.0
    if isinstance(value, np.ndarray):
        return float(value[np.isfinite(value)].astype(np.float64).sum())
    if isinstance(value, (list, tuple, memoryview)):
        return math.fsum(total(item) for item in value)
    names = getattr(value, "__slots__", None) or vars(value)
    return math.fsum(
        total(getattr(value, name))
        for name in names
        if name not in ("stamp", "map_load_time", "__msgtype__", "_type", "_full_text")
    )
