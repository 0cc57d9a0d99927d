"""The laws behind the reference estimator, on points without pictures: each trap has its test."""

import sys

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.geometry import se3
from vobench.geometry.rig import paper_lens, stereo_rig

LENS = paper_lens(square_pixels=False)


@pytest.fixture(scope="module")
def motion(bed):
    """The module `motion` of the loaded estimator."""
    bed.started("lk_epipolar", stereo_rig(LENS, pitch_deg=90))
    return sys.modules["vobench_estimators.lk_epipolar.motion"]


def seen(motion, points, T_now_last, *, noise_px=0.0):
    """Matches of points (N, 3) of the last view after a known motion, with exact depth."""
    rng = np.random.default_rng(3)
    uv0 = LENS.project(points) + rng.normal(0, noise_px, (len(points), 2))
    uv1 = LENS.project(se3.apply(T_now_last, points)) + rng.normal(0, noise_px, (len(points), 2))
    return motion.Matches(flat(uv0), flat(uv1), uv0, uv1, 1 / points[:, 2], LENS.K)


def flat(uv):
    rays = LENS.rays(uv)
    return rays / rays[:, 2:]


def floor(n=400):
    uv = np.random.default_rng(4).uniform([20, 20], [700, 460], (n, 2))
    return flat(uv) * 0.4


def cloud(n=400):
    rng = np.random.default_rng(5)
    return flat(rng.uniform([60, 60], [660, 420], (n, 2))) * rng.uniform(0.8, 5.0, (n, 1))


def moved(rotvec, t):
    return se3.transform(Rotation.from_rotvec(rotvec).as_matrix(), t)


STEP = moved([0.004, -0.01, 0.03], [0.012, -0.009, 0.003])


@pytest.mark.parametrize("points", [floor(), cloud()], ids=["floor", "cloud"])
def test_an_exact_motion_is_found_again(motion, points):
    matches = seen(motion, points, STEP)
    found = motion.best_motion(motion.two_views(matches, 0.5).shapes, matches)
    np.testing.assert_allclose(found.T_now_last, STEP, atol=3e-5)  # cv2 fits in float32


def test_the_length_of_the_step_scales_with_the_scene(motion):
    big = moved([0.004, -0.01, 0.03], 3 * STEP[:3, 3])
    shape = motion.Shape(STEP[:3, :3], -STEP[:3, 3] / np.linalg.norm(STEP[:3, 3]))  # wrong sign on purpose
    found = motion.scaled(shape, seen(motion, 3 * cloud(), big))
    np.testing.assert_allclose(found.T_now_last, big, atol=1e-9)


def test_points_hundreds_of_baselines_away_still_give_a_motion(motion):
    """Trap 1: cv2.recoverPose gives no vote to points farther than 50 baselines."""
    points, T = cloud() * 2, moved([0, 0.002, 0], [0.004, 0, 0.012])
    matches = seen(motion, points, T)
    E, _ = motion.essential(matches, 0.5)
    votes, *_ = cv2.recoverPose(E, matches.uv0_px, matches.uv1_px, LENS.K)
    assert votes < len(points) / 2, "the trap is gone from OpenCV"
    found = motion.best_motion(motion.two_views(matches, 0.5).shapes, matches)
    np.testing.assert_allclose(found.T_now_last, T, atol=1e-5)


def test_both_explanations_of_a_plane_are_among_the_candidates_and_stereo_picks_the_true_one(motion):
    """Trap 2: two different motions send a plane's points to the very same pixels."""
    T = moved([0, 0, 0.02], [0.012, 0, 0.008])
    matches = seen(motion, floor(), T)
    H, _ = motion.homography(matches, 0.5)
    motions = [m for shape in motion.from_homography(H, LENS.K) if (m := motion.scaled(shape, matches))]
    true, *others = sorted(motions, key=lambda m: m.transfer_px)
    others = [m for m in others if not np.allclose(m.T_now_last, true.T_now_last, atol=1e-5)]
    np.testing.assert_allclose(true.T_now_last, T, atol=1e-6)
    assert others, "the homography has two solutions"
    assert min(m.transfer_px for m in others) > 0.1 > 10 * true.transfer_px


