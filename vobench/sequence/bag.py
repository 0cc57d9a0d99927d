"""One MCAP file in ROS 2 form: written in order of time and whole or not at all, read lazily and within bounds.

The `mcap` library writes and parses; a `BoundedFile` keeps it from believing a length that a file states.
"""

import os
import struct
import zlib
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from io import BufferedReader, FileIO
from itertools import chain, pairwise
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self, TypeVar

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Chunk, ChunkIndex, Footer, MessageIndex, Metadata
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from vobench import stop
from vobench.errors import SequenceError
from vobench.sequence.messages import NS_PER_S, TYPES, Topic

NO_CHANNEL = -1
PROFILE = "ros2"
SCHEMA_ENCODING = "ros2msg"
MESSAGE_ENCODING = "cdr"
# A chunk ends when it is as large or as long as this: it is all that a killed writer loses.
CHUNK_BYTES = 1 << 20
CHUNK_NS = NS_PER_S
NEVER = 1 << 62  # the library would end chunks between two pictures of one instant

MAGIC = b"\x89MCAP0\r\n"
LFS_START = b"version https://git-lfs"
MAX_BYTES = 1 << 28  # of a record, and of a chunk unpacked; a writer's chunks are a thousand times smaller
MAX_RECORDS = 1 << 20  # in a chunk; a few bytes of zstd could unpack to endless empty ones
HEAD = struct.Struct("<BQ")  # opcode, length of what follows
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
FOOTER_BYTES = HEAD.size + struct.calcsize("<QQI")  # places of summary and summary offsets, checksum of both
CRC_BYTES = 4
MESSAGE_INDEX_HEAD = HEAD.size + struct.calcsize("<HI")
MESSAGE_INDEX_ENTRY = 16
CHECKSUM = "vobench.crc32"  # the entry of a note of ours that is the checksum of the others

Numbers = NDArray[np.int64]
Record = TypeVar("Record")

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
    return TYPES.generate_msgdef(type_name, ros_version=2)[0].encode(), TYPES.hash_rihs01(type_name)


class BagWriter:
    """Writes one bag under a temporary name and gives it its own when closed without an error."""

    def __init__(self, path: Path, topics: Sequence[Topic], *, encoded: bool) -> None:
        """A bag of `encoded` pictures keeps what has one stamp in one chunk, to be lost or kept together.

        Its chunks are not packed, for PNG does not get smaller. Raw pictures are packed, and large ones have a chunk
        of their own, so that one topic can be read without the others.
        """
        self.path = path
        self._together = encoded
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
        self._mcap.add_metadata(name, {**entries, CHECKSUM: _checksum(entries)})

    def write(self, topic: Topic, t_ns: int, data: bytes) -> None:
        """Add a message. Raises SequenceError unless its topic is declared; stamps rise per topic and never fall."""
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
        self._chunk_ns = self._end_ns
        self._chunk_bytes = 0
        self._mcap.flush()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._mcap.finish()  # type: ignore[no-untyped-call]
        self._stack.__exit__(kind, error, trace)


class BoundedFile(BufferedReader):
    """A file to read, of which nobody gets more than there is, whatever length its records state."""

    def __init__(self, path: Path) -> None:
        super().__init__(FileIO(path))
        self._most = min(os.fstat(self.fileno()).st_size, MAX_BYTES)

    def read(self, size: int | None = -1, /) -> bytes:
        """Just so many bytes. Raises ValueError where they are too many, or not all there."""
        if size is None or not 0 <= size <= self._most:
            raise ValueError(f"{size} bytes are stated where at most {self._most} are read")
        found = super().read(size)
        if len(found) < size:
            raise ValueError(f"{size} bytes are stated, but {len(found)} are left")
        return found


@contextmanager
def parsing(path: Path) -> Iterator[None]:
    """Say of any failure inside, of a dozen unrelated kinds in the parsers, in one line what is wrong with the file."""
    try:
        yield
    except SequenceError:
        raise
    except FileNotFoundError:
        part = part_of(path)
        if part.exists():
            raise SequenceError(f"the recording was never finished, its writer was stopped: {part}") from None
        raise SequenceError(f"no recording at {path}") from None
    except Exception as error:
        raise SequenceError(f"{_ailment(path, error)}: {path}") from error


