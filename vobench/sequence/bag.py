"""One MCAP file in ROS 2 form: written in order of time and whole or not at all, read lazily and by index."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Metadata
from mcap.writer import CompressionType, Writer

from vobench import stop
from vobench.errors import SequenceError
from vobench.sequence.mcap_index import (
    CHECKSUM,
    MESSAGE_INDEX_ENTRY,
    MESSAGE_INDEX_HEAD,
    Entries,
    Index,
    Numbers,
    attached,
    checksum,
    messages_in,
    parsing,
    part_of,
    read_at,
    read_index,
    read_record,
    unpacked,
    whole_note,
)
from vobench.sequence.messages import NS_PER_S, TYPES, Topic

NO_CHANNEL = -1
PROFILE, SCHEMA_ENCODING, MESSAGE_ENCODING = "ros2", "ros2msg", "cdr"
# A chunk ends when it is as large or as long as this: it is all that a killed writer loses.
CHUNK_BYTES, CHUNK_NS = 1 << 20, NS_PER_S
NEVER = 1 << 62  # the library would end chunks between two pictures of one instant

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
    """A file to write that gets its name when the context ends without an error, and is gone after one."""
    part = part_of(path)
    with stop.undone(lambda: part.unlink(missing_ok=True)):
        with part.open("wb") as stream:
            yield stream
        part.replace(path)


@cache
def _described(type_name: str) -> tuple[bytes, str]:
    """The definition of a message type with all that it is made of, and ROS's hash of it."""
    return TYPES.generate_msgdef(type_name, ros_version=2)[0].encode(), TYPES.hash_rihs01(type_name)


