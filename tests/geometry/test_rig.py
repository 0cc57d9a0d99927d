"""The paper's lens in both readings, and a rig that looks where it says."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import LENSES, PIONEER_WHEELS, looking, paper_lens, stereo_rig

LITERAL, BLENDER = LENSES["paper_literal"], LENSES["paper_blender"]
PITCHES_DEG = (-10.0, 0.0, 15.0, 33.3, 90.0)


def test_the_papers_lens_has_the_papers_numbers() -> None:
    assert (LITERAL.width_px, LITERAL.height_px) == (720, 480)
    assert LITERAL.fx_px == pytest.approx(658.2857, abs=1e-4)
    assert LITERAL.fy_px == pytest.approx(545.0674, abs=1e-4)
    assert BLENDER.fx_px == BLENDER.fy_px == LITERAL.fx_px
    assert paper_lens(square_pixels=True) == BLENDER


@pytest.mark.parametrize("lens", LENSES.values(), ids=list(LENSES))
def test_the_optical_axis_meets_the_middle_of_the_picture(lens: Pinhole) -> None:
    # Pixel centres are integers, so the middle of 720 columns lies between 359 and 360.
    assert (lens.cx_px, lens.cy_px) == (359.5, 239.5)


@pytest.mark.parametrize("pitch_deg", PITCHES_DEG)
def test_a_camera_looks_down_by_its_pitch_and_keeps_its_horizon_level(pitch_deg: float) -> None:
    T_body_camera = looking(pitch_deg=pitch_deg, position_m=(0.1, 0.2, 0.3))
    right, down, forward = T_body_camera[:3, :3].T
    assert se3.is_rotation(T_body_camera[:3, :3])
    assert np.rad2deg(np.arctan2(-forward[2], forward[0])) == pytest.approx(pitch_deg)
    np.testing.assert_allclose(right, [0, -1, 0], atol=1e-15)
    assert down[2] < 1e-15
    np.testing.assert_array_equal(T_body_camera[:3, 3], [0.1, 0.2, 0.3])


def test_a_camera_that_looks_down_sees_the_floor_below_it_with_ahead_at_the_top() -> None:
    rig = stereo_rig(BLENDER, pitch_deg=90, baseline_m=0.2, forward_m=0.25, height_m=0.4)
    below, ahead = rig.left.project(se3.apply(se3.inverse(rig.T_body_left), [[0.25, 0.1, 0], [0.35, 0.1, 0]]))
    np.testing.assert_allclose(below, [359.5, 239.5], atol=1e-9)
    np.testing.assert_allclose(ahead - below, [0, -BLENDER.fy_px * 0.1 / 0.4], atol=1e-9)


@pytest.mark.parametrize("pitch_deg", PITCHES_DEG)
def test_the_right_camera_is_a_baseline_to_the_right_and_looks_the_same_way(pitch_deg: float) -> None:
    rig = stereo_rig(LITERAL, pitch_deg=pitch_deg, baseline_m=0.117)
    T_left_right = np.eye(4)
    T_left_right[0, 3] = 0.117
    np.testing.assert_allclose(rig.T_left_right, T_left_right, atol=1e-15)
    assert rig.baseline_m == pytest.approx(0.117)
    assert rig.T_body_left[1, 3] > rig.T_body_right[1, 3]  # y is left


def test_near_things_lie_further_left_in_the_right_picture() -> None:
    rig = stereo_rig(LITERAL, pitch_deg=0, baseline_m=0.12)
    point = np.array([[2.25, 0.3, 0.5]])  # 2 m before the cameras
    left = rig.left.project(se3.apply(se3.inverse(rig.T_body_left), point))[0]
    right = rig.right.project(se3.apply(se3.inverse(rig.T_body_right), point))[0]
    np.testing.assert_allclose(left - right, [LITERAL.fx_px * 0.12 / 2, 0], atol=1e-9)


def test_the_cameras_sit_astride_the_robots_middle() -> None:
    rig = stereo_rig(LITERAL, pitch_deg=15, baseline_m=0.12, forward_m=0.25, height_m=0.4)
    middle = (rig.T_body_left[:3, 3] + rig.T_body_right[:3, 3]) / 2
    np.testing.assert_allclose(middle, [0.25, 0, 0.4], atol=1e-15)
    assert rig.wheels == PIONEER_WHEELS


@pytest.mark.parametrize("name", ["radius_m", "track_m", "ticks_per_revolution"])
@pytest.mark.parametrize("value", [0, -1, float("nan"), float("inf")])
def test_a_wheel_without_size_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"a wheel's {name} must be finite and above 0, got {value}"):
        replace(PIONEER_WHEELS, **{name: value})
