"""The right eye's turns are found in pictures of two walls, painted exactly."""

import cv2
import numpy as np
import pytest

from vobench.analysis.patch_refinement import SLANT, refined
from vobench.analysis.stereo_fit import fit_pair
from vobench.analysis.stereo_matches import PairShot
from vobench.estimator.tools import stereo_pair
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import CalibrationError, Rig, stereo_rig, true_rig

LENS = Pinhole(320, 240, 300.0, 300.0, 159.5, 119.5)
RIG = stereo_rig(LENS, pitch_deg=0, baseline_m=0.2)
# Walls to the left and right of straight ahead, slanted, so that points are near and far.
WALLS = tuple((np.array([side, 0.0, 0.8]) / np.hypot(side, 0.8), 2.0) for side in (0.6, -0.6))
SHOTS, STEP_M = 5, 0.12


def painted(rig: Rig, side: str, T_left_world: np.ndarray) -> np.ndarray:
    """What an eye sees of both walls, each with a texture of its own; T_left_world is where the first left eye was."""
    picture, depth = np.zeros((LENS.height_px, LENS.width_px), np.float32), np.full((240, 320), np.inf)
    T_eye_left = se3.inverse(rig.T_body_camera(side)) @ rig.T_body_left
    T = T_eye_left @ T_left_world
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), -1).reshape(-1, 2)
    rays = LENS.rays(grid)
    for number, (normal, distance_m) in enumerate(WALLS):
        n = T[:3, :3] @ normal
        far = (distance_m + n @ T[:3, 3]) / (rays @ n)
        points = se3.apply(se3.inverse(T), rays * far[:, None])
        along = np.cross(normal, [0, 1, 0])
        places = np.stack([points @ along, points[:, 1]], -1) * 90 + 400
        texture = np.random.default_rng(number).uniform(0, 255, (800, 800)).astype(np.float32)
        texture = cv2.normalize(cv2.GaussianBlur(texture, (0, 0), 1.2), None, 20, 230, cv2.NORM_MINMAX)
        seen = cv2.remap(texture, *places.astype(np.float32).T.reshape(2, 240, 320), cv2.INTER_CUBIC)
        z = np.where(far > 0, far, np.inf).reshape(240, 320)
        picture, depth = np.where(z < depth, seen, picture), np.minimum(z, depth)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def shots(error: CalibrationError) -> list[PairShot]:
    rig = true_rig(RIG, error)
    found = []
    for step in range(SHOTS):
        T_world_left = se3.transform(np.eye(3), [0.02 * step, 0, STEP_M * step])
        left, right = (painted(rig, side, se3.inverse(T_world_left)) for side in ("left", "right"))
        found.append(PairShot(left, right, T_world_left))
    return found


def turned(roll_deg: float, pitch_deg: float, yaw_deg: float) -> CalibrationError:
    return CalibrationError(right_roll_deg=roll_deg, right_pitch_deg=pitch_deg, right_yaw_deg=yaw_deg)


@pytest.fixture(scope="module")
def fits():
    pair = stereo_pair(RIG, "test")
    errors = [(0.0, 0.0, 0.0), (0.15, -0.1, 0.12)]
    return {e: fit_pair([shots(turned(*e))], pair) for e in errors}


def test_a_perfect_pair_has_rows_that_agree_and_no_offset(fits):
    fit = fits[0.0, 0.0, 0.0]
    assert fit.row_mad_px < 0.1
    assert not fit.roll_deg.is_plain or abs(fit.roll_deg.value) < 0.005
    assert abs(fit.offset_px.value) < 0.1
    assert fit.gain == pytest.approx(1, abs=0.01)


def test_the_right_eyes_turns_are_found(fits):
    fit = fits[0.15, -0.1, 0.12]
    assert fit.roll_deg.value == pytest.approx(0.15, rel=0.03)
    assert fit.pitch_deg.value == pytest.approx(-0.1, rel=0.03)
    assert fit.yaw_deg.value == pytest.approx(0.12, rel=0.1)
    assert fit.offset_px.value == pytest.approx(300 * np.deg2rad(0.12), rel=0.1)
    assert fit.row_noise_px < fit.row_mad_px / 3


def test_places_on_slanted_walls_are_found_between_pixels():
    shot = shots(CalibrationError())[0]
    points = np.float32([[x, y] for x in range(80, 290, 15) for y in range(40, 210, 15)]) + 0.3
    rays = LENS.rays(points)
    z_m = np.min([np.where(rays @ n > 0, m / (rays @ n), np.inf) for n, m in WALLS], axis=0) * rays[:, 2]
    there = points - np.c_[300 * 0.2 / z_m, np.zeros(len(z_m))]
    found, settled = refined(shot.left, shot.right, points, np.float32(there + 0.5), shape=SLANT)
    assert settled.mean() > 0.8
    assert np.median(np.abs(found - there)[settled], axis=0) == pytest.approx([0, 0], abs=0.04)
    assert not refined(shot.left, shot.right, points, np.float32(there + 9), shape=SLANT)[1].all()


def test_pictures_without_texture_have_no_fit():
    plain = np.full((240, 320), 90, np.uint8)
    assert fit_pair([[PairShot(plain, plain)] * 4], stereo_pair(RIG, "test")) is None