def part_of(path: Path) -> Path:
    """Where a file is while it is being written."""
    return path.with_name(path.name + ".part")


def _ailment(path: Path, error: Exception) -> str:
    try:
        with path.open("rb") as stream:
            start = stream.read(len(LFS_START))
            stream.seek(max(0, os.fstat(stream.fileno()).st_size - len(MAGIC)))
            end = stream.read()
    except OSError as unreadable:
        return f"the recording cannot be opened ({unreadable.strerror})"
    if start == LFS_START:
        return "this is a Git-LFS pointer instead of the recording; `git lfs pull` fetches it"
    if not start.startswith(MAGIC):
        return "not an MCAP recording by its first bytes"
    if end != MAGIC:
        return "the recording was cut off, its end is missing; `mcap recover` (mcap.dev) saves what is whole"
    reason = str(error).splitlines()[0] if str(error) else "no reason given"
    return f"the recording is damaged ({type(error).__name__}: {reason})"


def unpack(packing: str, packed: bytes, size: int) -> bytes:
    """The bytes of a chunk, never more than `size` and MAX_BYTES. Raises ValueError, or the packing's own error."""
    if size > MAX_BYTES:
        raise ValueError(f"a chunk states {size} bytes unpacked where at most {MAX_BYTES} are read")
    if not packing:
        return packed
    if packing == "zstd":
        stated = zstandard.frame_content_size(packed)
        if stated not in (-1, size):  # the library goes by this number, and by ours where it is not there
            raise ValueError(f"a chunk states {size} bytes unpacked and {stated}")
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    if packing == "lz4":
        unpacker = lz4.frame.LZ4FrameDecompressor()
        found = bytes(unpacker.decompress(packed, max_length=size))
        if not unpacker.eof:
            raise ValueError(f"a chunk states {size} bytes unpacked and has more, or was cut off")
        return found
    raise ValueError(f"a chunk is packed as {packing!r}; zstd and lz4 are known")


def messages_in(chunk: Chunk, channels: Container[int]) -> Iterator[tuple[int, int, memoryview]]:
    """Channel, log time in ns and data of each message of some channels, as they lie in a chunk.

    Raises ValueError where the chunk is damaged. The library's own walk has no bound on empty records.
    """
    records = memoryview(unpack(chunk.compression, chunk.data, chunk.uncompressed_size))
    checksum = chunk.uncompressed_crc
    if len(records) != chunk.uncompressed_size or (checksum and zlib.crc32(records) != checksum):
        raise ValueError("the checksum of a chunk differs from its content")
    at = 0
    for _ in range(MAX_RECORDS):
        if at == len(records):
            return
        opcode, length = HEAD.unpack_from(records, at)
        begin = at + HEAD.size
        at = at + HEAD.size + length
        if at > len(records):
            raise ValueError("a record runs over the end of its chunk")
        if opcode == Opcode.MESSAGE:
            channel, _, log_ns, _ = MESSAGE.unpack_from(records, begin)
            if channel in channels:
                yield channel, log_ns, records[begin + MESSAGE.size : at]
    raise ValueError(f"{MAX_RECORDS} records and more lie in one chunk")


def _messages(stream: BinaryIO, chunk: ChunkIndex, channels: Container[int]) -> Iterator[tuple[int, int, memoryview]]:
    return messages_in(read_record(stream, chunk.chunk_start_offset, Chunk), channels)


def read_record(stream: BinaryIO, offset: int, kind: type[Record]) -> Record:
    """The record of a kind that begins at a place. Raises ValueError where there is none."""
    stream.seek(offset)
    found = next(StreamReader(stream, skip_magic=True, emit_chunks=True).records)
    if not isinstance(found, kind):
        raise ValueError(f"a {kind.__name__} should begin at {offset}, but a {type(found).__name__} does")
    return found


