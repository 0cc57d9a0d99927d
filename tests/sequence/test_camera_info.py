"""Every camera model survives a CameraInfo message, whose R and P rectify a pair."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, DoubleSphere, Equirectangular, KannalaBrandt, Pinhole
from vobench.geometry.rig import PRESETS, mounted_rig, rectification, stereo_rig
from vobench.sequence.camera_info import camera_info_message, camera_info_messages, parse_camera
from vobench.sequence.message_type import TYPES
from vobench.sequence.topic import LEFT_INFO

NUMBERS = (720, 480, 658.3, 545.1, 359.5, 239.5)
CAMERA = Pinhole(*NUMBERS)
CAMERAS = {
    "pinhole": CAMERA,
    "brown_conrady": BrownConrady(*NUMBERS, -0.28, 0.07, 2e-4, -3e-5, 1e-3),
    "kannala_brandt": KannalaBrandt(*NUMBERS, 3e-3, 7e-4, -2e-3, 2e-4),
    "double_sphere": DoubleSphere(*NUMBERS, -0.18, 0.59),
    "equirectangular": Equirectangular(720, 360),
}


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
