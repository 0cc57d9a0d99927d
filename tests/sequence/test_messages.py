"""Messages put together by hand are those that rosbags makes, byte for byte."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, DoubleSphere, Equirectangular, KannalaBrandt, Pinhole
from vobench.geometry.rig import PRESETS, mounted_rig, rectification, stereo_rig
from vobench.sequence.camera_info import camera_info_message, camera_info_messages, parse_camera
from vobench.sequence.cdr import parse_picture, serialise, with_picture, with_stamp
from vobench.sequence.message import image_message, imu_message, odometry_message, stamp_ns, stamped_message, tf_message
from vobench.sequence.message_type import TYPES
from vobench.sequence.topic import BODY, ENCODERS, IMU, LEFT_INFO, WORLD

STAMPS = st.integers(0, 2**31 * 10**9 - 1)


@given(STAMPS, st.binary(max_size=9), st.sampled_from(["png", "jpeg"]), st.text("abcdefgh", max_size=9))
def test_a_picture_in_a_template_is_the_message_and_comes_out_as_it_went_in(t_ns, encoded, form, frame):
    made = with_picture(serialise(image_message(0, frame, b"", form)), t_ns, encoded)
    assert made == serialise(image_message(t_ns, frame, encoded, form))
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
    whole = serialise(image_message(7, "cam_left", b"12345", "png"))
    for end in range(len(whole)):
        with pytest.raises((ValueError, struct.error)):
            parse_picture(memoryview(whole[:end]))
    with pytest.raises(ValueError, match="not in little-endian"):
        parse_picture(memoryview(b"\0\0" + whole[2:]))


def test_an_imu_says_that_it_knows_no_orientation_and_how_noisy_it_is():
    message = imu_message(5, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0], gyro_variance=0.25, accel_variance=0.5)
    assert message.orientation_covariance[0] == -1
    np.testing.assert_array_equal(message.angular_velocity_covariance.reshape(3, 3), 0.25 * np.eye(3))
    np.testing.assert_array_equal(message.linear_acceleration_covariance.reshape(3, 3), 0.5 * np.eye(3))
    again = TYPES.deserialize_cdr(serialise(message), IMU.type_name)
    assert (again.linear_acceleration.z, again.header.frame_id) == (6.0, "imu")


NUMBERS = (720, 480, 658.3, 545.1, 359.5, 239.5)
CAMERA = Pinhole(*NUMBERS)
CAMERAS = {
    "pinhole": CAMERA,
    "brown_conrady": BrownConrady(*NUMBERS, -0.28, 0.07, 2e-4, -3e-5, 1e-3),
    "kannala_brandt": KannalaBrandt(*NUMBERS, 3e-3, 7e-4, -2e-3, 2e-4),
    "double_sphere": DoubleSphere(*NUMBERS, -0.18, 0.59),
    "equirectangular": Equirectangular(720, 360),
}


@given(st.integers(0, (2**31 - 1) * 10**9))
def test_every_stamp_survives(t_ns):
    assert stamp_ns(stamped_message(ENCODERS, t_ns, BODY, left=0, right=0)) == t_ns


def test_every_type_survives_serialisation():
    for message in (
        camera_info_message(5, "cam_left", CAMERA),
        image_message(5, "cam_left", b"png", "png"),
        stamped_message(ENCODERS, 5, BODY, left=-(2**62), right=2**62),
        odometry_message(5, np.eye(4), np.arange(6.0)),
        tf_message(5, "map", {"base_link": np.eye(4)}),
    ):
        raw = TYPES.serialize_cdr(message, message.__msgtype__)
        again = TYPES.serialize_cdr(TYPES.deserialize_cdr(raw, message.__msgtype__), message.__msgtype__)
        assert bytes(raw) == bytes(again)


@pytest.mark.parametrize("name", CAMERAS)
def test_every_camera_model_survives_to_the_last_bit(name):
    raw = TYPES.serialize_cdr(camera_info_message(0, "cam_left", CAMERAS[name]), LEFT_INFO.type_name)
    assert parse_camera(TYPES.deserialize_cdr(raw, LEFT_INFO.type_name)) == CAMERAS[name]


def test_models_that_ros_names_have_its_names_and_its_order_of_coefficients():
    infos = {name: camera_info_message(0, "cam_left", camera) for name, camera in CAMERAS.items()}
    models = ["plumb_bob", "plumb_bob", "equidistant", "double_sphere", "equirectangular"]
    assert [infos[name].distortion_model for name in CAMERAS] == models
    np.testing.assert_array_equal(infos["pinhole"].d, np.zeros(5))
    np.testing.assert_array_equal(infos["brown_conrady"].d, [-0.28, 0.07, 2e-4, -3e-5, 1e-3])  # k1 k2 p1 p2 k3
    np.testing.assert_array_equal(infos["kannala_brandt"].d, [3e-3, 7e-4, -2e-3, 2e-4])


def test_the_projection_of_a_camera_on_its_own_is_the_pinhole_it_is_like_about_its_axis():
    for camera in CAMERAS.values():
        P = camera_info_message(0, "cam_left", camera).p.reshape(3, 4)
        near_axis = np.array([2e-4, -1e-4, 1.0])
        u, v, w = P @ [*near_axis, 1.0]
        np.testing.assert_allclose([u / w, v / w], camera.project(near_axis), atol=1e-3)


@pytest.mark.parametrize(("model", "d"), [("rational_polynomial", np.zeros(8)), ("equidistant", np.zeros(5))])
def test_a_distortion_model_that_is_not_ours_is_refused_by_name(model, d):
    strange = replace(camera_info_message(0, "cam_left", CAMERA), distortion_model=model, d=d)
    with pytest.raises(SequenceError, match=rf"^camera cam_left has the distortion model '{model}' with {len(d)} co.*"):
        parse_camera(strange)


def test_rectified_rays_of_both_cameras_meet_in_one_row_and_a_disparity():
    """What R and P promise: R turns a ray into the view, P takes it to a pixel."""
    rig = mounted_rig(*(getattr(PRESETS["euroc"], k) for k in ("left", "right", "T_left_right")), pitch_deg=10)
    point_left = np.array([0.3, -0.2, 2.0])
    point_right = se3.apply(se3.inverse(rig.T_left_right), point_left[None])[0]
    rays = (rig.left.rays(rig.left.project(point_left)), rig.right.rays(rig.right.project(point_right)))
    left, right = (_rectified(info, ray) for info, ray in zip(camera_info_messages(0, rig), rays, strict=True))
    views = rectification(rig)
    depth_m = (views.R_view_left @ point_left)[2]
    np.testing.assert_allclose(left - right, [views.K[0, 0] * rig.baseline_m / depth_m, 0], atol=1e-8)


def _rectified(info, ray):
    u, v, w = info.p.reshape(3, 4)[:, :3] @ info.r.reshape(3, 3) @ ray
    return np.array([u / w, v / w])


def test_a_pair_that_nothing_rectifies_states_each_camera_on_its_own():
    rig = stereo_rig(CAMERA, pitch_deg=0)
    above = replace(rig, T_body_right=rig.T_body_left @ se3.transform(np.eye(3), [0, -0.1, 0]))
    for info in camera_info_messages(0, above):
        np.testing.assert_array_equal(info.r.reshape(3, 3), np.eye(3))
        np.testing.assert_array_equal(info.p.reshape(3, 4)[:, 3], np.zeros(3))


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
