"""The common error of a pair's disparities: learnt from views of unlike depths, and from nothing else."""

import numpy as np
import pytest

from vobench.estimator.disparity_offset import DisparityOffset
from vobench.estimator.pose import twist
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


def learnt(true_px, frames, *, flat=False, noise_px=0.1, start_scale=1.0):
    """What is known of an offset after so many steps; the motion that is handed in is off by start_scale."""
    rng, offset = np.random.default_rng(6), DisparityOffset()
    for _ in range(frames):
        uv, disparity_px, points = cloud(rng, 300, 4.0, 30.0)
        if flat:
            disparity_px = np.full(300, 200.0)
            points = PAIR.points(uv, disparity_px)
        now = PAIR.left.project(se3.apply(STEP, points)) + rng.normal(0, noise_px, uv.shape)
        measured_px = disparity_px + true_px + rng.normal(0, noise_px, 300)
        told = se3.transform(STEP[:3, :3], start_scale * STEP[:3, 3])
        offset = offset.after(PAIR.left.rays(uv), PAIR.left.rays(now), measured_px, told, PAIR)
    return offset


@pytest.mark.parametrize("true_px", [0.5, -0.5, 0.3])
def test_an_offset_is_learnt_though_it_spoils_the_motion_handed_in(true_px):
    offset = learnt(true_px, 30, start_scale=1.05)
    assert offset.px == pytest.approx(true_px, abs=max(3 * offset.information**-0.5, 0.05))
    assert offset.px != 0


def test_a_perfect_pair_is_left_as_it_is():
    offset = learnt(0.0, 60)
    assert offset.px == 0.0
    assert abs(offset.estimate_px) < 0.1


@pytest.mark.parametrize(
    ("guess_px", "sigma_px", "is_taken"), [(0.4, 0.1, True), (0.4, 0.2, False), (0.14, 0.01, False), (-0.2, 0.05, True)]
)
def test_a_guess_is_taken_off_once_it_is_large_and_certain(guess_px, sigma_px, is_taken):
    offset = DisparityOffset(sigma_px**-2, guess_px * sigma_px**-2)
    assert offset.px == pytest.approx(guess_px if is_taken else 0.0)


def learnt_with_a_wrong_object(true_px, error_px, frames):
    """The estimate after views in which the disparities in a sixteenth of the view have the same error throughout."""
    rng, offset = np.random.default_rng(3), DisparityOffset()
    for _ in range(frames):
        uv, disparity_px, points = cloud(rng, 400, 4.0, 30.0)
        on_object = (uv[:, 0] < 180) & (uv[:, 1] < 240)
        near_px = PAIR.focal_baseline / rng.uniform(1.0, 1.5, 400)
        disparity_px = np.where(on_object, near_px, disparity_px)
        points = PAIR.points(uv, disparity_px)
        now = PAIR.left.project(se3.apply(STEP, points)) + rng.normal(0, 0.1, uv.shape)
        measured_px = disparity_px + true_px + error_px * on_object + rng.normal(0, 0.1, 400)
        offset = offset.after(PAIR.left.rays(uv), PAIR.left.rays(now), measured_px, STEP, PAIR)
    return offset


def test_the_error_of_one_object_that_stays_in_view_is_no_offset():
    """It is in every view, so that it would seem certain if successive views counted as independent."""
    offset = learnt_with_a_wrong_object(0.0, 2.5, 60)
    sigma_if_independent_px = offset.information**-0.5
    assert abs(offset.estimate_px) > max(3 * sigma_if_independent_px, 0.15)
    assert offset.sigma_px > 2 * sigma_if_independent_px
    assert offset.px == 0.0


def test_an_offset_of_the_whole_view_is_applied_though_near_objects_stay_in_view():
    offset = learnt_with_a_wrong_object(0.5, 0.0, 60)
    assert offset.px == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("frames", [5, 40])
def test_the_sum_without_a_cell_has_less_information_than_with_it(frames):
    offset = learnt(0.0, frames)
    prior = DisparityOffset().information
    without = np.array(offset.information_without)
    assert (without < offset.information).all()
    assert (without > prior).all()


def test_points_in_one_corner_of_the_view_apply_no_offset():
    rng = np.random.default_rng(2)
    offset = DisparityOffset()
    for _ in range(30):
        uv = rng.uniform([60, 60], [150, 150], (200, 2))
        disparity_px = PAIR.focal_baseline / rng.uniform(4.0, 30.0, 200)
        now = PAIR.left.project(se3.apply(STEP, PAIR.points(uv, disparity_px)))
        offset = offset.after(PAIR.left.rays(uv), PAIR.left.rays(now), disparity_px + 0.5, STEP, PAIR)
    assert offset.information > 1 / 0.3**2
    assert offset.px == 0.0


def test_points_at_one_distance_tell_nothing():
    """Their disparities differ by noise alone, which must not be taken for depth."""
    offset = learnt(0.5, 30, flat=True)
    assert offset.information == DisparityOffset().information
    assert offset.px == 0.0


def test_without_depths_nothing_is_learnt():
    rays = PAIR.left.rays(np.random.default_rng(7).uniform(100, 400, (50, 2)))
    assert DisparityOffset().after(rays, rays, np.full(50, np.nan), STEP, PAIR) == DisparityOffset()


def fitted(noise_px, seed, *, n=4000):
    """The offset of one fit from many points, whose disparities have noise and no offset."""
    rng = np.random.default_rng(seed)
    uv, disparity_px, points = cloud(rng, n, 4.0, 30.0)
    now = PAIR.left.project(se3.apply(STEP, points)) + rng.normal(0, 0.1, uv.shape)
    measured_px = disparity_px + rng.normal(0, noise_px, n)
    after = DisparityOffset().after(PAIR.left.rays(uv), PAIR.left.rays(now), measured_px, STEP, PAIR)
    prior = DisparityOffset()
    return after.weighted / (after.information - prior.information)


def test_noise_of_disparities_alone_is_no_offset():
    """Errors in variables: noise of twice that of the tracks biases a fit by -0.016 px unless that is corrected.

    With the wrong sign of the correction the bias would be -0.038 px; the mean of these fits is known to 0.004 px.
    """
    offsets_px = [fitted(0.2, seed) for seed in range(12)]
    assert abs(np.mean(offsets_px)) < 0.011


@pytest.mark.parametrize("noise_px", [0.05, 0.1])
def test_the_information_of_a_fit_is_an_eighth_of_that_of_its_scatter(noise_px):
    """Errors of near tracks are correlated, so that eight count as one; here they are independent."""
    prior = DisparityOffset()
    offsets_px = []
    information = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        uv, disparity_px, points = cloud(rng, 1000, 4.0, 30.0)
        now = PAIR.left.project(se3.apply(STEP, points)) + rng.normal(0, noise_px, uv.shape)
        after = prior.after(PAIR.left.rays(uv), PAIR.left.rays(now), disparity_px, STEP, PAIR)
        information.append(after.information - prior.information)
        offsets_px.append(after.weighted / information[-1])
    assert 5 < 1 / np.var(offsets_px) / np.mean(information) < 10
