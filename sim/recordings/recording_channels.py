"""The channels of a recording: schemas and quality of service as ROS 2 wants them in an MCAP file."""

from mcap.writer import Writer

from sim.recordings.recording_messages import schema_text, type_hash

_QOS = """\
- history: 1
  depth: {depth}
  reliability: 1
  durability: {durability}
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
"""
"""Keep last, reliable, automatic liveliness; the values are those of rmw's enumerations."""
_LATCHED = _QOS.format(depth=1, durability=1)
_VOLATILE = _QOS.format(depth=10, durability=2)


class Channels:
    """The file's channels, each registered when it is first used."""

    def __init__(self, writer: Writer) -> None:
        """Begin without channels in a file that has been started or will be."""
        self.writer = writer
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequences: dict[str, int] = {}

    def write(self, topic: str, message_type: str, stamp_ns: int, data: bytes, *, latched: bool = False) -> None:
        """Write one message."""
        if topic not in self._channels:
            self._register(topic, message_type, _LATCHED if latched else _VOLATILE)
        sequence = self._sequences[topic] = self._sequences[topic] + 1
        self.writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns, sequence)

    def _register(self, topic: str, message_type: str, qos: str) -> None:
        if message_type not in self._schemas:
            text = schema_text(message_type)
            self._schemas[message_type] = self.writer.register_schema(message_type, "ros2msg", text)
        metadata = {"offered_qos_profiles": qos, "topic_type_hash": type_hash(message_type)}
        self._channels[topic] = self.writer.register_channel(topic, "cdr", self._schemas[message_type], metadata)
        self._sequences[topic] = 0
