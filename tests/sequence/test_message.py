"""Stamps survive, and what is not known is marked as such."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vobench.sequence.cdr import serialise
from vobench.sequence.message import imu_message, odometry_message, stamp_ns, stamped_message
from vobench.sequence.message_type import TYPES
from vobench.sequence.topic import BODY, ENCODERS, IMU, WORLD


@given(st.integers(0, (2**31 - 1) * 10**9))
def test_every_stamp_survives(t_ns):
    assert stamp_ns(stamped_message(ENCODERS, t_ns, BODY, left=0, right=0)) == t_ns


def test_an_imu_says_that_it_knows_no_orientation_and_how_noisy_it_is():
    message = imu_message(5, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0], gyro_variance=0.25, accel_variance=0.5)
    assert message.orientation_covariance[0] == -1
    np.testing.assert_array_equal(message.angular_velocity_covariance.reshape(3, 3), 0.25 * np.eye(3))
    np.testing.assert_array_equal(message.linear_acceleration_covariance.reshape(3, 3), 0.5 * np.eye(3))
    again = TYPES.deserialize_cdr(serialise(message), IMU.type_name)
    assert (again.linear_acceleration.z, again.header.frame_id) == (6.0, "imu")


def test_an_imu_has_no_orientation_and_the_variances_of_each_axis():
    message = imu_message(5, [1, 2, 3], [4, 5, 6], gyro_variance=0.25, accel_variance=4.0)
    q = message.orientation
    assert (q.x, q.y, q.z, q.w) == (0, 0, 0, 1)
    assert message.orientation_covariance.tolist() == [-1] + [0] * 8
    np.testing.assert_array_equal(message.angular_velocity_covariance.reshape(3, 3), 0.25 * np.eye(3))
    np.testing.assert_array_equal(message.linear_acceleration_covariance.reshape(3, 3), 4.0 * np.eye(3))


def test_a_twist_that_is_not_known_says_so_and_one_that_is_has_its_numbers():
    known = odometry_message(5, np.eye(4), [1, 2, 3, 4, 5, 6]).twist
    assert (known.twist.linear.x, known.twist.linear.z, known.twist.angular.x, known.twist.angular.z) == (1, 3, 4, 6)
    assert not known.covariance.any()
    unknown = odometry_message(5, np.eye(4), None)
    assert unknown.twist.covariance.tolist() == [-1] + [0] * 35
    assert not unknown.pose.covariance.any()
    assert (unknown.header.frame_id, unknown.child_frame_id) == (WORLD, BODY)
