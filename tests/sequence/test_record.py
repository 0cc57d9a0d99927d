"""Records and chunks are believed no further than their bytes reach."""

import struct
import zlib

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode

from vobench.sequence.record import MAX_BYTES, MAX_RECORDS, read_at, read_record, records_in, unpacked

RECORDS = struct.pack("<BQ", 99, 4) + b"abcd"
PACK = {"": bytes, "zstd": zstandard.ZstdCompressor().compress, "lz4": lz4.frame.compress}


SIZE = len(RECORDS)


def chunk(packing, packed, *, size=SIZE, checksum=0, length=None):
    head = struct.pack("<QQQII", 0, 0, size, checksum, len(packing)) + packing.encode()
    return head + struct.pack("<Q", len(packed) if length is None else length) + packed


@pytest.mark.parametrize("packing", PACK)
@pytest.mark.parametrize("checksum", [0, zlib.crc32(RECORDS)])
def test_a_chunk_unpacks_to_its_records(packing, checksum):
    ((opcode, content),) = records_in(unpacked(chunk(packing, PACK[packing](RECORDS), checksum=checksum)))
    assert (opcode, bytes(content)) == (99, b"abcd")


@pytest.mark.parametrize("packing", PACK)
@pytest.mark.parametrize("size", [SIZE - 1, SIZE + 1, MAX_BYTES + 1, 2**63])
def test_a_chunk_that_states_another_size_is_refused(packing, size):
    with pytest.raises((ValueError, RuntimeError)):
        unpacked(chunk(packing, PACK[packing](RECORDS), size=size))


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (chunk("", RECORDS, checksum=1), "the checksum of a chunk differs"),
        (chunk("", RECORDS, length=SIZE - 1), "a chunk of 13 bytes states 12"),
        (chunk("zstd", PACK["zstd"](RECORDS), size=12), "a chunk states 12 bytes unpacked and 13"),
        (chunk("gzip", RECORDS), "packed as 'gzip'; zstd and lz4 are known"),
    ],
)
def test_a_damaged_chunk_is_told_by_what_is_wrong(bad, said):
    with pytest.raises(ValueError, match=said):
        unpacked(bad)


def test_a_record_that_runs_over_the_end_and_endless_empty_ones_are_refused():
    with pytest.raises(ValueError, match="runs over the end of its chunk"):
        list(records_in(memoryview(RECORDS[:-1])))
    with pytest.raises(ValueError, match=f"{MAX_RECORDS} records and more"):
        sum(1 for _ in records_in(memoryview(bytes(9 * (MAX_RECORDS + 1)))))


def test_no_more_is_read_than_there_is(tmp_path):
    (tmp_path / "a").write_bytes(RECORDS)
    with (tmp_path / "a").open("rb") as stream:
        assert read_record(stream, 0, 99) == b"abcd"
        assert read_at(stream, 9, 4) == b"abcd"
        for offset, length, said in ((9, 5, "but 4 are left"), (99, 1, "but 0 are left"), (0, 1 << 60, "at most")):
            with pytest.raises(ValueError, match=said):
                read_at(stream, offset, length)
        with pytest.raises(ValueError, match="chunk should begin at 0, but record 99 does"):
            read_record(stream, 0, Opcode.CHUNK)
