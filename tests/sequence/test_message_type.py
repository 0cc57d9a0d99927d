"""Messages of every type survive serialisation."""

import numpy as np

from vobench.geometry.camera import Pinhole
from vobench.sequence.camera_info import camera_info_message
from vobench.sequence.message import image_message, odometry_message, stamped_message, tf_message
from vobench.sequence.message_type import TYPES
from vobench.sequence.topic import BODY, ENCODERS

CAMERA = Pinhole(720, 480, 658.3, 545.1, 359.5, 239.5)


def test_every_type_survives_serialisation():
    for message in (
        camera_info_message(5, "cam_left", CAMERA),
        image_message(5, "cam_left", b"png", codec="png"),
        stamped_message(ENCODERS, 5, BODY, left=-(2**62), right=2**62),
        odometry_message(5, np.eye(4), np.arange(6.0)),
        tf_message(5, "map", {"base_link": np.eye(4)}),
    ):
        raw = TYPES.serialize_cdr(message, message.__msgtype__)
        again = TYPES.serialize_cdr(TYPES.deserialize_cdr(raw, message.__msgtype__), message.__msgtype__)
        assert bytes(raw) == bytes(again)
