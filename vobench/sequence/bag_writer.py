"""Writing one MCAP file in ROS 2 form: in order of time, and whole or not at all."""

import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from mcap.writer import CompressionType, Writer

from vobench import stop
from vobench.errors import SequenceError
from vobench.sequence.mcap_file import NO_CHANNEL, part_of
from vobench.sequence.message_type import TYPES
from vobench.sequence.topic import Topic
from vobench.trajectory.nanoseconds import NS_PER_S

PROFILE = "ros2"
SCHEMA_ENCODING = "ros2msg"
MESSAGE_ENCODING = "cdr"
# A chunk ends when it is as large or as long as this: it is all that a killed writer loses.
CHUNK_BYTES = 1 << 20
CHUNK_NS = NS_PER_S
UNLIMITED_BYTES = 1 << 62  # with a limit, the library would end chunks between two pictures of one instant
NOTE_CHECKSUM = "vobench.crc32"  # the key of a note's checksum among its entries

# A late listener still gets the last message; rosbag2 reads this to replay /tf_static as ROS publishes it.
LATCHED_QOS = """\
- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write that gets its name when the context ends without an error, and is removed after one."""
    part = part_of(path)
    with stop.cleanup_after(lambda: part.unlink(missing_ok=True)):
        with part.open("wb") as stream:
            yield stream
        part.replace(path)


def note_checksum(entries: Mapping[str, str]) -> str:
    """The CRC-32 of a note's entries, without the checksum itself."""
    content = repr(sorted(entries.items()))
    return f"{zlib.crc32(content.encode()):08x}"


@cache
def _definition(type_name: str) -> bytes:
    definition, _ = TYPES.generate_msgdef(type_name, ros_version=2)
    return definition.encode()


@cache
def _type_hash(type_name: str) -> str:
    return TYPES.hash_rihs01(type_name)


class BagWriter:
    """Writes one bag under a temporary name and renames it when closed without an error."""

    def __init__(
        self,
        path: Path,
        topics: Sequence[Topic],
        *,
        encoded: bool,
    ) -> None:
        """A bag of `encoded` pictures keeps the messages of one stamp in one chunk, to be lost or kept together.

        Its chunks are not compressed, as PNG does not get smaller. Raw pictures are compressed, and large ones have a
        chunk of their own, so that one topic can be read without the others.
        """
        self.path = path
        self._together = encoded
        self._stack = ExitStack()
        stream = self._stack.enter_context(replacing(path))
        compression = CompressionType.NONE if encoded else CompressionType.ZSTD
        self._mcap = Writer(stream, chunk_size=UNLIMITED_BYTES, compression=compression)
        self._mcap.start(profile=PROFILE, library="vobench")

        type_names = dict.fromkeys(topic.type_name for topic in topics)  # each once, in order
        schemas = {name: self._register_schema(name) for name in type_names}
        self._channels = {topic: self._register_channel(topic, schemas[topic.type_name]) for topic in topics}
        self._last_ns = dict.fromkeys(self._channels.values(), -1)  # by channel
        self._end_ns = 0
        self._chunk_ns = 0
        self._chunk_bytes = 0

    def _register_schema(self, type_name: str) -> int:
        return int(self._mcap.register_schema(type_name, SCHEMA_ENCODING, _definition(type_name)))

    def _register_channel(self, topic: Topic, schema: int) -> int:
        metadata = {
            "offered_qos_profiles": LATCHED_QOS if topic.latched else "",
            "topic_type_hash": _type_hash(topic.type_name),
        }
        return int(self._mcap.register_channel(topic.name, MESSAGE_ENCODING, schema, metadata))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file; if it is attached first, it can be recovered from a torn bag."""
        self._mcap.add_attachment(0, 0, name, media_type, data)

    def note(self, name: str, entries: Mapping[str, str]) -> None:
        """Add a metadata record, with a checksum among its entries, as MCAP gives it none."""
        checked = {**entries, NOTE_CHECKSUM: note_checksum(entries)}
        self._mcap.add_metadata(name, checked)

    def write(self, topic: Topic, t_ns: int, data: bytes) -> None:
        """Add a message. Raises SequenceError unless its topic is declared; stamps rise per topic and never fall."""
        channel = self._channels.get(topic, NO_CHANNEL)
        if channel == NO_CHANNEL:
            raise SequenceError(f"the rig of this recording has no sensor for {topic.name}: {self.path}")
        if t_ns <= self._last_ns[channel] or t_ns < self._end_ns:
            last_ns = max(self._last_ns[channel], self._end_ns)
            raise SequenceError(f"{topic.name}: the stamp {t_ns} ns does not come after {last_ns} ns in {self.path}")

        is_later = t_ns > self._end_ns
        self._last_ns[channel] = t_ns
        self._end_ns = t_ns
        is_full = self._chunk_bytes >= CHUNK_BYTES and (is_later or not self._together)
        if is_full or t_ns - self._chunk_ns >= CHUNK_NS:
            self.flush()
        self._chunk_bytes += len(data)
        self._mcap.add_message(channel, log_time=t_ns, data=data, publish_time=t_ns)

    def flush(self) -> None:
        """End the chunk, so that a killed process does not lose it."""
        self._chunk_ns = self._end_ns
        self._chunk_bytes = 0
        self._mcap.flush()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._mcap.finish()  # type: ignore[no-untyped-call]
        self._stack.__exit__(kind, error, trace)