def test_a_homography_of_almost_no_translation_still_gives_rotations(motion):
    """Trap 3: OpenCV hands back a matrix that is no rotation."""
    matches = seen(motion, cloud(), moved([0, 0.05, 0], [1e-4, 0, 0]))
    H, _ = motion.homography(matches, 0.5)
    shapes = list(motion.from_homography(H * 1.01, LENS.K))
    assert shapes
    assert all(se3.is_rotation(shape.R, tolerance=1e-12) for shape in shapes)


def test_refining_brings_a_motion_that_is_off_back_to_the_truth(motion):
    """Trap 4: rotation, direction and length come back together, from epipolar lines and depths."""
    matches = seen(motion, cloud(), STEP)
    off = moved([1e-3, 0, 0], [0.001, 0.0, -0.001]) @ STEP
    off[:3, 3] *= 1.05
    begun = motion.Motion(motion.shape_of(off), off, np.inf)
    found = motion.refined(begun, matches, np.ones(400, bool))
    np.testing.assert_allclose(found.T_now_last, STEP, atol=1e-7)
    assert found.transfer_px < 1e-4


def test_refining_on_a_plane_does_not_slide_along_its_ambiguity(motion):
    matches = seen(motion, floor(), STEP, noise_px=0.05)
    begun = motion.Motion(motion.shape_of(STEP), STEP, np.inf)
    found = motion.refined(begun, matches, np.ones(400, bool))
    assert np.linalg.norm(found.T_now_last[:3, 3] - STEP[:3, 3]) < 0.02 * np.linalg.norm(STEP[:3, 3])


def test_tracks_without_depth_still_count_by_their_epipolar_lines(motion):
    matches = seen(motion, cloud(), STEP)
    rho = np.where(np.arange(400) < 12, matches.rho, np.nan)
    few = motion.Matches(matches.x0, matches.x1, matches.uv0_px, matches.uv1_px, rho, matches.K)
    off = moved([2e-4, 0, 0], [0.0003, 0.0, -0.0003]) @ STEP
    found = motion.refined(motion.Motion(motion.shape_of(off), off, np.inf), few, np.ones(400, bool))
    np.testing.assert_allclose(found.T_now_last, STEP, atol=1e-6)


def test_the_sampson_distance_of_a_true_match_is_zero_and_has_the_size_of_the_error(motion):
    matches = seen(motion, cloud(), STEP)
    shape = motion.Shape(STEP[:3, :3], STEP[:3, 3] / np.linalg.norm(STEP[:3, 3]))
    exact = motion.sampson(shape, matches.x0, matches.x1)
    off = motion.sampson(shape, matches.x0, matches.x1 + np.array([0, 1e-3, 0]))
    assert np.abs(exact).max() < 1e-12
    assert 1e-5 < np.median(np.abs(off)) <= 1e-3


def test_a_third_of_wrong_depths_does_not_move_the_length(motion):
    matches = seen(motion, cloud(), STEP, noise_px=0.02)
    rho = matches.rho.copy()
    rho[::3] *= 3
    spoiled = motion.Matches(matches.x0, matches.x1, matches.uv0_px, matches.uv1_px, rho, matches.K)
    shape = motion.Shape(STEP[:3, :3], STEP[:3, 3] / np.linalg.norm(STEP[:3, 3]))
    found = motion.scaled(shape, spoiled)
    assert np.linalg.norm(found.T_now_last[:3, 3]) == pytest.approx(np.linalg.norm(STEP[:3, 3]), rel=0.01)


def test_without_depth_there_is_no_motion(motion):
    matches = seen(motion, cloud(), STEP)
    blind = motion.Matches(
        matches.x0, matches.x1, matches.uv0_px, matches.uv1_px, np.full(len(matches.rho), np.nan), matches.K
    )
    assert motion.best_motion(motion.two_views(blind, 0.5).shapes, blind) is None
