"""The tracker of a stereo view: known motions of a textured wall are found again, from the first view on."""

import cv2
import numpy as np
import pytest

from vobench.estimator.stereo import stereo_pair
from vobench.estimator.stereo_tracker import StereoTracker, StereoTracks, TrackerSettings
from vobench.geometry import se3
from vobench.geometry.rig import paper_lens, stereo_rig

PAIR = stereo_pair(stereo_rig(paper_lens(square_pixels=True), pitch_deg=10), "test")
SETTINGS = TrackerSettings(
    corners_per_cell=10, corner_distance_px=8.0, margin_px=12, window_px=15, min_points=20, ransac_px=0.5
)
SIZE = (480, 720)
FOCAL_PX = PAIR.K[0, 0]


def texture(seed=0, size=(900, 1200)):
    rng = np.random.default_rng(seed)
    grains = [rng.uniform(-1, 1, (size[0] // k, size[1] // k)).astype(np.float32) for k in (4, 8, 16, 32)]
    summed = sum(cv2.resize(grain, size[::-1], interpolation=cv2.INTER_CUBIC) for grain in grains)
    return np.clip(128 + 45 * summed, 0, 255).astype(np.uint8)


WALL = texture()
PX_PER_M = 300.0  # of the wall's picture


def seen(T_wall_view, wall_m=2.0):
    """The picture of a wall `wall_m` ahead of the first view, from a pose (4, 4) in that view's axes."""
    u, v = np.meshgrid(np.arange(SIZE[1]), np.arange(SIZE[0]))
    pixels = np.stack([u, v, np.ones_like(u)], -1).reshape(-1, 3)
    rays = pixels @ np.linalg.inv(PAIR.K).T @ T_wall_view[:3, :3].T
    origin = T_wall_view[:3, 3]
    points = origin + rays * ((wall_m - origin[2]) / rays[:, 2])[:, None]
    x = (points[:, 0] * PX_PER_M + WALL.shape[1] / 2).astype(np.float32).reshape(SIZE)
    y = (points[:, 1] * PX_PER_M + WALL.shape[0] / 2).astype(np.float32).reshape(SIZE)
    return cv2.remap(WALL, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def pair_at(T):
    right = T @ se3.transform(np.eye(3), [PAIR.baseline_m, 0.0, 0.0])
    return seen(T), seen(right)


STEP = se3.transform(se3.rotation_z(0.01), [0.02, -0.015, 0.06])


@pytest.fixture(scope="module")
def tracker():
    tracker = StereoTracker(PAIR, SETTINGS)
    assert not tracker.has_keyframe
    assert tracker.set_keyframe(*pair_at(np.eye(4)))
    return tracker


def test_the_disparities_of_a_view_are_those_of_its_wall(tracker):
    tracks = tracker.follow(*pair_at(np.eye(4)), np.eye(4))
    np.testing.assert_allclose(tracks.keyframe_disparity_px, PAIR.focal_baseline / 2.0, atol=0.3)
    np.testing.assert_allclose(tracks.disparity_px, tracks.keyframe_disparity_px, atol=0.1)
    assert tracks.flow_px < 0.05


@pytest.mark.parametrize("guess", [np.eye(4), STEP], ids=["none", "the motion itself"])
def test_a_known_motion_is_found_again_whatever_the_guess(tracker, guess):
    tracks = tracker.follow(*pair_at(STEP), se3.inverse(guess))
    fit = tracker.fit(tracks)
    np.testing.assert_allclose(fit.T_now_last, se3.inverse(STEP), atol=2e-3)
    assert fit.inlier.mean() > 0.9
    expected_px = PAIR.focal_baseline / (2.0 - 0.06)
    assert np.nanmedian(tracks.disparity_px) == pytest.approx(expected_px, abs=0.2)


def test_a_picture_without_texture_is_no_view_and_leaves_the_old_one(tracker):
    blank = np.full(SIZE, 90, np.uint8)
    assert not tracker.set_keyframe(blank, blank)
    assert tracker.has_keyframe
    assert tracker.fit(tracker.follow(*pair_at(STEP), np.eye(4))) is not None


def test_in_the_dark_no_point_is_found_and_no_motion_fits(tracker):
    dark = np.zeros(SIZE, np.uint8)
    tracks = tracker.follow(dark, dark, np.eye(4))
    assert len(tracks.left_px) < SETTINGS.min_points
    assert tracker.fit(tracks) is None


def test_the_flow_is_the_median_length_of_the_tracks_and_zero_without_any():
    start = np.zeros((3, 2), np.float32)
    end = np.array([[3, 4], [0, 1], [0, 20]], np.float32)
    assert tracks_between(start, end).flow_px == 5.0
    assert tracks_between(start[:0], end[:0]).flow_px == 0.0


def tracks_between(start, end):
    disparity_px = np.zeros(len(start))
    return StereoTracks(
        keyframe_left_px=start, left_px=end, keyframe_disparity_px=disparity_px, disparity_px=disparity_px
    )


def test_points_are_followed_only_from_a_keyframe():
    tracker = StereoTracker(PAIR, SETTINGS)
    blank = np.full(SIZE, 90, np.uint8)
    with pytest.raises(RuntimeError, match="no keyframe to follow points from"):
        tracker.follow(blank, blank, np.eye(4))
