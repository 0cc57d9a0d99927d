"""A bag opens in other people's readers, and ours believes no more of one than agrees with itself."""

import struct
from dataclasses import replace

import cv2
import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.sequence.bag import Bag
from vobench.sequence.bag_writer import BagWriter
from vobench.sequence.cdr import serialise
from vobench.sequence.mcap_file import (
    HEAD,
    MAGIC,
)
from vobench.sequence.message import image_message, stamped_message
from vobench.sequence.topic import BODY, ENCODERS, IMAGE_TOPICS, SENSOR_TOPICS, TRUTH_TOPICS, Topic

FOOTER = struct.Struct("<QQI")

COUNTS = {
    "sensors.mcap": {
        "/tf_static": 1,
        "/cam_left/camera_info": 9,
        "/cam_right/camera_info": 9,
        "/cam_left/image/compressed": 9,
        "/cam_right/image/compressed": 9,
        "/exposure": 9,
        "/encoders": 26,
    },
    "truth.mcap": {
        "/tf_static": 1,
        "/tf": 9,
        "/ground_truth/odometry": 9,
        "/ground_truth/disturbance": 9,
        "/ground_truth/cam_left/camera_info": 1,
        "/ground_truth/cam_right/camera_info": 1,
    },
}


def decoded(path, topics=None):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [(m.channel.topic, m.message, m.decoded_message) for m in reader.iter_decoded_messages(topics)]


@pytest.mark.parametrize("name", COUNTS)
def test_rosbags_lists_topics_and_counts(folder, name):
    with AnyReader([folder / name]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == COUNTS[name]


def test_rosbags_decodes_our_own_message_from_the_file_alone(recording, folder):
    with AnyReader([folder / "sensors.mcap"]) as reader:
        wheels = [c for c in reader.connections if c.topic == "/encoders"]
        ticks = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(wheels)]
    assert [(m.left, m.right) for m in ticks] == [tuple(pair) for pair in recording.ticks.tolist()]


def test_static_transforms_are_replayed_to_late_listeners(folder):
    with AnyReader([folder / "sensors.mcap"]) as reader:
        qos = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
    assert qos["/tf_static"][0].durability == QosDurability.TRANSIENT_LOCAL
    assert qos["/encoders"] == []


@pytest.mark.parametrize("name", COUNTS)
def test_times_rise_and_equal_the_stamps(folder, name):
    last = 0
    for _, message, content in decoded(folder / name):
        header = (content.transforms[0] if hasattr(content, "transforms") else content).header
        assert message.log_time == message.publish_time == header.stamp.sec * 10**9 + header.stamp.nanosec >= last
        last = message.log_time


def test_ros2_decoder_sees_the_pictures(recording, folder):
    images = [m for _, _, m in decoded(folder / "sensors.mcap", ["/cam_left/image/compressed"])]
    assert {(m.format, m.header.frame_id) for m in images} == {("png", "cam_left")}
    pictures = [cv2.imdecode(np.frombuffer(m.data, np.uint8), cv2.IMREAD_UNCHANGED) for m in images]
    np.testing.assert_array_equal(pictures, recording.left)


def test_all_frames_hang_on_one_tree(folder):
    edges, used = {}, set()
    for name in COUNTS:
        for _, _, content in decoded(folder / name):
            for t in getattr(content, "transforms", []):
                edges[t.child_frame_id] = t.header.frame_id
            if hasattr(content, "header"):
                used.add(content.header.frame_id)
    assert edges == {"cam_left": "base_link", "cam_right": "base_link", "base_link": "map"}
    assert used == {*edges, "map"}


def test_right_projection_holds_the_baseline(recording, folder):
    info = {topic: m for topic, _, m in decoded(folder / "sensors.mcap") if topic.endswith("camera_info")}
    left, right = (np.reshape(info[f"/{name}/camera_info"].p, (3, 4)) for name in ("cam_left", "cam_right"))
    point_left = np.array([0.3, -0.2, 2.0])
    point_right = se3.apply(se3.inverse(recording.rig.T_left_right), point_left[None])[0]
    u, v, w = right @ [*point_left, 1.0]
    np.testing.assert_allclose([u / w, v / w], recording.rig.right.project(point_right), atol=1e-12)
    np.testing.assert_allclose(left[:, :3], recording.rig.left.K)
    assert not left[:, 3].any()


