"""Other people's readers open both files and see the same messages in order of time."""

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from vobench.geometry import se3

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
