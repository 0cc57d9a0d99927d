"""Records of an MCAP file, read within bounds.

The `mcap` library parses; a `BoundedFile` keeps it from believing a length that a file states.
"""

import os
import struct
import zlib
from collections import Counter
from collections.abc import Container, Iterator
from contextlib import contextmanager
from io import BufferedReader, FileIO
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, ChunkIndex, Footer
from mcap.stream_reader import StreamReader
from mcap.summary import Summary

from vobench.errors import SequenceError

NO_CHANNEL = -1
MAGIC = b"\x89MCAP0\r\n"
LFS_START = b"version https://git-lfs"
MAX_BYTES = 1 << 28  # of a record, and of a decompressed chunk; a writer's chunks are a thousand times smaller
MAX_RECORDS = 1 << 20  # in a chunk; a few bytes of zstd could decompress to endless empty ones
HEAD = struct.Struct("<BQ")  # opcode, length of what follows
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
CRC_BYTES = 4
FOOTER_BYTES = HEAD.size + struct.calcsize("<QQI")  # places of summary and summary offsets, checksum of both
MESSAGE_INDEX_HEAD = HEAD.size + struct.calcsize("<HI")
MESSAGE_INDEX_ENTRY = 16

Record = TypeVar("Record")
ChannelCounts = dict[int, int]  # number of messages by channel


def part_of(path: Path) -> Path:
    """The name of a file while it is being written."""
    return path.with_name(path.name + ".part")


class BoundedFile(BufferedReader):
    """A file that never reads more than it holds, whatever length its records state."""

    def __init__(self, path: Path) -> None:
        super().__init__(FileIO(path))
        file_bytes = os.fstat(self.fileno()).st_size
        self._most = min(file_bytes, MAX_BYTES)

    def read(self, size: int | None = -1, /) -> bytes:
        """Exactly `size` bytes. Raises ValueError where they are too many, or not all there."""
        if size is None or not 0 <= size <= self._most:
            raise ValueError(f"{size} bytes are stated where at most {self._most} are read")
        data = super().read(size)
        if len(data) < size:
            raise ValueError(f"{size} bytes are stated, but {len(data)} are left")
        return data


@contextmanager
def parsing(path: Path) -> Iterator[None]:
    """Turn any error inside into a SequenceError of one line: parsers raise a dozen unrelated kinds."""
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
        raise SequenceError(f"{_diagnosis(path, error)}: {path}") from error


def _diagnosis(path: Path, error: Exception) -> str:
    """What is wrong with a file that raised an error, by its first and last bytes."""
    try:
        with path.open("rb") as stream:
            start = stream.read(len(LFS_START))
            file_bytes = os.fstat(stream.fileno()).st_size
            stream.seek(max(0, file_bytes - len(MAGIC)))
            end = stream.read()
    except OSError as unreadable:
        return f"the recording cannot be opened ({unreadable.strerror})"
    if start == LFS_START:
        return "this is a Git-LFS pointer instead of the recording; `git lfs pull` fetches it"
    if not start.startswith(MAGIC):
        return "not an MCAP recording by its first bytes"
    if end != MAGIC:
        return "the recording was cut off, its end is missing; `mcap recover` (mcap.dev) saves the complete chunks"
    reason = str(error).splitlines()[0] if str(error) else "no reason given"
    return f"the recording is damaged ({type(error).__name__}: {reason})"


def decompressed(compression: str, data: bytes, size: int) -> bytes:
    """The bytes of a chunk, never more than `size` and MAX_BYTES. Raises ValueError, or the codec's own error."""
    if size > MAX_BYTES:
        raise ValueError(f"a chunk states {size} decompressed bytes where at most {MAX_BYTES} are read")
    if not compression:
        return data
    if compression == "zstd":
        stated = zstandard.frame_content_size(data)  # -1: not stated
        if stated not in (-1, size):  # the library goes by the frame's number, and by ours where it has none
            raise ValueError(f"a chunk states {size} decompressed bytes, and its frame states {stated}")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if compression == "lz4":
        decompressor = lz4.frame.LZ4FrameDecompressor()
        content = bytes(decompressor.decompress(data, max_length=size))
        if not decompressor.eof:
            raise ValueError(f"a chunk states {size} decompressed bytes and has more, or was cut off")
        return content
    raise ValueError(f"a chunk has the compression {compression!r}; zstd and lz4 are known")


