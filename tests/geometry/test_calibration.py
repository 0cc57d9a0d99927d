"""The true rig differs from the nominal one by exactly what was declared."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.geometry.calibration import CalibrationError, true_rig
from vobench.geometry.preset import PRESETS
from vobench.geometry.rig import Rig, mounted, stereo_rig
from vobench.geometry.sphere import Equirectangular

RIGS = {name: mounted(p.left, p.right, p.T_left_right, pitch_deg=12.3) for name, p in PRESETS.items()}
EUROC = RIGS["euroc"]

every_rig = pytest.mark.parametrize("rig", RIGS.values(), ids=list(RIGS))


def turned_deg(true: Rig, nominal: Rig) -> np.ndarray:
    """Turn of the right camera (3,) about its own x, y, z."""
    R = nominal.T_body_right[:3, :3].T @ true.T_body_right[:3, :3]
    return Rotation.from_matrix(R).as_rotvec(degrees=True)


@every_rig
def test_no_error_changes_no_bit(rig: Rig) -> None:
    true = true_rig(rig, CalibrationError())
    assert (true.left, true.right, true.wheels) == (rig.left, rig.right, rig.wheels)
    assert true.T_body_left.tobytes() == rig.T_body_left.tobytes()
    assert true.T_body_right.tobytes() == rig.T_body_right.tobytes()


@every_rig
def test_a_focal_error_magnifies_the_picture_about_its_centre(rig: Rig) -> None:
    true = true_rig(rig, CalibrationError(focal_ratio=0.01))
    points = np.random.default_rng(1).uniform([-0.3, -0.3, 1], [0.3, 0.3, 3], (50, 3))
    for nominal, camera in ((rig.left, true.left), (rig.right, true.right)):
        centre = nominal.K[:2, 2]
        grown = 1.01 * (nominal.project(points) - centre)
        np.testing.assert_allclose(camera.project(points) - centre, grown, atol=1e-9)


@every_rig
def test_a_centre_error_shifts_the_whole_picture(rig: Rig) -> None:
    true = true_rig(rig, CalibrationError(center_px=(1.5, -0.5)))
    points = np.random.default_rng(2).uniform([-0.3, -0.3, 1], [0.3, 0.3, 3], (50, 3))
    for nominal, camera in ((rig.left, true.left), (rig.right, true.right)):
        shift = camera.project(points) - nominal.project(points)
        np.testing.assert_allclose(shift, np.broadcast_to([1.5, -0.5], shift.shape), atol=1e-9)


def test_a_distortion_error_is_a_share_of_every_coefficient() -> None:
    true = true_rig(EUROC, CalibrationError(distortion_ratio=-0.1))
    assert true.left.k1 == pytest.approx(0.9 * EUROC.left.k1, rel=1e-15)
    assert true.right.p2 == pytest.approx(0.9 * EUROC.right.p2, rel=1e-15)
    assert true.left.fx_px == EUROC.left.fx_px


@every_rig
def test_a_baseline_error_is_a_share_of_the_baseline_and_moves_the_right_camera_along_it(rig: Rig) -> None:
    true = true_rig(rig, CalibrationError(baseline_ratio=0.05))
    assert true.baseline_m == pytest.approx(1.05 * rig.baseline_m, rel=1e-12)
    np.testing.assert_allclose(np.cross(true.T_left_right[:3, 3], rig.T_left_right[:3, 3]), 0, atol=1e-15)
    np.testing.assert_array_equal(true.T_body_left, rig.T_body_left)
    np.testing.assert_allclose(turned_deg(true, rig), 0, atol=1e-12)


@every_rig
@pytest.mark.parametrize(("name", "axis"), [("right_pitch_deg", 0), ("right_yaw_deg", 1), ("right_roll_deg", 2)])
def test_a_turn_is_of_the_right_camera_about_one_of_its_own_axes(rig: Rig, name: str, axis: int) -> None:
    true = true_rig(rig, CalibrationError(**{name: 0.7}))
    np.testing.assert_allclose(turned_deg(true, rig), 0.7 * np.eye(3)[axis], atol=1e-9)
    np.testing.assert_array_equal(true.T_body_right[:3, 3], rig.T_body_right[:3, 3])
    np.testing.assert_array_equal(true.T_body_left, rig.T_body_left)


def test_turns_are_named_as_a_person_sees_them() -> None:
    rig = stereo_rig(EUROC.left, pitch_deg=0)
    forward = {
        name: true_rig(rig, CalibrationError(**{f"right_{name}_deg": 1.0})).T_body_right[:3, :3]
        for name in ("pitch", "yaw", "roll")
    }
    assert forward["pitch"][2, 2] > 0, "looks up"
    assert forward["yaw"][1, 2] < 0, "looks right, and y is left"
    assert forward["roll"][2, 0] < 0, "its right side sinks"


def test_all_turns_together_stay_a_rotation() -> None:
    true = true_rig(EUROC, CalibrationError(right_roll_deg=2, right_pitch_deg=-3, right_yaw_deg=4, baseline_ratio=0.1))
    assert se3.is_rotation(true.T_body_right[:3, :3], tolerance=1e-12)
    assert 4 < np.linalg.norm(turned_deg(true, EUROC)) < 9


def test_an_error_that_has_nothing_to_act_on_is_refused() -> None:
    with pytest.raises(VobenchError, match=r"^distortion_ratio 0\.1 needs a lens with distortion, got Pinhole"):
        true_rig(RIGS["d435i"], CalibrationError(distortion_ratio=0.1))
    all_around = stereo_rig(Equirectangular(640, 320), pitch_deg=0)
    with pytest.raises(VobenchError, match=r"^focal_ratio and center_px need a camera with a focal length, got Equi"):
        true_rig(all_around, CalibrationError(center_px=(1.0, 0.0)))
    assert true_rig(all_around, CalibrationError(right_yaw_deg=1.0)).left == all_around.left