def read_summary(stream: BinaryIO) -> tuple[Summary, tuple[dict[int, int], ...]]:
    """The records behind the data, their checksum tested, and how many messages of each channel each chunk has.

    Raises ValueError where a file has none, or they contradict each other.
    """
    footer_at = stream.seek(-FOOTER_BYTES - len(MAGIC), os.SEEK_END)
    footer = read_record(stream, footer_at, Footer)
    if not 0 < footer.summary_start <= footer_at:
        raise ValueError("it has no summary")
    stream.seek(footer.summary_start)
    tested = stream.read(footer_at + FOOTER_BYTES - CRC_BYTES - footer.summary_start)
    if footer.summary_crc and zlib.crc32(tested) != footer.summary_crc:
        raise ValueError("the checksum of its summary is wrong")
    stream.seek(0)
    summary = make_reader(stream).get_summary()
    if summary is None or summary.statistics is None:
        raise ValueError("its summary has no statistics")
    chunks = summary.chunk_indexes
    if any(b.chunk_start_offset < a.chunk_start_offset + a.chunk_length for a, b in pairwise(chunks)):
        raise ValueError("the chunks of its summary overlap")  # few bytes could state endless chunks
    counts = tuple(map(_counts, chunks))
    stated = Counter(summary.statistics.channel_message_counts)
    if stated != sum(map(Counter, counts), Counter()):
        raise ValueError("its summary counts other messages than its message indexes do")
    unknown = {channel.schema_id for channel in summary.channels.values()} - {0, *summary.schemas}
    if unknown or stated.keys() - summary.channels.keys():
        raise ValueError("its summary names a channel or a message type that it does not describe")
    return summary, counts


def _counts(chunk: ChunkIndex) -> dict[int, int]:
    """How many messages of each channel a chunk has, by the size of their indexes.

    These lie one behind the other; each ends where the next one begins.
    """
    places = sorted((at, channel) for channel, at in chunk.message_index_offsets.items())
    ends = [*(at for at, _ in places[1:]), chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length]
    counts = {}
    for (at, channel), end in zip(places, ends, strict=False):
        counts[channel], over = divmod(end - at - MESSAGE_INDEX_HEAD, MESSAGE_INDEX_ENTRY)
        if over or counts[channel] < 0:
            raise ValueError(f"the message index at {at} ends within an entry")
    return counts


def _checksum(entries: Mapping[str, str]) -> str:
    return f"{zlib.crc32(repr(sorted(entries.items())).encode()):08x}"