def messages_in(chunk: Chunk, channels: Container[int]) -> Iterator[tuple[int, int, memoryview]]:
    """Channel, log time in ns and data of each message of some channels, in the order of the chunk.

    Raises ValueError where the chunk is damaged. The library's own iteration has no bound on empty records.
    """
    records = memoryview(decompressed(chunk.compression, chunk.data, chunk.uncompressed_size))
    stated_crc = chunk.uncompressed_crc
    has_wrong_size = len(records) != chunk.uncompressed_size
    if has_wrong_size or (stated_crc and zlib.crc32(records) != stated_crc):
        raise ValueError("the checksum of a chunk differs from its content")

    end = 0
    for _ in range(MAX_RECORDS):
        if end == len(records):
            return
        opcode, length = HEAD.unpack_from(records, end)
        begin = end + HEAD.size
        end = begin + length
        if end > len(records):
            raise ValueError("a record runs over the end of its chunk")
        if opcode != Opcode.MESSAGE:
            continue
        channel, _, log_ns, _ = MESSAGE.unpack_from(records, begin)
        if channel in channels:
            yield channel, log_ns, records[begin + MESSAGE.size : end]
    raise ValueError(f"{MAX_RECORDS} records and more lie in one chunk")


def read_messages(
    stream: BinaryIO, chunk: ChunkIndex, channels: Container[int]
) -> Iterator[tuple[int, int, memoryview]]:
    """As `messages_in`, of the chunk at the place that an index has for it."""
    return messages_in(read_record(stream, chunk.chunk_start_offset, Chunk), channels)


def read_record(stream: BinaryIO, offset: int, kind: type[Record]) -> Record:
    """The record of a kind that begins at an offset. Raises ValueError where another one does."""
    stream.seek(offset)
    record = next(StreamReader(stream, skip_magic=True, emit_chunks=True).records)
    if not isinstance(record, kind):
        raise ValueError(f"a {kind.__name__} should begin at {offset}, but a {type(record).__name__} does")
    return record


class CheckedSummary(NamedTuple):
    """The records behind the data, and how many messages of each channel each chunk has."""

    summary: Summary
    counts: tuple[ChannelCounts, ...]


def read_summary(stream: BinaryIO) -> CheckedSummary:
    """The summary of a file. Raises ValueError where there is none, or its records contradict each other."""
    _require_checksum(stream)
    stream.seek(0)
    summary = make_reader(stream).get_summary()
    if summary is None or summary.statistics is None:
        raise ValueError("its summary has no statistics")
    for chunk, following in pairwise(summary.chunk_indexes):
        # Without this, a few bytes could state endless chunks.
        if following.chunk_start_offset < chunk.chunk_start_offset + chunk.chunk_length:
            raise ValueError("the chunks of its summary overlap")

    counts = tuple(map(_counts, summary.chunk_indexes))
    indexed: Counter[int] = sum(map(Counter, counts), Counter())
    stated = Counter(summary.statistics.channel_message_counts)
    if stated != indexed:
        raise ValueError("its summary counts other messages than its message indexes do")
    used_schemas = {channel.schema_id for channel in summary.channels.values()}
    unknown_schemas = used_schemas - {0, *summary.schemas}
    unknown_channels = stated.keys() - summary.channels.keys()
    if unknown_schemas or unknown_channels:
        raise ValueError("its summary names a channel or a message type that it does not describe")
    return CheckedSummary(summary, counts)


def _require_checksum(stream: BinaryIO) -> None:
    """Raise ValueError unless there is a summary, and its checksum is right."""
    footer_place = stream.seek(-FOOTER_BYTES - len(MAGIC), os.SEEK_END)
    footer = read_record(stream, footer_place, Footer)
    if not 0 < footer.summary_start <= footer_place:
        raise ValueError("it has no summary")
    stream.seek(footer.summary_start)
    checked_bytes = footer_place + FOOTER_BYTES - CRC_BYTES - footer.summary_start
    checked = stream.read(checked_bytes)
    if footer.summary_crc and zlib.crc32(checked) != footer.summary_crc:
        raise ValueError("the checksum of its summary is wrong")


def _counts(chunk: ChunkIndex) -> ChannelCounts:
    """How many messages of each channel a chunk has, by the size of their indexes.

    The indexes lie one behind the other; each ends where the next one begins.
    """
    channels = chunk.message_index_offsets
    ordered = sorted(channels, key=lambda channel: (channels[channel], channel))
    begins = [channels[channel] for channel in ordered]
    last_end = chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length
    ends = [*begins[1:], last_end]
    counts = {}
    for channel, begin, end in zip(ordered, begins, ends, strict=False):
        entry_bytes = end - begin - MESSAGE_INDEX_HEAD
        count, rest = divmod(entry_bytes, MESSAGE_INDEX_ENTRY)
        if rest or count < 0:
            raise ValueError(f"the message index at {begin} ends within an entry")
        counts[channel] = count
    return counts