class BagWriter:
    """Writes one bag under a temporary name and gives it its own when closed without an error."""

    def __init__(self, path: Path, topics: Sequence[Topic], *, encoded: bool) -> None:
        """A bag of `encoded` pictures keeps what has one stamp in one chunk, to be lost or kept together.

        Its chunks are not packed, for PNG does not get smaller. Raw pictures are packed, and large ones have a chunk
        of their own, so that one topic can be read without the others.
        """
        self.path, self._together = path, encoded
        self._stack = ExitStack()
        packing = CompressionType.NONE if encoded else CompressionType.ZSTD
        self._mcap = Writer(self._stack.enter_context(replacing(path)), chunk_size=NEVER, compression=packing)
        self._mcap.start(profile=PROFILE, library="vobench")
        schemas = {name: self._register_schema(name) for name in dict.fromkeys(t.type_name for t in topics)}
        self._channels = {topic: self._register_channel(topic, schemas[topic.type_name]) for topic in topics}
        self._last_ns = dict.fromkeys(self._channels.values(), -1)
        self._end_ns = self._chunk_ns = self._chunk_bytes = 0

    def _register_schema(self, type_name: str) -> int:
        return int(self._mcap.register_schema(type_name, SCHEMA_ENCODING, _described(type_name)[0]))

    def _register_channel(self, topic: Topic, schema: int) -> int:
        metadata = {
            "offered_qos_profiles": LATCHED_QOS if topic.latched else "",
            "topic_type_hash": _described(topic.type_name)[1],
        }
        return int(self._mcap.register_channel(topic.name, MESSAGE_ENCODING, schema, metadata))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file; done first, it survives in a torn bag."""
        self._mcap.add_attachment(0, 0, name, media_type, data)

    def note(self, name: str, entries: Mapping[str, str]) -> None:
        """Add a metadata record, with a checksum among its entries, for MCAP gives it none."""
        self._mcap.add_metadata(name, {**entries, CHECKSUM: checksum(entries)})

    def write(self, topic: Topic, t_ns: int, data: bytes) -> None:
        """Add a serialised message.

        Raises SequenceError unless stamps rise per topic and never fall per file, and the topic was declared.
        """
        channel = self._channels.get(topic, NO_CHANNEL)
        if channel == NO_CHANNEL:
            raise SequenceError(f"the rig of this recording has nothing that sends {topic.name}: {self.path}")
        if t_ns <= self._last_ns[channel] or t_ns < self._end_ns:
            last = max(self._last_ns[channel], self._end_ns)
            raise SequenceError(f"{topic.name}: the stamp {t_ns} ns does not come after {last} ns in {self.path}")
        later = t_ns > self._end_ns
        self._last_ns[channel] = self._end_ns = t_ns
        full = self._chunk_bytes >= CHUNK_BYTES and (later or not self._together)
        if full or t_ns - self._chunk_ns >= CHUNK_NS:
            self.flush()
        self._chunk_bytes += len(data)
        self._mcap.add_message(channel, log_time=t_ns, data=data, publish_time=t_ns)

    def flush(self) -> None:
        """Give the file all that was written so far, so that a killed process does not lose it."""
        self._chunk_ns, self._chunk_bytes = self._end_ns, 0
        self._mcap.flush()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._mcap.finish()  # type: ignore[no-untyped-call]
        self._stack.__exit__(kind, error, trace)


@dataclass(frozen=True, slots=True)
class Bag:
    """A bag to read: its index in memory, its messages one chunk at a time."""

    path: Path
    index: Index

    @classmethod
    def open(cls, path: Path) -> "Bag":
        """Read the summary. Raises SequenceError where the file is none, torn or damaged."""
        with parsing(path), path.open("rb") as stream:
            return cls(path, read_index(stream))

    def has(self, topic: Topic) -> bool:
        """Whether there is such a topic, empty or not. Raises SequenceError where it is of another type."""
        return self._channel(topic) != NO_CHANNEL

    def require(self, topics: Iterable[Topic]) -> None:
        """Raise SequenceError where one of some topics is missing or of another type."""
        for topic in topics:
            if not self.has(topic):
                raise SequenceError(f"{topic.name} should be {topic.type_name} but is missing in {self.path}")

    def count(self, topic: Topic) -> int:
        """How many messages a topic has; none where there is no such topic."""
        return self._entries(topic).total

    def raw(self, topics: Iterable[Topic]) -> Iterator[tuple[Topic, memoryview]]:
        """The serialised messages of those topics that there are, in order of time, one chunk in memory at a time."""
        there = {self._channel(topic): topic for topic in topics if self.has(topic)}
        chunks = np.flatnonzero(sum(self._entries(topic).count for topic in there.values()))
        last_ns = 0
        with parsing(self.path), self._opened() as stream:
            found = (found for chunk in chunks.tolist() for found in messages_in(self._chunk(stream, chunk), there))
            for channel, log_ns, data in found:
                if log_ns < last_ns:
                    raise ValueError(f"after {last_ns} ns comes {log_ns} ns")
                last_ns = log_ns
                yield there[channel], data

    def messages(self, topics: Iterable[Topic]) -> Iterator[tuple[Topic, Any]]:
        """The messages of `raw`."""
        with parsing(self.path):
            for topic, data in self.raw(topics):
                yield topic, TYPES.deserialize_cdr(data, topic.type_name)

    def message(self, topic: Topic, data: memoryview) -> Any:
        """A message from its bytes. Raises SequenceError where they are none."""
        with parsing(self.path):
            return TYPES.deserialize_cdr(data, topic.type_name)

    def nth(self, topics: Sequence[Topic], number: int) -> list[memoryview]:
        """The bytes of the message of that number of each topic, of which only their chunk is read, mostly one.

        Raises SequenceError where there is none.
        """
        places = [self._place(topic, number) for topic in topics]
        with parsing(self.path), self._opened() as stream:
            chunks = {chunk: self._chunk(stream, chunk) for chunk in dict(places)}
            return [self._pick(chunks[place[0]], topic, place[1]) for topic, place in zip(topics, places, strict=True)]

    def _place(self, topic: Topic, number: int) -> tuple[int, int]:
        """In which chunk a message is, and how many of its topic lie before it there."""
        entries = self._entries(topic)
        if not 0 <= number < entries.total:
            raise SequenceError(f"{topic.name} has {entries.total} messages and none numbered {number} in {self.path}")
        chunk = int(np.searchsorted(entries.ends, number, side="right"))
        return chunk, number - int(entries.ends[chunk] - entries.count[chunk])

    def _pick(self, records: memoryview, topic: Topic, skipped: int) -> memoryview:
        for _, _, data in islice(messages_in(records, {self._channel(topic)}), skipped, None):
            return data
        raise ValueError(f"a chunk has {skipped} messages of {topic.name} where the index has more")

    def stamps(self, topic: Topic) -> Numbers:
        """Log times in ns (N,) of a topic's messages, which no chunk is read for."""
        entries = self._entries(topic)
        with parsing(self.path), self._opened() as stream:
            found = [self._stamps(stream, entries, chunk) for chunk in np.flatnonzero(entries.count).tolist()]
        return np.concatenate([np.zeros(0, np.int64), *found])

    def count_until(self, topic: Topic, t_ns: int) -> int:
        """How many messages of a topic are logged at `t_ns` or before."""
        entries = self._entries(topic)
        begun = np.flatnonzero((entries.count > 0) & (self.index.start_ns <= t_ns))
        with parsing(self.path), self._opened() as stream:
            for chunk in begun[::-1].tolist():
                within = int(np.searchsorted(self._stamps(stream, entries, chunk), t_ns, side="right"))
                if within:
                    return int(entries.ends[chunk] - entries.count[chunk]) + within
        return 0

    def note(self, name: str) -> dict[str, str]:
        """The metadata record of that name; nothing in it where there is none. Raises SequenceError if damaged."""
        if name not in self.index.notes:
            return {}
        with parsing(self.path), self._opened() as stream:
            content = read_record(stream, self.index.notes[name], Opcode.METADATA)
            return whole_note(Metadata.read(ReadDataStream(BytesIO(content))))

    def attachment(self, name: str) -> bytes:
        """The attached file of that name. Raises SequenceError where there is none, or it is damaged."""
        if name not in self.index.attachments:
            raise SequenceError(f"no attachment {name!r} in {self.path}")
        with parsing(self.path), self._opened() as stream:
            return bytes(attached(read_record(stream, self.index.attachments[name], Opcode.ATTACHMENT)).data)

    def _opened(self) -> BinaryIO:
        return self.path.open("rb", buffering=0)

    def _chunk(self, stream: BinaryIO, number: int) -> memoryview:
        return unpacked(read_record(stream, int(self.index.offset[number]), Opcode.CHUNK))

    def _stamps(self, stream: BinaryIO, entries: Entries, chunk: int) -> Numbers:
        """Log times in ns of one channel's messages in one chunk, by its message index, which has no checksum."""
        place, size = int(entries.offset[chunk]) + MESSAGE_INDEX_HEAD, MESSAGE_INDEX_ENTRY.itemsize
        found = np.frombuffer(read_at(stream, place, int(entries.count[chunk]) * size), MESSAGE_INDEX_ENTRY)
        stamps = found["log_ns"].astype(np.int64)
        if stamps.min() < self.index.start_ns[chunk] or stamps.max() > self.index.end_ns[chunk]:
            raise ValueError(f"the message index at {place} has stamps that its chunk has not")
        return stamps

    def _channel(self, topic: Topic) -> int:
        found = [channel for channel in self.index.channels.values() if channel.topic == topic.name]
        types = {self.index.schemas[c.schema_id].name if c.schema_id else "" for c in found}
        if found and (types != {topic.type_name} or len(found) > 1):
            kinds = " and ".join(sorted(types)) or "of no type" if len(found) == 1 else f"{len(found)} channels"
            raise SequenceError(f"{topic.name} should be {topic.type_name} but is {kinds} in {self.path}")
        return int(found[0].id) if found else NO_CHANNEL

    def _entries(self, topic: Topic) -> Entries:
        nothing = np.zeros_like(self.index.offset)
        return self.index.entries.get(self._channel(topic), Entries(nothing, nothing))
