"""What is in a file is the same by its summary and by going through it."""

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.sequence.bag import Bag
from vobench.sequence.mcap_file import MAGIC
from vobench.sequence.message_type import TYPES
from vobench.sequence.recording import TopicFacts, is_recording, read_poses, topic_facts
from vobench.sequence.topic import Topic
from vobench.trajectory.trajectory import Trajectory


@pytest.mark.parametrize("name", ["sensors.mcap", "truth.mcap"])
def test_the_summary_and_the_messages_say_the_same(folder: Path, name: str) -> None:
    bag = Bag.open(folder / name)
    facts = topic_facts(folder / name)
    assert len(facts) > 5
    for each in facts:
        stamps = bag.stamps(Topic(each.name, each.type_name))
        assert (each.count, each.start_ns, each.end_ns) == (len(stamps), stamps[0], stamps[-1])


def test_a_rate_takes_two_instants() -> None:
    assert TopicFacts("/a", "x", 3, 0, 1_000_000_000).rate_hz == 2.0
    assert TopicFacts("/a", "x", 1, 5, 5).rate_hz is None
    assert TopicFacts("/a", "x", 0, None, None).rate_hz is None


def test_a_torn_file_is_a_sentence(folder: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes((folder / "sensors.mcap").read_bytes()[:-100])
    with pytest.raises(SequenceError, match=r"torn\.mcap"):
        topic_facts(torn)


# ruff: noqa: E501 - a sentence stands in one line


POSE, ODOMETRY = "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Odometry"


def wavy(n=20, first_ns=1_403_636_579_763_555_584):
    rng = np.random.default_rng(8)
    q = rng.normal(size=(n, 4))
    R = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    return Trajectory(first_ns + np.arange(n) * 50_000_001, se3.transform(R, rng.normal(size=(n, 3))))


def stamped(types, t_ns, T, frame="map"):
    make = types.types
    time = make["builtin_interfaces/msg/Time"](*divmod(int(t_ns), 10**9))
    header = make["std_msgs/msg/Header"]
    extra = (0,) if "seq" in header.__dataclass_fields__ else ()
    point, q = (
        make["geometry_msgs/msg/Point"](*T[:3, 3].tolist()),
        make["geometry_msgs/msg/Quaternion"](*se3.to_quaternion(T[:3, :3]).tolist()),
    )
    return make[POSE](header(*extra, time, frame), make["geometry_msgs/msg/Pose"](point, q))


def write_ros1(path: Path, trajectory: Trajectory) -> Path:
    types = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(path) as bag:
        channel = bag.add_connection("/pose", POSE, typestore=types)
        for t_ns, T in zip(trajectory.t_ns.tolist(), trajectory.T_world_frame, strict=True):
            bag.write(channel, t_ns, types.serialize_ros1(stamped(types, t_ns, T), POSE))
    return path


def write_ros2(folder: Path, trajectory: Trajectory, storage: StoragePlugin) -> Path:
    with Writer2(folder, version=9, storage_plugin=storage) as bag:
        channel = bag.add_connection("/pose", POSE, typestore=TYPES)
        for t_ns, T in zip(trajectory.t_ns.tolist(), trajectory.T_world_frame, strict=True):
            bag.write(channel, t_ns, TYPES.serialize_cdr(stamped(TYPES, t_ns, T), POSE))
    return folder


def assert_same(read: Trajectory, written: Trajectory):
    np.testing.assert_array_equal(read.t_ns, written.t_ns)
    np.testing.assert_allclose(read.T_world_frame, written.T_world_frame, atol=2e-15)


def test_a_ros_1_bag_is_known_by_its_content(tmp_path):
    path = write_ros1(tmp_path / "a.bag", wavy())
    path = path.rename(tmp_path / "poses.txt")
    assert is_recording(path)
    assert_same(read_poses(path, None), wavy())


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_ros_2_bag_is_a_folder_or_the_file_in_it(tmp_path, storage):
    folder = write_ros2(tmp_path / "bag", wavy(), storage)
    assert is_recording(folder)
    assert_same(read_poses(folder, "/pose"), wavy())
    (inner,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
    assert_same(read_poses(inner.rename(tmp_path / "poses"), None), wavy())


def test_our_own_truth_is_read_from_each_of_its_topics(folder, recording):
    truth = Trajectory(recording.t_ns, recording.T_map_body)
    for topic in (None, "/ground_truth/odometry", "/tf", "/tf:map.base_link"):
        assert_same(read_poses(folder / "truth.mcap", topic), truth)


@pytest.mark.parametrize(
    ("topic", "sentence"),
    [
        ("/pos", "no topic '/pos' in .* With poses: /ground_truth/odometry, /tf, /tf_static"),
        ("/tf:map.cam", "name one of the transforms in .*: /tf:map.base_link"),
        ("/tf_static", r"name one of the transforms in .*: /tf_static:base_link\.cam_left, /tf_static:base_link\.cam_right"),
    ],
)  # fmt: skip
def test_a_topic_that_is_not_there_is_answered_with_those_that_are(folder, topic, sentence):
    with pytest.raises(SequenceError, match=sentence):
        read_poses(folder / "truth.mcap", topic)


def test_a_recording_without_poses_says_so(folder):
    with pytest.raises(SequenceError, match="/encoders is vobench_msgs/msg/WheelTicks, which has no pose"):
        read_poses(folder / "sensors.mcap", "/encoders")
    with pytest.raises(SequenceError, match=r"name the topic with the poses of .*: /tf_static"):
        read_poses(folder / "sensors.mcap", None)


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_torn_recording_is_one_sentence(tmp_path, share):
    path = write_ros1(tmp_path / "a.bag", wavy())
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(SequenceError, match="not a whole recording") as caught:
        read_poses(path, None)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("stated", "sentence"), [(100, "ZstdError"), (2**31, "at most 268435456 are read")])
def test_a_chunk_that_unpacks_to_more_than_it_states_or_anyone_needs_is_never_unpacked(tmp_path, stated, sentence):
    """64 MiB of zeros in 6 kB, in a file of somebody else's."""
    packer = zstandard.ZstdCompressor(write_content_size=False).compressobj()
    packed = b"".join([*(packer.compress(bytes(1 << 20)) for _ in range(64)), packer.flush()])
    head = record(Opcode.HEADER, struct.pack("<I4sI", 4, b"ros2", 0))
    chunk = struct.pack("<QQQII4sQ", 0, 0, stated, 0, 4, b"zstd", len(packed)) + packed
    footer = record(Opcode.FOOTER, bytes(20))
    (tmp_path / "a").write_bytes(MAGIC + head + record(Opcode.CHUNK, chunk) + footer + MAGIC)
    tracemalloc.start()
    try:
        with pytest.raises(SequenceError, match=sentence):
            read_poses(tmp_path / "a", None)
        assert tracemalloc.get_traced_memory()[1] < 16 << 20
    finally:
        tracemalloc.stop()


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def test_poses_that_are_none_and_stamps_that_fall_are_refused(tmp_path):
    good = wavy(4)
    for i, (value, sentence) in enumerate(
        [(np.nan, "pose 2 of .* should be finite with a unit quaternion"), (1.0, "stamps must increase, but pose 2")]
    ):
        broken = Trajectory(good.t_ns.copy(), good.T_world_frame.copy())
        broken.T_world_frame[2, 0, 3] *= value
        broken.t_ns[2] = broken.t_ns[1] if value == 1 else broken.t_ns[2]
        folder = write_ros2(tmp_path / f"bag{i}", broken, StoragePlugin.MCAP)
        with pytest.raises(SequenceError, match=sentence):
            read_poses(folder, None)


def test_text_and_folders_of_anything_are_no_recording(tmp_path):
    (tmp_path / "a.bag").write_text("1 0 0 0 0 0 0 1\n")
    assert not is_recording(tmp_path / "a.bag")
    assert not is_recording(tmp_path)
