"""The right eye's turns are found in pictures of two walls, painted exactly."""

import cv2
import numpy as np
import pytest

from vobench.analysis.stereo_fit import Uncertain, fit_pair, robust_fit, row_error
from vobench.analysis.stereo_matches import PairShot
from vobench.estimator.stereo import stereo_pair
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import CalibrationError, CameraError, Rig, stereo_rig, true_rig

LENS = Pinhole(320, 240, 300.0, 300.0, 159.5, 119.5)
RIG = stereo_rig(LENS, pitch_deg=0, baseline_m=0.2)
# Walls to the left and right of straight ahead, slanted, so that points are near and far.
WALLS = tuple((np.array([side, 0.0, 0.8]) / np.hypot(side, 0.8), 2.0) for side in (0.6, -0.6))
SHOTS, STEP_M = 5, 0.12
MOVING_SHOTS = 9  # enough for motions over five images


def painted(rig: Rig, side: str, T_left_world: np.ndarray) -> np.ndarray:
    """What an eye sees of both walls, each with a texture of its own; T_left_world is where the first left eye was."""
    picture, depth = np.zeros((LENS.height_px, LENS.width_px), np.float32), np.full((240, 320), np.inf)
    T_eye_left = se3.inverse(rig.T_body_camera(side)) @ rig.T_body_left
    T = T_eye_left @ T_left_world
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), -1).reshape(-1, 2)
    rays = rig.camera(side).rays(grid)
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


def shots(error: CalibrationError, count: int = SHOTS) -> list[PairShot]:
    rig = true_rig(RIG, error)
    found = []
    for step in range(count):
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
    return {e: fit_pair([shots(turned(*e), MOVING_SHOTS)], pair) for e in errors}


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
    assert fit.yaw_from == "rows and motion"
    assert not fit.has_lens_error
    for angle, truth_deg in ((fit.roll_deg, 0.15), (fit.pitch_deg, -0.1), (fit.yaw_deg, 0.12)):
        assert abs(angle.value - truth_deg) < 2 * angle.sigma < 0.05
    assert fit.row_noise_px < fit.row_mad_px / 3


def test_pictures_without_texture_have_no_fit():
    plain = np.full((240, 320), 90, np.uint8)
    assert fit_pair([[PairShot(plain, plain)] * 4], stereo_pair(RIG, "test")) is None


def test_the_spread_of_rows_is_that_of_the_roll_and_doubles_with_it(fits):
    fit = fits[0.15, -0.1, 0.12]
    x, y = fit.matches.place.T
    roll, pitch, yaw = np.deg2rad([0.15, -0.1, 0.12])
    expected_px = 300 * (pitch * (1 + y * y) - roll * x - yaw * x * y)
    np.testing.assert_allclose(np.median(fit.matches.row_px - expected_px), 0, atol=0.02)
    # The spread is measured on other matches of the same view.
    deviation_px = np.abs(expected_px - np.median(expected_px))
    assert fit.row_mad_px == pytest.approx(1.4826 * np.median(deviation_px), rel=0.25)
    assert np.median(np.abs(row_error(fit.coefficients, fit.matches.place) - expected_px)) < 0.03


def test_figures_of_the_pair_are_those_of_its_lens_and_matches(fits):
    fit = fits[0.0, 0.0, 0.0]
    assert (fit.focal_px, fit.baseline_m) == (300, pytest.approx(0.2))
    assert fit.disparity_px == pytest.approx(tuple(np.quantile(fit.matches.disparity_px, (0.1, 0.5, 0.9))))
    assert set(fit.matches.window.tolist()) == {0}
    assert fit.roll_deg.sigma < 0.01


# --- What the motion tells ---


@pytest.fixture(scope="module")
def lens_fit():
    """The fit of a right lens with a tangential term and a shifted centre."""
    error = CalibrationError(right=CameraError(tangential=(0.0, 0.01), center_px=(1.5, 0.0)))
    return fit_pair([shots(error, MOVING_SHOTS)], stereo_pair(RIG, "test"))


