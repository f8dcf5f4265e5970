"""Occupancy grids of a recording: the OccupancyGrid messages of an MCAP file, whoever wrote it."""

import math
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Channel, Message, Schema
from mcap.summary import Summary
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from zstandard import ZstdError

from merger import grid_map, se2
from merger.grid_map import GridMap
from merger.map_server import MapFileError

_GRID_TYPES = ("nav_msgs/msg/OccupancyGrid", "nav_msgs/OccupancyGrid")
_TRUTH_TOPIC = "/map_ground_truth"
"""The true map of the building in our own recordings: no input, as long as there are others."""

_Latest = dict[str, tuple[Schema, Channel, Message]]


def read_recording(path: str | os.PathLike[str]) -> list[GridMap]:
    """Read the latest OccupancyGrid of each topic, decoded by the schema in the file alone.

    A map is named after the last word of its topic, or after all its words where that is not unique. Origin and
    orientation of the grid are honoured.

    Args:
        path: The MCAP file.

    Returns:
        The maps in the order of their topics; `/map_ground_truth` only if there is nothing else.

    Raises:
        MapFileError: the file cannot be read, or holds no usable OccupancyGrid.
    """
    path = Path(path)
    latest = _find_latest(path)
    if len(latest) > 1:
        latest.pop(_TRUTH_TOPIC, None)
    if not latest:
        raise MapFileError(f"{path}: holds no OccupancyGrid message")
    names = _name_topics(sorted(latest))
    return [_decode(path, names[topic], *latest[topic]) for topic in sorted(latest)]


def _find_latest(path: Path) -> _Latest:
    latest: _Latest = {}
    try:
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            topics = _list_grid_topics(reader.get_summary())
            if topics is None:
                stream.seek(0)
                reader = NonSeekingReader(stream, validate_crcs=True)
            for schema, channel, message in reader.iter_messages(topics=topics, log_time_order=False):
                if schema is not None and schema.name in _GRID_TYPES:
                    known = latest.get(channel.topic)
                    if known is None or message.log_time >= known[2].log_time:
                        latest[channel.topic] = (schema, channel, message)
    except FileNotFoundError:
        raise MapFileError(f"{path}: no such file") from None
    except (McapError, ZstdError, OSError, RuntimeError, ValueError, LookupError, OverflowError, struct.error) as error:
        raise MapFileError(f"{path}: not a whole MCAP file ({type(error).__name__})") from None
    return latest


def _list_grid_topics(summary: Summary | None) -> list[str] | None:
    """The topics to read, so that chunks of scans alone are skipped; None, all, for a file without a whole summary."""
    if summary is None or not summary.channels or not summary.schemas:
        return None
    grids = {number for number, schema in summary.schemas.items() if schema.name in _GRID_TYPES}
    return [channel.topic for channel in summary.channels.values() if channel.schema_id in grids]


def _name_topics(topics: list[str]) -> dict[str, str]:
    """The first way to name the topics that gives every one a name of its own."""
    last_words = [topic.rsplit("/", 1)[-1] for topic in topics]
    in_one_word = [topic.strip("/").replace("/", "_") for topic in topics]
    for names in (last_words, in_one_word):
        if len(set(names)) == len(topics) and all(names):
            return dict(zip(topics, names, strict=True))
    return {topic: topic for topic in topics}


def _decode(path: Path, name: str, schema: Schema, channel: Channel, message: Message) -> GridMap:
    if channel.message_encoding != "cdr" or schema.encoding not in ("ros2msg", "ros2idl"):
        raise MapFileError(
            f"{path}: topic {channel.topic} is encoded as {channel.message_encoding} with a schema in "
            f"{schema.encoding or 'no encoding'}; cdr with ros2msg or ros2idl is needed"
        )
    message_type = "nav_msgs/msg/OccupancyGrid"
    try:
        text = schema.data.decode()
        types = get_types_from_idl(text) if schema.encoding == "ros2idl" else get_types_from_msg(text, message_type)
        typestore = get_typestore(Stores.EMPTY)
        typestore.register(types)
        return _grid_from_message(name, typestore.deserialize_cdr(message.data, message_type))
    except (TypesysError, SerdeError, ValueError, AttributeError, LookupError, AssertionError) as error:
        raise MapFileError(f"{path}: topic {channel.topic}: {error or type(error).__name__}") from None


def _grid_from_message(name: str, message: Any) -> GridMap:
    """A grid by nav_msgs/OccupancyGrid: row by row from the lowest y, 0..100 percent, other values unknown."""
    info = message.info
    cells = np.asarray(message.data, dtype=np.int8)
    if cells.size != info.width * info.height or cells.size == 0:
        raise ValueError(f"a grid of {info.width} x {info.height} cells has {cells.size} values")
    cells = cells.reshape(info.height, info.width)
    known = (cells >= 0) & (cells <= 100)
    probability = np.where(known, cells / 100.0, 0.5)
    occupied, free = probability > grid_map.OCCUPIED_PROBABILITY, probability < grid_map.FREE_PROBABILITY
    log_odds = grid_map.log_odds_from_probability(probability, occupied, free)
    # float32 on the wire: 0.05 comes as 0.0500000007, and is meant as 0.05.
    resolution_m = float(str(np.float32(info.resolution)))
    position, q = info.origin.position, info.origin.orientation
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    if not all(math.isfinite(value) for value in (position.x, position.y, yaw)):
        raise ValueError("the grid's origin is not finite")
    return GridMap(name, log_odds, resolution_m, se2.make_motion(position.x, position.y, yaw))
