"""The index says where messages lie, and is believed only where it agrees with itself."""

import struct
import zlib
from dataclasses import replace

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from vobench.errors import SequenceError
from vobench.sequence import messages as ros
from vobench.sequence.bag import Bag, BagWriter
from vobench.sequence.mcap_index import (
    FOOTER,
    HEAD,
    MAGIC,
    MAX_BYTES,
    MAX_RECORDS,
    read_at,
    read_record,
    records_in,
    unpacked,
)
from vobench.sequence.messages import serialise
from vobench.sequence.salvage import salvage


@pytest.fixture(scope="module")
def long_folder(recording, tmp_path_factory):
    """A recording of several chunks."""
    count = 95
    t_ns = np.arange(count) * 1_000_000_000 // 30
    pick = np.arange(count) % len(recording.t_ns)
    encoder_t_ns = np.arange(1, int(t_ns[-1]) // 10_000_000 + 1) * 10_000_000
    return replace(
        recording,
        t_ns=t_ns,
        left=recording.left[pick],
        right=recording.right[pick],
        encoder_t_ns=encoder_t_ns,
        ticks=np.zeros((len(encoder_t_ns), 2), np.int64),
        T_map_body=recording.T_map_body[pick],
        twist=recording.twist[pick],
        slip=recording.slip[pick],
        push=recording.push[pick],
    ).write(tmp_path_factory.mktemp("long"))


@pytest.mark.parametrize("name", ["sensors.mcap", "truth.mcap"])
def test_counts_and_stamps_are_those_of_the_messages_that_another_reader_finds(long_folder, counts, name):
    bag = Bag.open(long_folder / name)
    found: dict[str, list[int]] = {topic: [] for topic in counts(bag.path)}
    with (long_folder / name).open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            found[channel.topic].append(message.log_time)
            assert bag.has(ros.Topic(channel.topic, schema.name))
    assert len(bag.index.offset) > 3
    assert counts(bag.path) == {topic: len(stamps) for topic, stamps in found.items()}
    for topic in (*ros.SENSOR_TOPICS, *ros.TRUTH_TOPICS):
        assert bag.stamps(topic).tolist() == found.get(topic.name, [])


def test_so_many_messages_lie_until_an_instant_as_their_stamps_say(long_folder):
    bag = Bag.open(long_folder / "sensors.mcap")
    for topic in (ros.LEFT_IMAGE, ros.ENCODERS, ros.TF_STATIC, ros.IMU):
        stamps = bag.stamps(topic)
        for t_ns in np.random.default_rng(0).integers(-(10**8), 4 * 10**9, 100).tolist() + stamps[:40].tolist():
            assert bag.count_until(topic, t_ns) == np.searchsorted(stamps, t_ns, side="right")


def test_what_has_one_stamp_is_in_one_chunk_and_a_chunk_lasts_no_longer_than_a_second(long_folder):
    index = Bag.open(long_folder / "sensors.mcap").index
    assert np.all(index.end_ns[:-1] < index.start_ns[1:] + (np.arange(len(index.offset) - 1) == 0))
    assert np.all(index.end_ns - index.start_ns < 1_000_000_000)


def test_a_chunk_ends_at_the_first_new_stamp_after_a_mebibyte(tmp_path):
    with BagWriter(tmp_path / "a", ros.IMAGE_TOPICS, encoded=True) as bag:
        for t_ns in range(10):
            for topic in ros.IMAGE_TOPICS:
                bag.write(topic, t_ns, serialise(ros.image(t_ns, "cam_left", bytes(400_000), "png")))
    assert Bag.open(tmp_path / "a").index.start_ns.tolist() == [0, 2, 4, 6, 8]


def write_foreign(path, count=30, **options):
    """A file as the library writes it, with two topics."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=200, **options)
        writer.start(profile="ros2")
        schema = writer.register_schema(ros.ENCODERS.type_name, "ros2msg", b"")
        channels = [writer.register_channel(name, "cdr", schema) for name in (ros.ENCODERS.name, "/other")]
        for t_ns in range(count):
            writer.add_message(channels[t_ns % 2], t_ns, serialise(ros.wheel_ticks(t_ns, t_ns, -t_ns)), t_ns)
        writer.finish()
    return path


@pytest.mark.parametrize("packing", CompressionType)
def test_every_packing_is_read(tmp_path, packing):
    bag = Bag.open(write_foreign(tmp_path / "a", compression=packing))
    assert [m.left for _, m in bag.messages([ros.ENCODERS])] == list(range(0, 30, 2))
    assert [bag.message(ros.ENCODERS, *bag.nth((ros.ENCODERS,), n)).right for n in (0, 7, 14)] == [0, -14, -28]


@pytest.mark.parametrize(
    "options", [{"use_chunking": False}, {"index_types": IndexType.NONE}, {"use_statistics": False}]
)
def test_a_file_without_an_index_is_refused_and_comes_back_with_one(tmp_path, counts, options):
    path = write_foreign(tmp_path / "a", **options)
    with pytest.raises(SequenceError, match=r"the recording is damaged .*; `vobench salvage` recovers what is whole"):
        Bag.open(path)
    salvage(path, tmp_path / "b")
    assert counts(tmp_path / "b") == {"/encoders": 15, "/other": 15}


def test_messages_that_fall_back_in_time_are_refused_when_they_come(tmp_path):
    with (tmp_path / "a").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel(
            ros.ENCODERS.name, "cdr", writer.register_schema(ros.ENCODERS.type_name, "ros2msg", b"")
        )
        for t_ns in (5, 4):
            writer.add_message(channel, t_ns, serialise(ros.wheel_ticks(t_ns, 0, 0)), t_ns)
        writer.finish()
    messages = Bag.open(tmp_path / "a").raw([ros.ENCODERS])
    next(messages)
    with pytest.raises(SequenceError, match="after 5 ns comes 4 ns"):
        next(messages)


def test_two_senders_of_a_topic_are_refused(tmp_path):
    with (tmp_path / "a").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for _ in range(2):
            schema = writer.register_schema(ros.ENCODERS.type_name, "ros2msg", b"")
            writer.register_channel(ros.ENCODERS.name, "cdr", schema)
        writer.finish()
    with pytest.raises(SequenceError, match=r"^/encoders should be vobench_msgs/msg/WheelTicks but is 2 channels in"):
        Bag.open(tmp_path / "a").has(ros.ENCODERS)


def record_places(data, begin):
    """Opcode and place of what each record holds, from one record on."""
    while data[begin:] != MAGIC:
        opcode, length = HEAD.unpack_from(data, begin)
        yield opcode, begin + HEAD.size
        begin += HEAD.size + length


@pytest.fixture
def summary(tmp_path):
    """A foreign file without a checksum of its summary, where each of its records lies, and how to change a number."""
    path = write_foreign(tmp_path / "a")
    data = bytearray(path.read_bytes())
    footer_at = len(data) - len(MAGIC) - FOOTER.size
    data[footer_at + FOOTER.size - 4 : footer_at + FOOTER.size] = bytes(4)
    path.write_bytes(data)
    assert Bag.open(path).count(ros.ENCODERS) == 15
    places = list(record_places(data, FOOTER.unpack_from(data, footer_at)[0]))

    def change(opcode, number, at, form, change_by):
        begin = [place for kind, place in places if kind == opcode][number] + at
        struct.pack_into(form, data, begin, struct.unpack_from(form, data, begin)[0] + change_by)
        path.write_bytes(data)
        return path

    return change


@pytest.mark.parametrize(
    ("where", "form", "change_by", "said"),
    [
        ((Opcode.CHUNK_INDEX, 0, 24), "<Q", 8, "ends within an entry"),
        ((Opcode.CHUNK_INDEX, 1, 48), "<Q", 16 * 20, "ends within an entry"),
        ((Opcode.CHUNK_INDEX, 0, 24), "<Q", 1 << 63, "recording is damaged"),
        ((Opcode.CHANNEL, 0, 0), "<H", 77, "names a channel or a message type that it does not describe"),
        ((Opcode.CHANNEL, 0, 2), "<H", 77, "names a channel or a message type that it does not describe"),
        ((Opcode.STATISTICS, 0, 48), "<Q", 1, "counts other messages than its message indexes do"),
        ((Opcode.FOOTER, 0, 16), "<I", 1, "the checksum of its summary is wrong"),
        ((Opcode.FOOTER, 0, 0), "<Q", 1 << 40, "it has no summary"),
    ],
)
def test_a_summary_that_contradicts_itself_or_the_file_is_refused(summary, where, form, change_by, said):
    path = summary(*where, form, change_by)
    with pytest.raises(SequenceError, match=said):
        Bag.open(path)


def test_chunks_that_overlap_are_refused(summary):
    """Else few bytes could state the same chunk again and again."""
    summary(Opcode.CHUNK_INDEX, 1, 16, "<Q", -150)
    path = summary(Opcode.CHUNK_INDEX, 1, 24, "<Q", 150)
    with pytest.raises(SequenceError, match="the chunks of its summary overlap"):
        Bag.open(path)


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