def test_an_offset_that_grows_to_the_sides_is_attributed_to_the_lens(lens_fit):
    assert lens_fit.has_lens_error
    assert lens_fit.yaw_from == "motion"
    x = 0.25 * 320 / 300  # of a column at a quarter or three quarters of the width
    expected_px = [-1.5 - 300 * 0.01 * 3 * x * x, -1.5, -1.5 - 300 * 0.01 * 3 * x * x]
    for offset_px, truth_px in zip(lens_fit.offsets_px((0.25, 0.5, 0.75)), expected_px, strict=True):
        assert abs(offset_px.value - truth_px) < 2.5 * offset_px.sigma < 0.75
    assert lens_fit.xy_px.value == pytest.approx(300 * 2 * 0.01, rel=0.1)
    assert lens_fit.offset_px.value == pytest.approx(lens_fit.offsets_px((0.5,))[0].value, abs=0.05)


def test_of_a_pair_at_rest_no_offset_is_stated():
    (shot, *_) = shots(turned(0.1, 0.0, 0.12))
    fit = fit_pair([[shot] * SHOTS], stereo_pair(RIG, "test"))
    assert fit.offset_px is None
    assert fit.yaw_from in ("", "rows")
    assert not fit.has_lens_error
    assert fit.roll_deg.value == pytest.approx(0.1, rel=0.1)


def test_in_a_dim_place_rotations_are_not_taken_for_an_error_of_the_lens():
    error = turned(0.15, -0.1, 0.12)
    rng = np.random.default_rng(0)

    def dim(image):
        noisy = image / 16 + rng.normal(0, 0.5, image.shape)
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)

    dimmed = [PairShot(dim(shot.left), dim(shot.right), shot.T_world_left) for shot in shots(error, MOVING_SHOTS)]
    fit = fit_pair([dimmed], stereo_pair(RIG, "test"))
    assert not fit.has_lens_error
    assert fit.roll_deg.sigma > 0.001
    assert fit.roll_deg.value == pytest.approx(0.15, abs=0.05)


@pytest.mark.parametrize(("value", "is_plain"), [(3.1, True), (-3.1, True), (2.9, False)])
def test_a_value_is_significant_beyond_three_standard_deviations(value, is_plain):
    assert Uncertain(value, 1.0).is_plain == is_plain


# --- The robust fit ---


def terms_and_values(count: int, *, sigma: float, outliers: float = 0.0, seed: int = 0):
    rng = np.random.default_rng(seed)
    terms = np.c_[np.ones(count), rng.uniform(-1, 1, (count, 2))]
    values = terms @ [0.5, -2.0, 1.0] + rng.normal(0, sigma, count)
    values[: int(outliers * count)] += 10
    return terms, values


def test_a_robust_fit_is_exact_without_noise_and_hardly_moved_by_outliers():
    coefficients, noise = robust_fit(*terms_and_values(200, sigma=0))
    np.testing.assert_allclose(coefficients, [0.5, -2.0, 1.0], atol=1e-7)
    assert noise == 1e-3  # the least that is believed
    coefficients, noise = robust_fit(*terms_and_values(2000, sigma=0.1, outliers=0.2))
    np.testing.assert_allclose(coefficients, [0.5, -2.0, 1.0], atol=0.03)
    assert noise == pytest.approx(0.14, abs=0.03)


def test_the_noise_of_a_robust_fit_is_that_of_its_values():
    fits = [robust_fit(*terms_and_values(400, sigma=0.1, seed=seed)) for seed in range(60)]
    assert np.mean([noise for _, noise in fits]) == pytest.approx(0.1, rel=0.05)


def test_a_robust_fit_scales_with_its_values():
    terms, values = terms_and_values(300, sigma=0.1)
    once, noise = robust_fit(terms, values)
    twice, noise_of_twice = robust_fit(terms, 2 * values)
    np.testing.assert_allclose(twice, 2 * once, rtol=1e-5)
    assert noise_of_twice == pytest.approx(2 * noise, rel=1e-4)


def test_the_rows_of_the_plot_are_a_fit_of_their_own(fits):
    fit = fits[0.15, -0.1, 0.12]
    x, y = fit.matches.place.T
    terms = np.c_[np.ones(len(x)), x, y, x * y, y * y]
    coefficients, noise = robust_fit(terms, fit.matches.row_px)
    np.testing.assert_allclose(fit.coefficients, coefficients)
    assert fit.row_noise_px == pytest.approx(noise)
    np.testing.assert_allclose(row_error(coefficients, fit.matches.place), terms @ coefficients)
    rows_px, _ = fit.calibrated.calibration.row_error(fit.matches.place * 300 + [159.5, 119.5])
    assert np.median(np.abs(rows_px - terms @ coefficients)) < 0.03