def test_odometry_is_the_pose_and_the_twist_of_the_body(recording, folder):
    odometry = [m for _, _, m in decoded(folder / "truth.mcap", ["/ground_truth/odometry"])]
    assert {(m.header.frame_id, m.child_frame_id) for m in odometry} == {("map", "base_link")}
    twists = [[getattr(v, a) for v in (m.twist.twist.linear, m.twist.twist.angular) for a in "xyz"] for m in odometry]
    np.testing.assert_array_equal(twists, recording.twist)


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
            assert bag.has(Topic(channel.topic, schema.name))
    assert len(bag.counts) > 3
    assert counts(bag.path) == {topic: len(stamps) for topic, stamps in found.items()}
    for topic in (*SENSOR_TOPICS, *TRUTH_TOPICS):
        assert bag.stamps(topic).tolist() == found.get(topic.name, [])


def test_what_has_one_stamp_is_in_one_chunk_and_a_chunk_lasts_no_longer_than_a_second(long_folder):
    chunks = Bag.open(long_folder / "sensors.mcap").summary.chunk_indexes
    start_ns, end_ns = np.array([(c.message_start_time, c.message_end_time) for c in chunks], np.int64).T
    assert np.all(end_ns[:-1] < start_ns[1:] + (np.arange(len(chunks) - 1) == 0))
    assert np.all(end_ns - start_ns < 1_000_000_000)


def test_a_chunk_ends_at_the_first_new_stamp_after_a_mebibyte(tmp_path):
    with BagWriter(tmp_path / "a", IMAGE_TOPICS, encoded=True) as bag:
        for t_ns in range(10):
            for topic in IMAGE_TOPICS:
                bag.write(topic, t_ns, serialise(image_message(t_ns, "cam_left", bytes(400_000), codec="png")))
    chunks = Bag.open(tmp_path / "a").summary.chunk_indexes
    assert [chunk.message_start_time for chunk in chunks] == [0, 2, 4, 6, 8]


def write_foreign(path, count=30, **options):
    """A file as the library writes it, with two topics."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=200, **options)
        writer.start(profile="ros2")
        schema = writer.register_schema(ENCODERS.type_name, "ros2msg", b"")
        channels = [writer.register_channel(name, "cdr", schema) for name in (ENCODERS.name, "/other")]
        for t_ns in range(count):
            writer.add_message(
                channels[t_ns % 2], t_ns, serialise(stamped_message(ENCODERS, t_ns, BODY, left=t_ns, right=-t_ns)), t_ns
            )
        writer.finish()
    return path


@pytest.mark.parametrize("packing", CompressionType)
def test_every_packing_is_read(tmp_path, packing):
    bag = Bag.open(write_foreign(tmp_path / "a", compression=packing))
    assert [m.left for _, m in bag.messages([ENCODERS])] == list(range(0, 30, 2))
    messages = [serialise(stamped_message(ENCODERS, 2 * n, BODY, left=2 * n, right=-2 * n)) for n in range(15)]
    assert [bytes(bag.nth([ENCODERS], n)[0][1]) for n in (0, 7, 14)] == [messages[n] for n in (0, 7, 14)]


@pytest.mark.parametrize(
    "options", [{"use_chunking": False}, {"index_types": IndexType.NONE}, {"use_statistics": False}]
)
def test_a_file_without_an_index_is_refused(tmp_path, options):
    path = write_foreign(tmp_path / "a", **options)
    with pytest.raises(SequenceError, match=r"^the recording is damaged \(ValueError: .*a$"):
        Bag.open(path)


def test_messages_that_fall_back_in_time_are_refused_when_they_come(tmp_path):
    with (tmp_path / "a").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel(
            ENCODERS.name, "cdr", writer.register_schema(ENCODERS.type_name, "ros2msg", b"")
        )
        for t_ns in (5, 4):
            writer.add_message(channel, t_ns, serialise(stamped_message(ENCODERS, t_ns, BODY, left=0, right=0)), t_ns)
        writer.finish()
    messages = Bag.open(tmp_path / "a").raw([ENCODERS])
    next(messages)
    with pytest.raises(SequenceError, match="after 5 ns comes 4 ns"):
        next(messages)


def test_two_senders_of_a_topic_are_refused(tmp_path):
    with (tmp_path / "a").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for _ in range(2):
            schema = writer.register_schema(ENCODERS.type_name, "ros2msg", b"")
            writer.register_channel(ENCODERS.name, "cdr", schema)
        writer.finish()
    with pytest.raises(SequenceError, match=r"^/encoders should be vobench_msgs/msg/WheelTicks but is 2 channels in"):
        Bag.open(tmp_path / "a").has(ENCODERS)


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
    assert Bag.open(path).count(ENCODERS) == 15
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
