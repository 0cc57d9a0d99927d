"""Errors of calibration shift matches by as much as images of a pair with these errors show."""

import numpy as np
import pytest

from vobench.analysis.pair_parameter import (
    BASELINE,
    LENS_TERMS,
    PARAMETERS,
    RIGHT_DISTORTION,
    RIGHT_TANGENTIAL_1,
    left_derivatives,
    pair_derivatives,
    parameters_of,
)
from vobench.estimator.stereo import StereoPair, stereo_pair
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import PRESETS, mounted_rig, stereo_rig

PINHOLE = stereo_pair(stereo_rig(Pinhole(320, 240, 300.0, 300.0, 159.5, 119.5), pitch_deg=0, baseline_m=0.2), "test")
X = np.array([-0.4, -0.1, 0.2, 0.45])
Y = np.array([0.3, -0.2, 0.1, 0.25])
PLACES_PX = np.stack([X, Y], -1) * 300 + [159.5, 119.5]


def preset_pair(name: str) -> StereoPair:
    preset = PRESETS[name]
    return stereo_pair(mounted_rig(preset.left, preset.right, preset.T_left_right, pitch_deg=0), "test")


@pytest.mark.parametrize(
    ("name", "columns", "rows"),
    [
        ("right_roll_deg", Y, -X),
        ("right_pitch_deg", X * Y, 1 + Y * Y),
        ("right_yaw_deg", -(1 + X * X), -X * Y),
        ("right focal_ratio", X, Y),
        ("right tangential_1", 2 * X * Y, X * X + 3 * Y * Y),
        ("right tangential_2", 3 * X * X + Y * Y, 2 * X * Y),
    ],
)
def test_errors_of_the_right_camera_shift_its_pixels_as_formulas_say(name: str, columns, rows) -> None:
    parameters = parameters_of(PINHOLE, with_lens_terms=True)
    (index,) = (index for index, parameter in enumerate(parameters) if parameter.name == name)
    found = pair_derivatives(parameters, PINHOLE, PLACES_PX + np.array([5, 0]), PLACES_PX)
    unit = np.deg2rad(parameters[index].sigma) if name.endswith("deg") else parameters[index].sigma
    np.testing.assert_allclose(found.right_px[:, 0, index], 300 * unit * columns, rtol=0.01, atol=2e-3)
    np.testing.assert_allclose(found.right_px[:, 1, index], 300 * unit * rows, rtol=0.01, atol=2e-3)
    np.testing.assert_array_equal(found.left_px[..., index], 0)
    np.testing.assert_array_equal(found.disparity_px[:, index], -found.right_px[:, 0, index])
    np.testing.assert_array_equal(found.row_px[:, index], found.right_px[:, 1, index])


def test_a_longer_focal_length_of_both_cameras_scales_disparities() -> None:
    parameters = parameters_of(PINHOLE, with_lens_terms=False)
    (index,) = (index for index, parameter in enumerate(parameters) if parameter.name == "focal_ratio")
    found = pair_derivatives(parameters, PINHOLE, PLACES_PX + np.array([12, 0]), PLACES_PX)
    np.testing.assert_allclose(found.disparity_px[:, index], 12 * parameters[index].sigma, rtol=1e-6)
    np.testing.assert_allclose(found.row_px[:, index], 0, atol=1e-9)
    alone = left_derivatives(parameters, PINHOLE, PLACES_PX + np.array([12, 0]))
    np.testing.assert_array_equal(alone, found.left_px)


def test_a_pair_has_the_errors_that_its_cameras_can_have() -> None:
    names = [parameter.name for parameter in parameters_of(PINHOLE, with_lens_terms=True)]
    assert names[0] == BASELINE
    assert RIGHT_DISTORTION not in names
    assert not set(LENS_TERMS) & {parameter.name for parameter in parameters_of(PINHOLE, with_lens_terms=False)}
    of_euroc = parameters_of(preset_pair("euroc"), with_lens_terms=True)
    assert of_euroc == PARAMETERS
    of_fisheye = [parameter.name for parameter in parameters_of(preset_pair("fisheye"), with_lens_terms=True)]
    assert RIGHT_TANGENTIAL_1 not in of_fisheye
    assert RIGHT_DISTORTION in of_fisheye


def test_derivatives_of_a_lens_with_distortion_are_near_those_of_its_pinhole() -> None:
    pair = preset_pair("euroc")
    parameters = parameters_of(pair, with_lens_terms=False)
    middle_px = pair.right.from_view(pair.K[None, :2, 2])
    found = pair_derivatives(parameters, pair, middle_px, middle_px).right_px[0]
    by_name = {parameter.name: found[:, index] for index, parameter in enumerate(parameters)}
    focal_px = pair.K[0, 0]
    np.testing.assert_allclose(by_name["right_yaw_deg"], [-focal_px * np.deg2rad(0.5), 0], atol=0.05)
    np.testing.assert_allclose(by_name["right_pitch_deg"], [0, focal_px * np.deg2rad(0.5)], atol=0.05)
