"""Messages put together by hand are those that rosbags makes, byte for byte."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import SequenceError
from vobench.geometry.camera import Pinhole
from vobench.sequence import messages as ros
from vobench.sequence.cdr import picture_in, pictured, serialise, stamped

STAMPS = st.integers(0, 2**31 * 10**9 - 1)


@given(STAMPS, st.binary(max_size=9), st.sampled_from(["png", "jpeg"]), st.text("abcdefgh", max_size=9))
def test_a_picture_in_a_template_is_the_message_and_comes_out_as_it_went_in(t_ns, encoded, form, frame):
    made = pictured(serialise(ros.image(0, frame, b"", form)), t_ns, encoded)
    assert made == serialise(ros.image(t_ns, frame, encoded, form))
    found_ns, found_form, found = picture_in(memoryview(made))
    assert (found_ns, found_form, bytes(found)) == (t_ns, form, encoded)


@given(STAMPS)
def test_a_calibration_stamped_anew_is_the_calibration_of_that_stamp(t_ns):
    camera = Pinhole(48, 32, 40.5, 41.25, 23.5, 15.5)
    made = stamped(serialise(ros.camera_info(0, "cam_left", camera)), t_ns)
    assert made == serialise(ros.camera_info(t_ns, "cam_left", camera))


@pytest.mark.parametrize("t_ns", [-1, 2**31 * 10**9])
def test_a_stamp_that_ros_cannot_hold_is_refused(t_ns):
    with pytest.raises(SequenceError, match=rf"lies between 0 and 2147483647999999999 ns \(in 2038\), got {t_ns} ns"):
        stamped(bytes(20), t_ns)


def test_a_message_cut_anywhere_is_no_picture():
    whole = serialise(ros.image(7, "cam_left", b"12345", "png"))
    for end in range(len(whole)):
        with pytest.raises((ValueError, struct.error)):
            picture_in(memoryview(whole[:end]))
    with pytest.raises(ValueError, match="not in little-endian"):
        picture_in(memoryview(b"\0\0" + whole[2:]))


def test_an_imu_says_that_it_knows_no_orientation_and_how_noisy_it_is():
    message = ros.imu(5, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0], (0.25, 0.5))
    assert message.orientation_covariance[0] == -1
    np.testing.assert_array_equal(message.angular_velocity_covariance.reshape(3, 3), 0.25 * np.eye(3))
    np.testing.assert_array_equal(message.linear_acceleration_covariance.reshape(3, 3), 0.5 * np.eye(3))
    again = ros.TYPES.deserialize_cdr(serialise(message), ros.IMU.type_name)
    assert (again.linear_acceleration.z, again.header.frame_id) == (6.0, "imu")
