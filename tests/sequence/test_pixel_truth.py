"""Channels of per-pixel ground truth as ROS pictures."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import SequenceError
from vobench.geometry.camera import Pinhole
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame, TruthNames
from vobench.sequence.pixel_truth import (
    check_truth,
    names_from_json,
    names_to_json,
    pixel_truth_topics,
    truth_image,
    truth_topic,
    truth_values,
)

CAMERA = Pinhole(5, 4, 3.0, 3.0, 2.0, 1.5)


@pytest.mark.parametrize("channel", CHANNELS)
def test_a_channel_comes_back_to_the_last_bit(channel):
    kind = CHANNELS[channel]
    values = np.random.default_rng(2).uniform(0, 3, kind.shape(4, 5)).astype(kind.dtype)
    message = truth_image(7, "left", channel, values)
    assert message.step * message.height == message.data.size
    assert (message.height, message.width, message.is_bigendian) == (4, 5, 0)
    found = truth_values(channel, message)
    assert found.dtype == values.dtype
    np.testing.assert_array_equal(found, values)


def test_encodings_are_those_of_ros():
    encodings = {
        name: truth_image(0, "left", name, np.zeros(kind.shape(2, 2), kind.dtype)).encoding
        for name, kind in CHANNELS.items()
    }
    assert encodings["depth"] == "32FC1"
    assert encodings["normals"] == "32FC3"
    assert encodings["flow"] == "32FC2"
    assert encodings["instance"] == encodings["shadow"] == "16UC1"
    assert encodings["moving"] == "mono8"
    mask = truth_image(0, "left", "moving", np.array([[True, False]]))
    assert mask.data.tolist() == [255, 0]


def test_a_picture_of_another_kind_is_refused():
    message = truth_image(7, "left", "depth", np.zeros((4, 5), np.float32))
    with pytest.raises(SequenceError, match="truth channel instance should be 16UC1, got 80 bytes of 4 × 5 32FC1"):
        truth_values("instance", message)
    short = truth_image(7, "left", "depth", np.zeros((4, 5), np.float32))
    short.height = 5
    with pytest.raises(SequenceError, match="truth channel depth should be 32FC1, got 80 bytes of 5 × 5 32FC1"):
        truth_values("depth", short)


def test_a_frame_has_the_channels_of_the_recording_in_the_size_of_the_camera():
    depth = np.zeros((4, 5), np.float32)
    check_truth(TruthFrame(depth=depth), ("depth",), CAMERA, "left")
    for frame, channels in (
        (TruthFrame(depth=depth), ("depth", "moving")),
        (TruthFrame(depth=depth, moving=np.zeros((4, 5), bool)), ("depth",)),
        (TruthFrame(depth=depth.T), ("depth",)),
        (TruthFrame(depth=depth.astype(float)), ("depth",)),
    ):
        with pytest.raises(SequenceError, match=r"^truth channel (depth|moving) of the left camera should be "):
            check_truth(frame, channels, CAMERA, "left")
    with pytest.raises(SequenceError, match="of the right camera"):
        check_truth(TruthFrame(depth=depth), ("depth",), replace(CAMERA, width_px=6), "right")


def test_topics_are_those_of_the_left_camera_first():
    names = [topic.name for topic in pixel_truth_topics(("depth", "flow"))]
    assert names == [
        "/ground_truth/cam_left/depth",
        "/ground_truth/cam_left/flow",
        "/ground_truth/cam_right/depth",
        "/ground_truth/cam_right/flow",
    ]
    assert pixel_truth_topics(("depth",), ("right",)) == (truth_topic("right", "depth"),)
    assert len(pixel_truth_topics()) == 2 * len(CHANNELS)


def test_names_come_back_and_other_files_are_refused():
    names = TruthNames(("", "chair"), ("", "wood", "öl"))
    assert names_from_json(names_to_json(names)) == names
    for data in (b"", b"[]", b'{"instance": []}', b'{"instance": 5, "material": []}'):
        with pytest.raises(SequenceError, match="are not lists of instances and materials"):
            names_from_json(data)
