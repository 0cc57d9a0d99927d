"""Motion from points: exact without noise, and with noise its covariance is that of its errors."""

import numpy as np
import pytest

from vobench.estimator.pose import (
    NOISE_FLOOR_PX,
    _stereo_jacobian,
    _stereo_pixels,
    adjoint,
    carried_on,
    cauchy_weights,
    normal_equations,
    pose_from_points,
    robust_noise_px,
    twist,
)
from vobench.estimator.stereo import stereo_pair
from vobench.geometry import se3
from vobench.geometry.rig import paper_lens, stereo_rig

PAIR = stereo_pair(stereo_rig(paper_lens(square_pixels=True), pitch_deg=10), "test")
STEP = twist(np.array([0.03, -0.01, 0.14, 0.004, -0.01, 0.03]))


def cloud(rng, n=400, near_m=1.0, far_m=12.0):
    """Points all over the view, evenly spread in disparity."""
    uv = rng.uniform([60, 60], [660, 420], (n, 2))
    disparity_px = PAIR.focal_baseline / rng.uniform(near_m, far_m, n)
    return uv, disparity_px, PAIR.points(uv, disparity_px)


def pixels(points):
    uv = PAIR.left.project(points)
    return uv, PAIR.focal_baseline / points[:, 2]


def test_an_exact_motion_is_found_again_with_one_eye_and_with_two():
    *_, points = cloud(np.random.default_rng(0))
    uv, disparity_px = pixels(se3.apply(STEP, points))
    for stereo in ({}, {"disparity_px": disparity_px, "baseline_m": PAIR.baseline_m}):
        fit = pose_from_points(points, uv, PAIR.K, **stereo)
        np.testing.assert_allclose(fit.T_now_last, STEP, atol=1e-9)
        assert fit.inlier.all()


def test_six_points_are_enough_for_a_motion_and_five_are_not():
    *_, points = cloud(np.random.default_rng(3), n=6)
    uv, _ = pixels(se3.apply(STEP, points))
    fit = pose_from_points(points, uv, PAIR.K)
    np.testing.assert_allclose(fit.T_now_last, STEP, atol=1e-6)
    assert pose_from_points(points[:5], uv[:5], PAIR.K) is None


def test_forty_percent_of_wrong_points_do_not_move_it():
    rng = np.random.default_rng(1)
    *_, points = cloud(rng)
    uv, disparity_px = pixels(se3.apply(STEP, points))
    wrong = rng.random(400) < 0.4
    uv = uv + wrong[:, None] * rng.uniform(-40, 40, (400, 2))
    fit = pose_from_points(points, uv, PAIR.K, disparity_px=disparity_px, baseline_m=PAIR.baseline_m)
    np.testing.assert_allclose(fit.T_now_last, STEP, atol=1e-4)
    assert fit.inlier[~wrong].all()
    assert fit.inlier[wrong].mean() < 0.05


def test_its_covariance_is_that_of_its_errors():
    """NEES of a 6-dof error has mean 6: over 60 trials within 6 ± 3 sqrt(12 / 60), and a tenth for what is robust."""
    rng, nees = np.random.default_rng(2), []
    for _ in range(60):
        *_, points = cloud(rng, 200)
        uv, disparity_px = pixels(se3.apply(STEP, points))
        left = uv + rng.normal(0, 0.2, uv.shape)
        right = uv[:, 0] - disparity_px + rng.normal(0, 0.2, 200)
        fit = pose_from_points(points, left, PAIR.K, disparity_px=left[:, 0] - right, baseline_m=PAIR.baseline_m)
        error = STEP @ se3.inverse(fit.T_now_last)
        turn = [error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]]
        small = np.r_[error[:3, 3], np.array(turn) / 2]
        nees.append(small @ np.linalg.solve(fit.covariance, small))
    assert 4.0 < np.mean(nees) < 8.5


