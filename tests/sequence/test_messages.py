"""Geometry survives the way into ROS fields and back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import SequenceError
from vobench.geometry.camera import Pinhole
from vobench.sequence import messages as ros

CAMERA = Pinhole(720, 480, 658.3, 545.1, 359.5, 239.5)


@given(st.integers(0, (2**31 - 1) * 10**9))
def test_every_stamp_survives(t_ns):
    assert ros.stamp_ns(ros.wheel_ticks(t_ns, 0, 0)) == t_ns


def test_every_type_survives_serialisation():
    for message in (
        ros.camera_info(5, "cam_left", CAMERA),
        ros.png_image(5, "cam_left", b"png"),
        ros.wheel_ticks(5, -(2**62), 2**62),
        ros.odometry(5, np.eye(4), np.arange(6.0)),
        ros.transforms(5, "map", {"base_link": np.eye(4)}),
    ):
        raw = ros.TYPES.serialize_cdr(message, message.__msgtype__)
        again = ros.TYPES.serialize_cdr(ros.TYPES.deserialize_cdr(raw, message.__msgtype__), message.__msgtype__)
        assert bytes(raw) == bytes(again)


def test_camera_survives():
    assert ros.pinhole(ros.camera_info(0, "cam_left", CAMERA)) == CAMERA


def test_camera_with_distortion_is_refused():
    bent = replace(ros.camera_info(0, "cam_left", CAMERA), d=np.array([0.1, 0, 0, 0, 0]))
    with pytest.raises(SequenceError, match=r"^camera cam_left has distortion \[0\.1, "):
        ros.pinhole(bent)