@dataclass(frozen=True, slots=True)
class Bag:
    """A bag to read: its summary in memory, its messages one chunk at a time; `counts` by chunk and channel."""

    path: Path
    summary: Summary
    counts: tuple[dict[int, int], ...]

    @classmethod
    def open(cls, path: Path) -> "Bag":
        """Read the summary. Raises SequenceError where the file is none, torn or damaged."""
        with parsing(path), BoundedFile(path) as stream:
            return cls(path, *read_summary(stream))

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
        channel = self._channel(topic)
        return sum(counts.get(channel, 0) for counts in self.counts)

    def raw(self, topics: Iterable[Topic]) -> Iterator[tuple[Topic, memoryview]]:
        """The serialised messages of those topics that there are, in order of time, one chunk in memory at a time."""
        there = {self._channel(topic): topic for topic in topics if self.has(topic)}
        last_ns = 0
        indexed = zip(self.summary.chunk_indexes, self.counts, strict=True)
        with parsing(self.path), BoundedFile(self.path) as stream:
            chunks = (_messages(stream, chunk, there) for chunk, counts in indexed if there.keys() & counts)
            for channel, log_ns, data in chain.from_iterable(chunks):
                if log_ns < last_ns:
                    raise ValueError(f"after {last_ns} ns comes {log_ns} ns")
                last_ns = log_ns
                yield there[channel], data

    def messages(self, topics: Iterable[Topic]) -> Iterator[tuple[Topic, Any]]:
        """The messages of `raw`."""
        with parsing(self.path):
            for topic, data in self.raw(topics):
                yield topic, TYPES.deserialize_cdr(data, topic.type_name)

    def nth(self, topics: Sequence[Topic], number: int) -> list[tuple[Topic, memoryview]]:
        """Each topic's message of that number, of which only their chunks are read. Raises SequenceError for none."""
        places = {topic: self._place(topic, number) for topic in topics}
        found = dict[Topic, memoryview]()
        with parsing(self.path), BoundedFile(self.path) as stream:
            for place in sorted({at for at, _ in places.values()}):
                numbers = {topic: within for topic, (at, within) in places.items() if at == place}
                found.update(self._picked(stream, self.summary.chunk_indexes[place], numbers))
        return [(topic, found[topic]) for topic in topics]

    def _place(self, topic: Topic, number: int) -> tuple[int, int]:
        """Which chunk has a topic's message of that number, and its number there."""
        channel = self._channel(topic)
        within = number
        for at, counts in enumerate(self.counts):
            if 0 <= within < counts.get(channel, 0):
                return at, within
            within -= counts.get(channel, 0)
        raise SequenceError(f"{topic.name} has {self.count(topic)} messages and none numbered {number} in {self.path}")

    def _picked(
        self, stream: BinaryIO, chunk: ChunkIndex, numbers: Mapping[Topic, int]
    ) -> Iterator[tuple[Topic, memoryview]]:
        """Of each topic the message of its number in a chunk."""
        wanted = {self._channel(topic): topic for topic in numbers}
        passed = Counter[Topic]()
        for channel, _, data in _messages(stream, chunk, wanted):
            topic = wanted[channel]
            if passed[topic] == numbers[topic]:
                yield topic, data
            passed[topic] += 1
            if all(passed[topic] > number for topic, number in numbers.items()):
                return
        short = next(topic for topic, number in numbers.items() if passed[topic] <= number)
        raise ValueError(f"a chunk has {passed[short]} messages of {short.name} where the index has more")

    def stamps(self, topic: Topic) -> Numbers:
        """Log times in ns (N,) of a topic's messages by their indexes, which have no checksum; no chunk is read."""
        channel = self._channel(topic)
        found = [np.zeros(0, np.int64)]
        with parsing(self.path), BoundedFile(self.path) as stream:
            for chunk, counts in zip(self.summary.chunk_indexes, self.counts, strict=True):
                if not counts.get(channel):
                    continue
                place = chunk.message_index_offsets[channel]
                index = read_record(stream, place, MessageIndex)
                stamps = np.array([log_ns for log_ns, _ in index.records], np.int64)
                low = chunk.message_start_time
                high = chunk.message_end_time
                if len(stamps) != counts[channel] or stamps.min() < low or stamps.max() > high:
                    raise ValueError(f"the message index at {place} has stamps that its chunk has not")
                found.append(stamps)
        return np.concatenate(found)

    def note(self, name: str) -> dict[str, str]:
        """The metadata record of that name; nothing in it where there is none. Raises SequenceError if damaged."""
        place = next((entry.offset for entry in self.summary.metadata_indexes if entry.name == name), None)
        if place is None:
            return {}
        with parsing(self.path), BoundedFile(self.path) as stream:
            entries = dict(read_record(stream, place, Metadata).metadata)
            stated = entries.pop(CHECKSUM, None)
            if stated is not None and stated != _checksum(entries):
                raise ValueError(f"the checksum of the note {name!r} differs from its content")
            return entries

    def has_attachment(self, name: str) -> bool:
        """Whether a file of that name is attached."""
        return any(entry.name == name for entry in self.summary.attachment_indexes)

    def attachment(self, name: str) -> bytes:
        """The attached file of that name. Raises SequenceError where there is none, or it is damaged."""
        place = next((entry.offset for entry in self.summary.attachment_indexes if entry.name == name), None)
        if place is None:
            raise SequenceError(f"no attachment {name!r} in {self.path}")
        with parsing(self.path), BoundedFile(self.path) as stream:
            data = bytes(read_record(stream, place, Attachment).data)
            length = stream.tell() - CRC_BYTES - stream.seek(place + HEAD.size)
            tested = zlib.crc32(stream.read(length))
            stated = int.from_bytes(stream.read(CRC_BYTES), "little")
            if stated and stated != tested:
                raise ValueError(f"the checksum of the attachment {name!r} differs from its content")
            return data

    def _channel(self, topic: Topic) -> int:
        found = [channel for channel in self.summary.channels.values() if channel.topic == topic.name]
        types = {self.summary.schemas[c.schema_id].name if c.schema_id else "" for c in found}
        if found and (types != {topic.type_name} or len(found) > 1):
            kinds = " and ".join(sorted(types)) or "of no type" if len(found) == 1 else f"{len(found)} channels"
            raise SequenceError(f"{topic.name} should be {topic.type_name} but is {kinds} in {self.path}")
        return found[0].id if found else NO_CHANNEL
