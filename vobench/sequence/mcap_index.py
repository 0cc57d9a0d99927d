"""MCAP records and their index, read within bounds: no stated length is believed unchecked."""

import os
import struct
import zlib
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Channel, Metadata, MetadataIndex, Schema, Statistics
from numpy.typing import NDArray

from vobench.errors import SequenceError

MAGIC = b"\x89MCAP0\r\n"
LFS_START = b"version https://git-lfs"
MAX_BYTES = 1 << 28  # of a record, and of a chunk unpacked; a writer's chunks are a thousand times smaller
MAX_RECORDS = 1 << 20  # in a chunk or a summary; a few bytes of zstd could unpack to endless empty ones

HEAD = struct.Struct("<BQ")  # opcode, length of what follows
CHUNK = struct.Struct("<QQQII")  # first and last log time, size and checksum unpacked, length of the name that follows
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
DATA_LENGTH = struct.Struct("<Q")
CHECKSUM = "vobench.crc32"  # the entry of a note of ours that is the checksum of the others

Packed = bytes | memoryview


@contextmanager
def parsing(path: Path) -> Iterator[None]:
    """Say of any failure inside, in one line, what is wrong with the file at `path`.

    A torn or foreign file makes parsers raise errors of a dozen unrelated kinds.
    """
    try:
        yield
    except SequenceError:
        raise
    except FileNotFoundError:
        raise SequenceError(_missing(path)) from None
    except Exception as error:
        raise SequenceError(f"{_ailment(path, error)}: {path}") from error


def _missing(path: Path) -> str:
    part = part_of(path)
    if part.exists():
        return f"the recording was never finished; `vobench salvage` recovers what is whole: {part}"
    return f"no recording at {path}"


def part_of(path: Path) -> Path:
    """Where a file is while it is being written."""
    return path.with_name(path.name + ".part")


def _ailment(path: Path, error: Exception) -> str:
    """What is wrong with a file that could not be read, by its first and its last bytes."""
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
        return "the recording was cut off, its end is missing; `vobench salvage` recovers what is whole"
    reason = str(error).splitlines()[0] if str(error) else "no reason given"
    return f"the recording is damaged ({type(error).__name__}: {reason}); `vobench salvage` recovers what is whole"


def read_at(stream: BinaryIO, offset: int, length: int) -> bytes:
    """Just these bytes of a file. Raises ValueError where they are too many, or not all there."""
    if length > MAX_BYTES:
        raise ValueError(f"{length} bytes are stated where at most {MAX_BYTES} are read")
    stream.seek(offset)
    left = os.fstat(stream.fileno()).st_size - offset
    if length > left:
        raise ValueError(f"{length} bytes are stated at {offset}, but {max(0, left)} are left")
    return stream.read(length)


def read_record(stream: BinaryIO, offset: int, opcode: Opcode) -> bytes:
    """What a record of this kind holds. Raises ValueError where there is none."""
    found, length = HEAD.unpack(read_at(stream, offset, HEAD.size))
    if found != opcode:
        raise ValueError(f"{opcode.name.lower()} should begin at {offset}, but record {found} does")
    return read_at(stream, offset + HEAD.size, length)


def unpacked(chunk: bytes | memoryview) -> memoryview:
    """The records of a chunk, from what its record holds. Raises ValueError where it is damaged or too large."""
    _, _, size, checksum, name_length = CHUNK.unpack_from(chunk)
    packing = bytes(chunk[CHUNK.size : CHUNK.size + name_length]).decode()
    at = CHUNK.size + name_length
    (length,) = DATA_LENGTH.unpack_from(chunk, at)
    packed = memoryview(chunk)[at + DATA_LENGTH.size :]
    if length != len(packed):
        raise ValueError(f"a chunk of {len(packed)} bytes states {length}")
    records = memoryview(unpack(packing, packed, size))
    if len(records) != size or (checksum and zlib.crc32(records) != checksum):
        raise ValueError("the checksum of a chunk differs from its content")
    return records


def unpack(packing: str, packed: Packed, size: int) -> Packed:
    """The bytes of a chunk, never more than `size` and MAX_BYTES.

    Raises ValueError, or an error of the packing's own, where it is none.
    """
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


def records_in(records: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Opcode and content of each record of an unpacked chunk. Raises ValueError where one runs over the end."""
    at, end = 0, len(records)
    for _ in range(MAX_RECORDS):
        if at >= end:
            return
        opcode, length = HEAD.unpack_from(records, at)
        at += HEAD.size + length
        if at > end:
            raise ValueError("a record runs over the end of its chunk")
        yield opcode, records[at - length : at]
    raise ValueError(f"{MAX_RECORDS} records and more lie in one place")


def messages_in(records: memoryview, channels: Container[int]) -> Iterator[tuple[int, int, memoryview]]:
    """Channel, log time in ns and data of each message of some channels, as they lie in an unpacked chunk."""
    for opcode, content in records_in(records):
        if opcode == Opcode.MESSAGE:
            channel, _, log_ns, _ = MESSAGE.unpack_from(content)
            if channel in channels:
                yield channel, log_ns, content[MESSAGE.size :]


def attached(content: bytes | memoryview) -> Attachment:
    """What an attachment's record holds. Raises ValueError where its checksum, the last four bytes, differs."""
    found: Attachment = Attachment.read(ReadDataStream(BytesIO(content)))
    stated = int.from_bytes(content[-4:], "little")
    if stated and zlib.crc32(content[:-4]) != stated:
        raise ValueError(f"the checksum of the attachment {found.name!r} differs from its content")
    return found


def checksum(entries: Mapping[str, str]) -> str:
    """The CRC-32 of a note's entries, whatever their order."""
    return f"{zlib.crc32(repr(sorted(entries.items())).encode()):08x}"


def whole_note(note: Metadata) -> dict[str, str]:
    """The entries of a note, less their checksum. Raises ValueError where it differs from them."""
    entries = dict(note.metadata)
    stated = entries.pop(CHECKSUM, None)
    if stated is not None and stated != checksum(entries):
        raise ValueError(f"the checksum of the note {note.name!r} differs from its content")
    return entries


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
