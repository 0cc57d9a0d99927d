"""Where the messages of a bag lie, by its summary: read once, and believed only as far as it agrees with itself."""

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, MetadataIndex, Schema, Statistics
from numpy.typing import NDArray

from vobench.sequence.record import HEAD, MAGIC, read_at, records_in

FOOTER = struct.Struct("<QQI")  # where summary and summary offsets begin, checksum of both
CHUNK_INDEX = struct.Struct("<QQQQI")  # first and last log time, offset, length, bytes of the map that follows
CHANNEL_ENTRY = struct.Struct("<HQ")  # channel, offset of its message index
MESSAGE_INDEX_HEAD = HEAD.size + struct.calcsize("<HI")  # before the entries: record head, channel, bytes of entries
MESSAGE_INDEX_ENTRY = np.dtype([("log_ns", "<u8"), ("offset", "<u8")])

Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Entries:
    """The message indexes of one channel, (K,) each for K chunks: where each lies, and of how many messages."""

    offset: Numbers
    count: Numbers

    @property
    def ends(self) -> Numbers:
        """How many messages there are up to the end of each chunk."""
        return np.cumsum(self.count)

    @property
    def total(self) -> int:
        """Messages in all chunks."""
        return int(self.count.sum())


@dataclass(frozen=True, slots=True)
class Index:
    """All that a summary says: chunks (K,) in the order of the file, channels, attachments and notes by their place."""

    start_ns: Numbers
    end_ns: Numbers
    offset: Numbers
    channels: dict[int, Channel]
    schemas: dict[int, Schema]
    entries: dict[int, Entries]
    attachments: dict[str, int]
    notes: dict[str, int]


@dataclass(slots=True)
class _Summary:
    """What is collected while a summary is read; `rows` holds start, end, offset and length of each chunk."""

    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    attachments: dict[str, int] = field(default_factory=dict)
    notes: dict[str, int] = field(default_factory=dict)
    counts: dict[int, int] | None = None
    rows: list[tuple[int, int, int, int]] = field(default_factory=list)
    places: dict[int, list[tuple[int, int, int]]] = field(default_factory=dict)

    def add(self, opcode: int, content: memoryview) -> None:
        """Take one record in."""
        if opcode == Opcode.CHUNK_INDEX:
            self._add_chunk(content)
            return
        stream = ReadDataStream(BytesIO(content))
        match opcode:
            case Opcode.CHANNEL:
                channel = Channel.read(stream)
                self.channels[channel.id] = channel
            case Opcode.SCHEMA:
                schema = Schema.read(stream)
                self.schemas[schema.id] = schema
            case Opcode.STATISTICS:
                self.counts = dict(Statistics.read(stream).channel_message_counts)
            case Opcode.ATTACHMENT_INDEX:
                attachment = AttachmentIndex.read(stream)
                self.attachments.setdefault(attachment.name, attachment.offset)
            case Opcode.METADATA_INDEX:
                note = MetadataIndex.read(stream)
                self.notes.setdefault(note.name, note.offset)

    def _add_chunk(self, content: memoryview) -> None:
        """A chunk's place, and how many messages of each channel it has, by the size of their indexes.

        These lie one behind the other; each ends where the next one begins.
        """
        start_ns, end_ns, offset, length, map_bytes = CHUNK_INDEX.unpack_from(content)
        map_end = CHUNK_INDEX.size + map_bytes
        places = sorted((at, channel) for channel, at in CHANNEL_ENTRY.iter_unpack(content[CHUNK_INDEX.size : map_end]))
        (index_bytes,) = struct.unpack_from("<Q", content, map_end)
        ends = [*(at for at, _ in places[1:]), offset + length + index_bytes]
        for (at, channel), end in zip(places, ends, strict=True):
            count, over = divmod(end - at - MESSAGE_INDEX_HEAD, MESSAGE_INDEX_ENTRY.itemsize)
            if over or count < 0:
                raise ValueError(f"the message index at {at} ends within an entry")
            self.places.setdefault(channel, []).append((len(self.rows), at, count))
        self.rows.append((start_ns, end_ns, offset, length))


def read_index(stream: BinaryIO) -> Index:
    """The index of a bag. Raises ValueError where the bag has none, or one that contradicts itself."""
    summary = _Summary()
    for opcode, content in _summary_records(stream):
        summary.add(opcode, content)
    rows = np.array(summary.rows, np.int64).reshape(-1, 4).T
    _require_apart(rows[2], rows[3])
    entries = {channel: _entries(places, rows.shape[1]) for channel, places in summary.places.items()}
    stated = {channel: count for channel, count in (summary.counts or {}).items() if count}
    if stated != {channel: found.total for channel, found in entries.items() if found.total}:
        raise ValueError("its summary counts other messages than its message indexes do")
    unknown = {channel.schema_id for channel in summary.channels.values()} - {0, *summary.schemas}
    if unknown or entries.keys() - summary.channels.keys():
        raise ValueError("its summary names a channel or a message type that it does not describe")
    fields = summary.channels, summary.schemas, entries, summary.attachments, summary.notes
    return Index(rows[0], rows[1], rows[2], *fields)


def _summary_records(stream: BinaryIO) -> Iterator[tuple[int, memoryview]]:
    """The records between the data and the footer, their checksum tested."""
    if read_at(stream, 0, len(MAGIC)) != MAGIC:
        raise ValueError("the magic bytes at its start are wrong")
    footer_at = os.fstat(stream.fileno()).st_size - len(MAGIC) - HEAD.size - FOOTER.size
    footer = read_at(stream, max(0, footer_at), HEAD.size + FOOTER.size + len(MAGIC))
    if HEAD.unpack_from(footer) != (Opcode.FOOTER, FOOTER.size) or not footer.endswith(MAGIC):
        raise ValueError("it does not end with a footer")
    begin, _, checksum = FOOTER.unpack_from(footer, HEAD.size)
    if not 0 < begin <= footer_at:
        raise ValueError("it has no summary")
    summary = read_at(stream, begin, footer_at - begin)
    if checksum and zlib.crc32(footer[: HEAD.size + FOOTER.size - 4], zlib.crc32(summary)) != checksum:
        raise ValueError("the checksum of its summary is wrong")
    return records_in(memoryview(summary))


def _require_apart(offset: Numbers, length: Numbers) -> None:
    """Raise ValueError unless each chunk begins after the one before it: else few bytes could state endless chunks."""
    if np.any(offset < len(MAGIC)) or np.any(length < 0) or np.any(offset[1:] < offset[:-1] + length[:-1]):
        raise ValueError("the chunks of its summary overlap")


def _entries(places: list[tuple[int, int, int]], chunks: int) -> Entries:
    """Of rows: chunk, offset, count."""
    table = np.array(places, np.int64)
    offset, count = np.zeros((2, chunks), np.int64)
    offset[table[:, 0]], count[table[:, 0]] = table[:, 1], table[:, 2]
    return Entries(offset, count)
