"""Records of a file are read within bounds, and no length that it states is believed."""

import struct
import zlib

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata

from vobench.errors import SequenceError
from vobench.sequence.mcap_file import (
    HEAD,
    MAGIC,
    MAX_BYTES,
    MAX_RECORDS,
    MESSAGE,
    BoundedFile,
    decompressed,
    messages_in,
    parsing,
    part_of,
    read_record,
)

DATA = b"abcd"
RECORDS = (
    HEAD.pack(99, 2) + b"??" + HEAD.pack(Opcode.MESSAGE, MESSAGE.size + len(DATA)) + MESSAGE.pack(3, 0, 7, 7) + DATA
)
PACK = {"": bytes, "zstd": zstandard.ZstdCompressor().compress, "lz4": lz4.frame.compress}
SIZE = len(RECORDS)


def chunk(packing, packed, *, size=SIZE, checksum=0):
    return Chunk(packing, packed, 7, 7, checksum, size)


@pytest.mark.parametrize("packing", PACK)
def test_a_chunk_unpacks_to_its_messages_and_one_that_states_another_size_is_refused(packing):
    packed = PACK[packing](RECORDS)
    for checksum in (0, zlib.crc32(RECORDS)):
        ((channel, log_ns, data),) = messages_in(chunk(packing, packed, checksum=checksum), {3})
        assert (channel, log_ns, bytes(data)) == (3, 7, DATA)
    assert list(messages_in(chunk(packing, packed), {4})) == []
    for size in (SIZE - 1, SIZE + 1, MAX_BYTES + 1, 2**63):
        with pytest.raises((ValueError, RuntimeError)):
            list(messages_in(chunk(packing, packed, size=size), {3}))


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (chunk("", RECORDS, checksum=1), "the checksum of a chunk differs"),
        (
            chunk("zstd", PACK["zstd"](RECORDS), size=12),
            f"a chunk states 12 decompressed bytes, and its frame states {SIZE}",
        ),
        (chunk("gzip", RECORDS), "the compression 'gzip'; zstd and lz4 are known"),
        (chunk("", RECORDS[:-1], size=SIZE - 1), "runs over the end of its chunk"),
        (chunk("", bytes(9 * (MAX_RECORDS + 1)), size=9 * (MAX_RECORDS + 1)), f"{MAX_RECORDS} records and more"),
    ],
)
def test_a_damaged_chunk_is_told_by_what_is_wrong(bad, said):
    with pytest.raises(ValueError, match=said):
        list(messages_in(bad, {3}))


def test_no_more_is_read_than_there_is(tmp_path):
    (tmp_path / "a").write_bytes(bytes(range(13)))
    with BoundedFile(tmp_path / "a") as stream:
        stream.seek(9)
        assert stream.read(4) == bytes(range(9, 13))
        for offset, length, said in ((9, 5, "but 4 are left"), (99, 1, "but 0 are left"), (0, 1 << 60, "at most 13")):
            stream.seek(offset)
            with pytest.raises(ValueError, match=said):
                stream.read(length)
        for lengths in ((-1,), (None,), ()):
            with pytest.raises(ValueError, match="at most 13 are read"):
                stream.read(*lengths)


def test_a_record_of_another_kind_or_with_a_false_length_within_is_refused(tmp_path):
    """The length of a note's name says 4 GiB: the library would ask for them."""
    (tmp_path / "a").write_bytes(HEAD.pack(Opcode.METADATA, 8) + struct.pack("<II", 0xFFFFFFFF, 0))
    said = "4294967295 bytes are stated where at most 17 are read"
    with BoundedFile(tmp_path / "a") as stream, pytest.raises(ValueError, match=said):
        read_record(stream, 0, Metadata)
    (tmp_path / "b").write_bytes(HEAD.pack(Opcode.METADATA, 8) + bytes(8))
    with BoundedFile(tmp_path / "b") as stream:
        assert read_record(stream, 0, Metadata).name == ""
        with pytest.raises(ValueError, match="a Chunk should begin at 0, but a Metadata does"):
            read_record(stream, 0, Chunk)


@pytest.mark.parametrize("packing", PACK)
def test_a_chunk_decompresses_to_what_was_compressed(packing):
    assert bytes(decompressed(packing, PACK[packing](RECORDS), SIZE)) == RECORDS


def test_a_chunk_without_a_stated_size_is_read_up_to_the_one_of_its_record():
    compressor = zstandard.ZstdCompressor(write_content_size=False)
    assert decompressed("zstd", compressor.compress(RECORDS), SIZE) == RECORDS
    with pytest.raises(ValueError, match=f"a chunk states {SIZE - 1} decompressed bytes and has more, or was cut off"):
        decompressed("lz4", PACK["lz4"](RECORDS), SIZE - 1)
    with pytest.raises(ValueError, match=f"at most {MAX_BYTES} are read"):
        decompressed("", b"", MAX_BYTES + 1)
    assert decompressed("", b"", MAX_BYTES) == b""


def test_messages_come_in_the_order_of_the_chunk_and_of_the_channels_that_are_asked_for():
    messages = b"".join(
        HEAD.pack(Opcode.MESSAGE, MESSAGE.size + 1) + MESSAGE.pack(channel, 0, log_ns, 0) + bytes([log_ns])
        for channel, log_ns in ((1, 5), (2, 6), (1, 7))
    )
    bag = chunk("", messages, size=len(messages))
    found = [(channel, log_ns, bytes(data)) for channel, log_ns, data in messages_in(bag, {1})]
    assert found == [(1, 5, b"\x05"), (1, 7, b"\x07")]
    assert len(list(messages_in(bag, {1, 2}))) == 3
    assert list(messages_in(chunk("", b"", size=0), {1})) == []


def test_an_error_says_what_is_wrong_with_the_file(tmp_path):
    path = tmp_path / "sensors.mcap"
    for content, said in (
        (b"version https://git-lfs.github.com", "this is a Git-LFS pointer"),
        (b"hello", "not an MCAP recording by its first bytes"),
        (MAGIC + b"half", "the recording was cut off, its end is missing"),
        (MAGIC + b"odd" + MAGIC, r"the recording is damaged \(KeyError: 'first'\)"),
    ):
        path.write_bytes(content)
        with pytest.raises(SequenceError, match=said) as caught, parsing(path):
            raise KeyError("first")
        assert str(caught.value).endswith(f": {path}")
    with pytest.raises(SequenceError, match=r"\(ValueError: no reason given\)"), parsing(path):
        raise ValueError


def test_an_unfinished_recording_is_told_from_a_missing_one(tmp_path):
    path = tmp_path / "sensors.mcap"
    with pytest.raises(SequenceError, match=f"^no recording at {path}$"), parsing(path):
        path.read_bytes()
    part_of(path).touch()
    said = r"was never finished, its writer was stopped: .*sensors\.mcap\.part$"
    with pytest.raises(SequenceError, match=said), parsing(path):
        path.read_bytes()
    with pytest.raises(SequenceError, match=r"^as it is$"), parsing(path):
        raise SequenceError("as it is")
