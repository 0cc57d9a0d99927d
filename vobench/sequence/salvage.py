"""All that is whole in a bag that was cut off or damaged, written as a proper one."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema
from mcap.writer import Writer

from vobench.errors import SequenceError
from vobench.sequence.bag import replacing
from vobench.sequence.mcap_index import (
    HEAD,
    MAGIC,
    MESSAGE,
    attached,
    part_of,
    read_at,
    read_index,
    records_in,
    unpacked,
    whole_note,
)
from vobench.sequence.writer import SENSORS_FILE, TRUTH_FILE

SALVAGE_NOTE = "vobench.salvage"
MAX_TOLD = 20  # a damaged file may lose thousands of records


@dataclass(frozen=True, slots=True)
class Salvaged:
    """What was recovered: how many messages of each topic, which attachments and notes; and in sentences, what not."""

    messages: dict[str, int]
    attachments: tuple[str, ...]
    notes: tuple[str, ...]
    lost: tuple[str, ...]


def salvage_sequence(folder: Path, out: Path) -> dict[str, Salvaged]:
    """Salvage both files of a sequence, finished or not, into another folder; by the names of the files.

    Of one that has nothing whole no file is made. Raises SequenceError where that is so of both, or there is neither.
    """
    found = {}
    for name in (SENSORS_FILE, TRUTH_FILE):
        whole = Path(folder) / name
        if torn := next((path for path in (whole, part_of(whole)) if path.exists()), None):
            found[name] = _salvaged(torn, Path(out) / name)
    if not found:
        raise SequenceError(f"no {SENSORS_FILE}, {TRUTH_FILE} or a .part of one in {folder}")
    if not any(what.messages for what in found.values()):
        raise SequenceError("; ".join(sentence for what in found.values() for sentence in what.lost))
    return found


def _salvaged(torn: Path, whole: Path) -> Salvaged:
    try:
        return salvage(torn, whole)
    except SequenceError as error:
        if error.__cause__:  # the disk
            raise
        return Salvaged({}, (), (), (str(error),))


def salvage(torn: Path, whole: Path) -> Salvaged:
    """Write every whole chunk, message, attachment and note of any MCAP file, finished or not, to another file.

    Raises SequenceError where nothing is whole, or `torn` is no MCAP file.
    """
    if Path(torn).resolve() in (Path(whole).resolve(), part_of(Path(whole)).resolve()):
        raise SequenceError(f"what is salvaged needs a file of its own, not the torn one: {torn}")
    try:
        with Path(torn).open("rb") as stream:
            Path(whole).parent.mkdir(parents=True, exist_ok=True)
            with replacing(Path(whole)) as out:
                return _rescue(stream, out, Path(torn))
    except OSError as error:
        raise SequenceError(f"cannot salvage ({error.strerror}): {error.filename or torn}") from error


def _rescue(stream: BinaryIO, out: BinaryIO, torn: Path) -> Salvaged:
    """Raises SequenceError before a file without a header or a message is given a name."""
    if stream.read(len(MAGIC)) != MAGIC:
        raise SequenceError(f"not an MCAP recording by its first bytes: {torn}")
    rescue = _Rescue(Writer(out))
    for offset, opcode, content in _records(stream, rescue.lose):
        rescue.take(offset, opcode, content)
    if not rescue.messages:
        raise SequenceError(f"no message is whole in {torn}")
    return rescue.finish()


def _records(stream: BinaryIO, lose: Callable[[str], None]) -> Iterator[tuple[int, int, memoryview]]:
    """Offset, opcode and content of each record of the data section.

    After one that is not all there it goes on at the next chunk, where the file still has a summary that names it.
    """
    offset, chunks = len(MAGIC), _chunks(stream)
    while True:
        try:
            opcode, length = HEAD.unpack(read_at(stream, offset, HEAD.size))
            content = read_at(stream, offset + HEAD.size, length)
        except ValueError as error:
            later = bisect_right(chunks, offset)
            if later == len(chunks):
                lose(f"all from byte {offset} on: {error}")
                return
            lose(f"all from byte {offset} to {chunks[later]}: {error}")
            offset = chunks[later]
            continue
        if opcode in (Opcode.DATA_END, Opcode.FOOTER):
            return
        yield offset, opcode, memoryview(content)
        offset += HEAD.size + length


def _chunks(stream: BinaryIO) -> list[int]:
    """Where chunks begin by the summary; none where it is missing or damaged."""
    try:
        return list(map(int, read_index(stream).offset))
    except Exception:
        return []


@dataclass(slots=True)
class _Rescue:
    """Copies records to a writer, which numbers schemas and channels anew: by old number, the new one."""

    writer: Writer
    started: bool = False
    schemas: dict[int, int] = field(default_factory=lambda: {0: 0})
    channels: dict[int, tuple[int, str]] = field(default_factory=dict)
    messages: Counter[str] = field(default_factory=Counter)
    attachments: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    told: list[str] = field(default_factory=list)
    untold: int = 0

    def lose(self, sentence: str) -> None:
        """Tell what was lost, of much the beginning."""
        if len(self.told) < MAX_TOLD:
            self.told.append(sentence)
        else:
            self.untold += 1

    def take(self, offset: int, opcode: int, content: memoryview) -> None:
        """Copy a record, a chunk only if all of it can be read."""
        if opcode != Opcode.CHUNK:
            self._try(offset, opcode, content)
            return
        try:
            records = unpacked(content)
            sum(1 for _ in records_in(records))
        except Exception as error:  # a damaged chunk makes its unpacker raise errors of several unrelated kinds
            self.lose(f"the chunk at byte {offset}: {error}")
            return
        for kind, record in records_in(records):
            self._try(offset, kind, record)

    def _try(self, offset: int, opcode: int, content: memoryview) -> None:
        try:
            self._copy(opcode, content)
        except OSError:  # of the file that is written
            raise
        except Exception as error:  # the library's parsers too raise what they like
            self.lose(f"a record at byte {offset}: {type(error).__name__}: {error}")

    def _copy(self, opcode: int, content: memoryview) -> None:
        if not self.started:
            header = Header.read(_stream(content)) if opcode == Opcode.HEADER else Header("", "")
            self.writer.start(profile=header.profile, library=header.library)
            self.started = True
        match opcode:
            case Opcode.SCHEMA:
                schema = Schema.read(_stream(content))
                if schema.id not in self.schemas:
                    self.schemas[schema.id] = self.writer.register_schema(schema.name, schema.encoding, schema.data)
            case Opcode.CHANNEL:
                self._copy_channel(Channel.read(_stream(content)))
            case Opcode.MESSAGE:
                self._copy_message(content)
            case Opcode.ATTACHMENT:
                self._copy_attachment(content)
            case Opcode.METADATA:
                note = Metadata.read(_stream(content))
                whole_note(note)
                self.writer.add_metadata(note.name, note.metadata)
                self.notes.append(note.name)

    def _copy_channel(self, channel: Channel) -> None:
        if channel.id not in self.channels:
            kind = channel.message_encoding, self.schemas[channel.schema_id], channel.metadata
            self.channels[channel.id] = self.writer.register_channel(channel.topic, *kind), channel.topic

    def _copy_message(self, content: memoryview) -> None:
        channel, sequence, log_ns, publish_ns = MESSAGE.unpack_from(content)
        number, topic = self.channels[channel]
        data = bytes(content[MESSAGE.size :])
        self.writer.add_message(number, log_time=log_ns, data=data, publish_time=publish_ns, sequence=sequence)
        self.messages[topic] += 1

    def _copy_attachment(self, content: memoryview) -> None:
        found = attached(content)
        self.writer.add_attachment(found.create_time, found.log_time, found.name, found.media_type, found.data)
        self.attachments.append(found.name)

    def finish(self) -> Salvaged:
        """Note what was lost and end the file."""
        lost = (*self.told, f"and {self.untold} more") if self.untold else tuple(self.told)
        if lost:
            self.writer.add_metadata(SALVAGE_NOTE, {"lost": "; ".join(lost)})
        self.writer.finish()  # type: ignore[no-untyped-call]
        return Salvaged(dict(self.messages), tuple(self.attachments), tuple(self.notes), lost)


def _stream(content: memoryview) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))
