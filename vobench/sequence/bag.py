"""One MCAP file in ROS 2 form: read lazily, a chunk at a time."""

import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.records import Attachment, ChunkIndex, MessageIndex, Metadata
from mcap.summary import Summary
from numpy.typing import NDArray

from vobench.errors import SequenceError
from vobench.sequence.bag_writer import NOTE_CHECKSUM, note_checksum
from vobench.sequence.mcap_file import (
    CRC_BYTES,
    HEAD,
    NO_CHANNEL,
    BoundedFile,
    ChannelCounts,
    parsing,
    read_messages,
    read_record,
    read_summary,
)
from vobench.sequence.message_type import TYPES
from vobench.sequence.topic import Topic

Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Bag:
    """A bag to read: its summary is in memory, its messages are read a chunk at a time.

    `counts` are the numbers of messages by channel of each chunk.
    """

    path: Path
    summary: Summary
    counts: tuple[ChannelCounts, ...]

    @classmethod
    def open(cls, path: Path) -> "Bag":
        """Read the summary. Raises SequenceError where there is no file, or it is torn or damaged."""
        with parsing(path), BoundedFile(path) as stream:
            return cls(path, *read_summary(stream))

    def has(self, topic: Topic) -> bool:
        """Whether there is such a topic, empty or not. Raises SequenceError where it is of another type."""
        return self._channel(topic) != NO_CHANNEL

    def require(self, topics: Iterable[Topic]) -> None:
        """Raise SequenceError where one of the topics is missing or of another type."""
        for topic in topics:
            if not self.has(topic):
                raise SequenceError(f"{topic.name} should be {topic.type_name} but is missing in {self.path}")

    def count(self, topic: Topic) -> int:
        """How many messages a topic has; 0 where there is no such topic."""
        channel = self._channel(topic)
        return sum(counts.get(channel, 0) for counts in self.counts)

    def raw(self, topics: Iterable[Topic]) -> Iterator[tuple[Topic, memoryview]]:
        """The serialised messages of those topics that exist, in order of time, one chunk in memory at a time."""
        existing = [topic for topic in topics if self.has(topic)]
        topic_of = {self._channel(topic): topic for topic in existing}
        last_ns = 0
        with parsing(self.path), BoundedFile(self.path) as stream:
            for chunk, counts in zip(self.summary.chunk_indexes, self.counts, strict=True):
                if topic_of.keys().isdisjoint(counts):
                    continue
                for channel, log_ns, data in read_messages(stream, chunk, topic_of):
                    if log_ns < last_ns:
                        raise ValueError(f"after {last_ns} ns comes {log_ns} ns")
                    last_ns = log_ns
                    yield topic_of[channel], data

    def messages(self, topics: Iterable[Topic]) -> Iterator[tuple[Topic, Any]]:
        """The messages of `raw`, deserialised."""
        with parsing(self.path):
            for topic, data in self.raw(topics):
                yield topic, TYPES.deserialize_cdr(data, topic.type_name)

    def nth(
        self,
        topics: Sequence[Topic],
        number: int,
    ) -> list[tuple[Topic, memoryview]]:
        """Each topic's message of a number; only the chunks that hold them are read.

        Raises SequenceError where a topic has no message of that number.
        """
        by_chunk: dict[int, dict[Topic, int]] = {}  # the number within the chunk, by chunk and topic
        for topic in topics:
            chunk, number_in_chunk = self._place(topic, number)
            by_chunk.setdefault(chunk, {})[topic] = number_in_chunk

        messages = dict[Topic, memoryview]()
        with parsing(self.path), BoundedFile(self.path) as stream:
            for chunk in sorted(by_chunk):
                selected = self._selected(stream, self.summary.chunk_indexes[chunk], by_chunk[chunk])
                messages.update(selected)
        return [(topic, messages[topic]) for topic in topics]

    def _place(self, topic: Topic, number: int) -> tuple[int, int]:
        """Which chunk has a topic's message of a number, and its number within that chunk."""
        channel = self._channel(topic)
        number_in_chunk = number
        for chunk, counts in enumerate(self.counts):
            count = counts.get(channel, 0)
            if 0 <= number_in_chunk < count:
                return chunk, number_in_chunk
            number_in_chunk -= count
        raise SequenceError(f"{topic.name} has {self.count(topic)} messages and none numbered {number} in {self.path}")

    def _selected(
        self, stream: BinaryIO, chunk: ChunkIndex, numbers: Mapping[Topic, int]
    ) -> Iterator[tuple[Topic, memoryview]]:
        """The message of each topic that has its number in a chunk."""
        topic_of = {self._channel(topic): topic for topic in numbers}
        passed = Counter[Topic]()
        for channel, _, data in read_messages(stream, chunk, topic_of):
            topic = topic_of[channel]
            if passed[topic] == numbers[topic]:
                yield topic, data
            passed[topic] += 1
            if all(passed[topic] > number for topic, number in numbers.items()):
                return
        short = next(topic for topic, number in numbers.items() if passed[topic] <= number)
        raise ValueError(f"a chunk has {passed[short]} messages of {short.name} where the index has more")

    def stamps(self, topic: Topic) -> Numbers:
        """Log times in ns (N,) of a topic's messages, by their indexes alone, which have no checksum."""
        channel = self._channel(topic)
        parts = [np.zeros(0, np.int64)]
        with parsing(self.path), BoundedFile(self.path) as stream:
            for chunk, counts in zip(self.summary.chunk_indexes, self.counts, strict=True):
                if counts.get(channel):
                    parts.append(_chunk_stamps(stream, chunk, channel, counts[channel]))
        return np.concatenate(parts)

    def note(self, name: str) -> dict[str, str]:
        """The entries of a metadata record; none where there is no such record. Raises SequenceError if damaged."""
        places = {entry.name: entry.offset for entry in reversed(self.summary.metadata_indexes)}
        if name not in places:
            return {}
        with parsing(self.path), BoundedFile(self.path) as stream:
            entries = dict(read_record(stream, places[name], Metadata).metadata)
            stated = entries.pop(NOTE_CHECKSUM, None)
            if stated is not None and stated != note_checksum(entries):
                raise ValueError(f"the checksum of the note {name!r} differs from its content")
            return entries

    def has_attachment(self, name: str) -> bool:
        """Whether a file of that name is attached."""
        return any(entry.name == name for entry in self.summary.attachment_indexes)

    def attachment(self, name: str) -> bytes:
        """The attached file of that name. Raises SequenceError where there is none, or it is damaged."""
        places = {
            entry.name: entry.offset for entry in reversed(self.summary.attachment_indexes)
        }  # the first of a name
        if name not in places:
            raise SequenceError(f"no attachment {name!r} in {self.path}")
        place = places[name]
        with parsing(self.path), BoundedFile(self.path) as stream:
            data = bytes(read_record(stream, place, Attachment).data)
            record_end = stream.tell()
            checked_begin = stream.seek(place + HEAD.size)
            checked = stream.read(record_end - CRC_BYTES - checked_begin)
            stated = int.from_bytes(stream.read(CRC_BYTES), "little")
            if stated and stated != zlib.crc32(checked):
                raise ValueError(f"the checksum of the attachment {name!r} differs from its content")
            return data

    def _channel(self, topic: Topic) -> int:
        """The only channel of a topic, or NO_CHANNEL. Raises SequenceError where it is of another type."""
        channels = [channel for channel in self.summary.channels.values() if channel.topic == topic.name]
        if not channels:
            return NO_CHANNEL
        if len(channels) > 1:
            raise self._wrong(topic, f"{len(channels)} channels")
        schema = channels[0].schema_id
        type_name = self.summary.schemas[schema].name if schema else ""
        if type_name != topic.type_name:
            raise self._wrong(topic, type_name or "of no type")
        return channels[0].id

    def _wrong(self, topic: Topic, actual: str) -> SequenceError:
        return SequenceError(f"{topic.name} should be {topic.type_name} but is {actual} in {self.path}")


def _chunk_stamps(
    stream: BinaryIO,
    chunk: ChunkIndex,
    channel: int,
    count: int,
) -> Numbers:
    """Log times in ns (N,) of a channel's messages in a chunk. Raises ValueError where they can't be those."""
    place = chunk.message_index_offsets[channel]
    index = read_record(stream, place, MessageIndex)
    logged_ns = [log_ns for log_ns, _ in index.records]
    stamps = np.array(logged_ns, np.int64)
    starts_too_early = min(logged_ns, default=0) < chunk.message_start_time
    ends_too_late = max(logged_ns, default=0) > chunk.message_end_time
    if len(stamps) != count or starts_too_early or ends_too_late:
        raise ValueError(f"the message index at {place} has stamps that its chunk does not have")
    return stamps
