"""Messages put together by hand are those that rosbags makes, byte for byte."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import SequenceError
from vobench.geometry.camera import Pinhole
from vobench.sequence.camera_info import camera_info_message
from vobench.sequence.cdr import parse_picture, serialise, with_picture, with_stamp
from vobench.sequence.message import image_message

STAMPS = st.integers(0, 2**31 * 10**9 - 1)


@given(STAMPS, st.binary(max_size=9), st.sampled_from(["png", "jpeg"]), st.text("abcdefgh", max_size=9))
def test_a_picture_in_a_template_is_the_message_and_comes_out_as_it_went_in(t_ns, encoded, form, frame):
    made = with_picture(serialise(image_message(0, frame, b"", codec=form)), t_ns, encoded)
    assert made == serialise(image_message(t_ns, frame, encoded, codec=form))
    found_ns, found_form, colour, found = parse_picture(memoryview(made))
    assert colour == "mono8"
    assert (found_ns, found_form, bytes(found)) == (t_ns, form, encoded)


@given(STAMPS)
def test_a_calibration_stamped_anew_is_the_calibration_of_that_stamp(t_ns):
    camera = Pinhole(48, 32, 40.5, 41.25, 23.5, 15.5)
    made = with_stamp(serialise(camera_info_message(0, "cam_left", camera)), t_ns)
    assert made == serialise(camera_info_message(t_ns, "cam_left", camera))


@pytest.mark.parametrize("t_ns", [-1, 2**31 * 10**9])
def test_a_stamp_that_ros_cannot_hold_is_refused(t_ns):
    with pytest.raises(SequenceError, match=rf"lies between 0 and 2147483647999999999 ns \(in 2038\), got {t_ns} ns"):
        with_stamp(bytes(20), t_ns)


def test_a_message_cut_anywhere_is_no_picture():
    whole = serialise(image_message(7, "cam_left", b"12345", codec="png"))
    for end in range(len(whole)):
        with pytest.raises((ValueError, struct.error)):
            parse_picture(memoryview(whole[:end]))
    with pytest.raises(ValueError, match="not in little-endian"):
        parse_picture(memoryview(b"\0\0" + whole[2:]))
