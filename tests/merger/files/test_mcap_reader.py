import json

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from merger import se2
from merger.__main__ import main
from merger.files.mcap_reader import read_recording
from merger.grid_map import GridMap
from merger.map_server import MapFileError, write_map

_PAPER = ["--method", "paper", "--workers", "1"]


def _result(out):
    return json.loads((out / "result.json").read_text())


def _write_recording(path, grids, library="someone", **options):
    """OccupancyGrids ``{topic: [GridMap, ...]}``, the latest last, as ROS 2 would record them."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = "nav_msgs/msg/OccupancyGrid"
    make = store.types
    stamp = make["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2", library=library)
        text = store.generate_msgdef(kind, ros_version=2)[0].encode()
        schema = writer.register_schema(name=kind, encoding="ros2msg", data=text)
        for topic, versions in grids.items():
            channel = writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
            # The latest by its stamp comes first in the file.
            for number, grid in reversed(list(enumerate(versions))):
                x, y, yaw = se2.parameters_of(grid.T_map_grid)
                pose = make["geometry_msgs/msg/Pose"](
                    make["geometry_msgs/msg/Point"](x, y, 0.0),
                    make["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)),
                )
                rows, cols = grid.log_odds.shape
                info = make["nav_msgs/msg/MapMetaData"](stamp, grid.resolution_m, cols, rows, pose)
                data = np.where(grid.occupied, 100, np.where(grid.free, 0, -1)).astype(np.int8).ravel()
                message = make[kind](make["std_msgs/msg/Header"](stamp, "map"), info, data)
                encoded = bytes(store.serialize_cdr(message, kind))
                writer.add_message(channel, log_time=number, publish_time=number, data=encoded)
        writer.finish()


def test_a_recording_is_merged_as_its_maps_are(three_maps, cut_map, tmp_path):
    west = cut_map("west", (0.0, 13.0), three_maps[1]["west"], yaw_rad=0.8)
    stale = GridMap("west", west.log_odds[:5, :5], 0.1)
    maps = [west, *three_maps[0][1:]]
    topics = {f"/submaps/{grid.name}": [grid] for grid in maps}
    topics["/submaps/west"].insert(0, stale)
    topics["/map_ground_truth"] = [maps[2]]
    _write_recording(tmp_path / "recording.mcap", topics)
    read = {grid.name: grid for grid in read_recording(tmp_path / "recording.mcap")}
    assert set(read) == {"east", "middle", "west"}
    assert np.allclose(read["west"].T_map_grid, west.T_map_grid)
    assert read["west"].resolution_m == 0.1
    assert (read["west"].occupied == west.occupied).all()
    assert (read["west"].free == west.free).all()
    assert main([str(tmp_path / "recording.mcap"), "--out", str(tmp_path / "a"), *_PAPER, "--quiet"]) == 0
    files = tmp_path / "files"
    files.mkdir()
    for grid in maps:
        write_map(files / f"{grid.name}.yaml", grid)
    assert main([str(files), "--out", str(tmp_path / "b"), *_PAPER, "--quiet"]) == 0
    placements = [_result(tmp_path / name)["maps"] for name in "ab"]
    for name in read:
        for key in ("x", "y", "theta"):
            first, second = (maps_[name]["T_ref_map"][key] for maps_ in placements)
            assert first == pytest.approx(second, abs=1e-6)


def test_topics_with_the_same_last_word_give_whole_topics_as_names(three_maps, tmp_path):
    topics = {"/robot_1/map": [three_maps[0][0]], "/robot_2/map": [three_maps[0][1]]}
    _write_recording(tmp_path / "r.mcap", topics)
    assert [grid.name for grid in read_recording(tmp_path / "r.mcap")] == ["robot_1_map", "robot_2_map"]


@pytest.mark.parametrize("topics", [["/a/b/map", "/a_b/map"], ["/", "/map"]])
def test_every_topic_gives_a_map_of_its_own_name(three_maps, tmp_path, topics):
    _write_recording(tmp_path / "r.mcap", {topic: [three_maps[0][0]] for topic in topics})
    assert [grid.name for grid in read_recording(tmp_path / "r.mcap")] == topics


@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0", b"\0\1\0\0" + 400 * b"\xff"])
def test_a_message_that_is_no_grid_is_refused_by_its_topic(tmp_path, payload):
    with (tmp_path / "r.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        text = get_typestore(Stores.ROS2_HUMBLE).generate_msgdef("nav_msgs/msg/OccupancyGrid", ros_version=2)[0]
        schema = writer.register_schema(name="nav_msgs/msg/OccupancyGrid", encoding="ros2msg", data=text.encode())
        channel = writer.register_channel(topic="/a", message_encoding="cdr", schema_id=schema)
        writer.add_message(channel, log_time=0, publish_time=0, data=payload)
        writer.finish()
    with pytest.raises(MapFileError, match=r"r\.mcap: topic /a: "):
        read_recording(tmp_path / "r.mcap")


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.LZ4},
        {"use_chunking": False},
        {"repeat_schemas": False, "repeat_channels": False},
        {"repeat_schemas": False},
    ],
)
def test_recordings_are_read_however_they_are_packed(three_maps, tmp_path, options):
    _write_recording(tmp_path / "r.mcap", {"/a": [three_maps[0][0]], "/b": [three_maps[0][1]]}, **options)
    assert [grid.name for grid in read_recording(tmp_path / "r.mcap")] == ["a", "b"]


def test_the_true_map_alone_is_a_map_like_any_other(three_maps, tmp_path):
    _write_recording(tmp_path / "r.mcap", {"/map_ground_truth": [three_maps[0][0]]})
    assert [grid.name for grid in read_recording(tmp_path / "r.mcap")] == ["map_ground_truth"]


def test_a_recording_without_grids_is_refused(tmp_path, capsys):
    _write_recording(tmp_path / "r.mcap", {})
    assert main([str(tmp_path / "r.mcap"), "--out", str(tmp_path / "out"), *_PAPER]) == 2
    assert "r.mcap: holds no OccupancyGrid message" in capsys.readouterr().err


def test_a_recording_that_breaks_off_is_refused(three_maps, tmp_path, capsys):
    _write_recording(tmp_path / "r.mcap", {"/a": [three_maps[0][0]]})
    data = (tmp_path / "r.mcap").read_bytes()
    (tmp_path / "r.mcap").write_bytes(data[: len(data) // 2])
    assert main([str(tmp_path / "r.mcap"), "--out", str(tmp_path / "out"), *_PAPER]) == 2
    assert "r.mcap: not a whole MCAP file" in capsys.readouterr().err


def _read_or_fault(path):
    try:
        return len(read_recording(path))
    except MapFileError as error:
        return str(error)


@pytest.mark.parametrize("place", [0.3, 0.6, 0.97])
def test_a_damaged_recording_is_refused_or_read_but_never_breaks_the_reader(three_maps, tmp_path, place):
    path = tmp_path / "r.mcap"
    _write_recording(path, {"/a": [three_maps[0][0]], "/b": [three_maps[0][1]]})
    data = bytearray(path.read_bytes())
    for offset in range(6):
        data[int(place * len(data)) + 3 * offset] ^= 0x5A
    path.write_bytes(data)
    answer = _read_or_fault(path)
    assert answer == 2 or answer.startswith(f"{path}: ")