def test_points_that_the_right_eye_lost_count_in_the_left():
    *_, points = cloud(np.random.default_rng(3))
    uv, disparity_px = pixels(se3.apply(STEP, points))
    disparity_px[::2] = np.nan
    fit = pose_from_points(points, uv, PAIR.K, disparity_px=disparity_px, baseline_m=PAIR.baseline_m)
    np.testing.assert_allclose(fit.T_now_last, STEP, atol=1e-9)


@pytest.mark.parametrize("n", [0, 3, 5])
def test_too_few_points_give_no_motion(n):
    *_, points = cloud(np.random.default_rng(4), n)
    assert pose_from_points(points, pixels(points)[0], PAIR.K) is None


def test_points_at_random_give_no_motion():
    rng = np.random.default_rng(5)
    *_, points = cloud(rng, 40)
    assert pose_from_points(points, rng.uniform(0, 700, (40, 2)), PAIR.K, ransac_px=0.2) is None


def test_the_adjoint_carries_a_small_motion_from_one_frame_to_another():
    T, small = twist(np.array([0.3, -0.2, 0.5, 0.4, 0.1, -0.3])), 1e-6 * np.array([1.0, 2, 3, -2, 1, 4])
    np.testing.assert_allclose(T @ twist(small) @ se3.inverse(T), twist(adjoint(T) @ small), atol=1e-11)


def test_who_moves_as_before_is_where_that_leads():
    before = twist(np.array([1.0, 2, 3, 0.1, 0.2, 0.3]))
    np.testing.assert_allclose(carried_on(before, before @ STEP), before @ STEP @ STEP, atol=1e-12)
    np.testing.assert_allclose(carried_on(before, before), before, atol=1e-12)
    np.testing.assert_allclose(carried_on(before, before @ STEP, share=0.0), before @ STEP, atol=1e-12)


def test_the_derivatives_of_the_pixels_are_those_of_small_motions():
    rng = np.random.default_rng(9)
    *_, points = cloud(rng, 20)
    K = PAIR.K.copy()
    K[0, 1] = 3.0  # skew
    jacobian = _stereo_jacobian(points, K, 0.2)
    size = 1e-6
    for column in range(6):
        step = np.zeros(6)
        step[column] = size
        later = _stereo_pixels(se3.apply(twist(step), points), K, 0.2)
        earlier = _stereo_pixels(se3.apply(twist(-step), points), K, 0.2)
        np.testing.assert_allclose(jacobian[:, :, column], (later - earlier) / (2 * size), rtol=1e-5, atol=1e-3)


def test_the_pixels_of_a_pair_differ_by_the_disparity_and_points_behind_are_far_outside():
    pixels_px = _stereo_pixels(np.array([[0.1, -0.2, 2.0], [0.1, -0.2, -2.0]]), PAIR.K, 0.2)
    assert pixels_px[0, 0] - pixels_px[0, 2] == pytest.approx(PAIR.K[0, 0] * 0.2 / 2.0)
    assert np.abs(pixels_px[1]).min() > 1e9


def test_weights_are_one_at_zero_and_a_half_at_their_scale():
    np.testing.assert_allclose(cauchy_weights(np.array([0.0, 0.24, -0.24]), 0.1), [1, 0.5, 0.5])


def test_the_noise_of_residuals_is_that_of_most_of_them_and_never_below_its_floor():
    residual_px = np.random.default_rng(3).normal(0, 0.4, 20_000)
    residual_px[:2000] = 50.0
    assert robust_noise_px(residual_px) == pytest.approx(0.4, rel=0.2)
    assert robust_noise_px(np.zeros(5)) == NOISE_FLOOR_PX


def test_the_normal_equations_are_those_of_weighted_least_squares():
    rng = np.random.default_rng(4)
    jacobian, weight, residual = rng.normal(size=(30, 2, 3)), rng.uniform(size=(30, 2)), rng.normal(size=(30, 2))
    information, gradient = normal_equations(jacobian, weight, residual)
    A, w, r = jacobian.reshape(-1, 3), weight.ravel(), residual.ravel()
    np.testing.assert_allclose(information, A.T @ np.diag(w) @ A, rtol=1e-8)
    np.testing.assert_allclose(gradient, A.T @ (w * r))
