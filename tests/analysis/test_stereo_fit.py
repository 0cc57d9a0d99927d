"""The right eye's turns are found in pictures of two walls, painted exactly."""

import cv2
import numpy as np
import pytest

from vobench.analysis.stereo_fit import Uncertain, combined_yaw, fit_pair, robust_fit, row_error
from vobench.analysis.stereo_matches import PairShot
from vobench.estimator.stereo import stereo_pair
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


# --- The yaw ---


def test_yaws_that_agree_are_weighted_by_their_inverse_variances():
    yaw, source = combined_yaw(Uncertain(0.10, 0.01), Uncertain(0.13, 0.02))
    assert source == "rows and motion"
    assert yaw.value == pytest.approx((0.10 * 4 + 0.13) / 5)
    assert yaw.sigma == pytest.approx(0.01 * 0.02 / np.hypot(0.01, 0.02))
    other, _ = combined_yaw(Uncertain(0.13, 0.02), Uncertain(0.10, 0.01))
    assert (other.value, other.sigma) == pytest.approx((yaw.value, yaw.sigma))


def test_rows_that_contradict_the_motion_are_left_to_the_lens():
    motion = Uncertain(0.0, 0.004)
    assert combined_yaw(Uncertain(0.016, 0.003), motion) == (motion, "motion")  # 3.2 standard deviations apart
    assert combined_yaw(Uncertain(0.014, 0.003), motion)[1] == "rows and motion"  # 2.8
    assert combined_yaw(Uncertain(-0.016, 0.003), motion) == (motion, "motion")
    assert combined_yaw(Uncertain(15.0, 3.0), Uncertain(0.0, 4.0))[1] == "rows and motion"  # exactly 3


def test_without_motion_small_yaws_are_believed_of_rows():
    small = Uncertain(-0.29, 0.01)
    assert combined_yaw(small, None) == (small, "rows")
    assert combined_yaw(Uncertain(-0.31, 0.01), None) == (None, "")


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
    coefficients, _, noise = robust_fit(*terms_and_values(200, sigma=0))
    np.testing.assert_allclose(coefficients, [0.5, -2.0, 1.0], atol=1e-7)
    assert noise == 1e-3  # the least that is believed
    coefficients, _, noise = robust_fit(*terms_and_values(2000, sigma=0.1, outliers=0.2))
    np.testing.assert_allclose(coefficients, [0.5, -2.0, 1.0], atol=0.03)
    assert noise == pytest.approx(0.14, abs=0.03)


def test_the_noise_and_the_deviations_of_a_robust_fit_are_those_of_repeated_fits():
    fits = [robust_fit(*terms_and_values(400, sigma=0.1, seed=seed)) for seed in range(60)]
    spread = np.std([coefficients for coefficients, _, _ in fits], axis=0)
    stated = np.mean([sigmas for _, sigmas, _ in fits], axis=0)
    assert np.mean([noise for _, _, noise in fits]) == pytest.approx(0.1, rel=0.05)
    # Eight correlated matches count as one, and Cauchy's weights cost some information.
    np.testing.assert_allclose(stated / spread, np.sqrt(8), rtol=0.3)


def test_a_robust_fit_scales_with_its_values():
    terms, values = terms_and_values(300, sigma=0.1)
    once, sigmas, noise = robust_fit(terms, values)
    twice, sigmas_of_twice, noise_of_twice = robust_fit(terms, 2 * values)
    np.testing.assert_allclose(twice, 2 * once, rtol=1e-5)
    np.testing.assert_allclose(sigmas_of_twice, 2 * sigmas, rtol=1e-4)
    assert noise_of_twice == pytest.approx(2 * noise, rel=1e-4)


def test_angles_have_the_values_and_deviations_of_their_own_coefficients(fits):
    fit = fits[0.15, -0.1, 0.12]
    x, y = fit.matches.place.T
    terms = np.c_[np.ones(len(x)), x, y, x * y, y * y]
    coefficients, sigmas, noise = robust_fit(terms, fit.matches.row_px)
    np.testing.assert_allclose(fit.coefficients, coefficients)
    assert fit.row_noise_px == pytest.approx(noise)
    for angle_deg, value_px, sigma_px in (
        (fit.roll_deg, -coefficients[1], sigmas[1]),
        (fit.pitch_deg, coefficients[0], sigmas[0]),
    ):
        assert np.deg2rad([angle_deg.value, angle_deg.sigma]) * 300 == pytest.approx([value_px, sigma_px])
    assert (fit.xy_px.value, fit.xy_px.sigma) == pytest.approx((coefficients[3], sigmas[3]))
    np.testing.assert_allclose(row_error(coefficients, fit.matches.place), terms @ coefficients)
