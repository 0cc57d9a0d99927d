"""A stereo pair of any two lenses: projection and triangulation are inverse to each other, and matches are true."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from tests.estimator.textures import grid, shifted, texture
from vobench.errors import VobenchError
from vobench.estimator.stereo import Eye, coarse_disparity, predicted, small_size, stereo_pair
from vobench.estimator.tracking import corners_per_cell
from vobench.geometry import se3
from vobench.geometry.camera import DoubleSphere
from vobench.geometry.rig import PRESETS, mounted_rig, paper_lens, stereo_rig

LENS = paper_lens(square_pixels=True)
STRAIGHT = stereo_rig(LENS, pitch_deg=10)


def wild(name):
    preset = PRESETS[name]
    return mounted_rig(preset.left, preset.right, preset.T_left_right, pitch_deg=15)


def bulging():
    return stereo_rig(DoubleSphere(512, 512, 158.0, 157.0, 254.9, 256.9, -0.18, 0.59), pitch_deg=15)


@pytest.mark.parametrize("rig", [STRAIGHT, wild("euroc"), wild("fisheye"), wild("zed2i"), bulging()], ids=str)
def test_a_point_seen_by_any_two_lenses_is_found_again_from_its_disparity(rig):
    pair = stereo_pair(rig, "test")
    rng = np.random.default_rng(1)
    points = rng.uniform([-0.5, -0.4, 1.0], [0.6, 0.4, 4.0], (200, 3))  # in the left camera's axes
    left_px, right_px = rig.left.project(points), rig.right.project(se3.apply(se3.inverse(rig.T_left_right), points))
    found = pair.points(left_px, pair.disparity(left_px, right_px))
    np.testing.assert_allclose(found, se3.apply(pair.T_view_left, points), atol=1e-6)


@pytest.mark.parametrize("rig", [STRAIGHT, wild("euroc"), wild("fisheye")], ids=["straight", "euroc", "fisheye"])
def test_a_prediction_with_the_true_motion_and_depth_is_where_the_point_is(rig):
    pair = stereo_pair(rig, "test")
    rng = np.random.default_rng(2)
    points = rng.uniform([-0.5, -0.4, 1.0], [0.5, 0.4, 4.0], (50, 3))
    T = se3.transform(se3.rotation_z(0.05), [0.02, -0.03, 0.1])
    uv = pair.left.project(points)
    np.testing.assert_allclose(
        predicted(pair.left, uv, 1 / points[:, 2], T), pair.left.project(se3.apply(T, points)), atol=1e-3
    )
    np.testing.assert_allclose(predicted(pair.left, uv, np.full(50, np.nan), np.eye(4)), uv, atol=1e-3)


def test_a_view_shows_only_pixels_whose_ray_is_at_most_sixty_degrees_from_its_axis():
    pair = stereo_pair(bulging(), "test")
    angles = np.deg2rad([0.0, 30.0, 55.0, 65.0, 85.0])
    rays = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)
    pixels = pair.left.camera.project(rays)
    assert pair.seen(pixels).tolist() == [True, True, True, False, False]


def test_a_motion_of_the_view_is_the_same_motion_of_the_left_camera():
    pair = stereo_pair(wild("euroc"), "test")
    T_left = se3.transform(se3.rotation_z(0.3), [0.1, 0.2, 0.3])
    T_view = pair.T_view_left @ T_left @ se3.inverse(pair.T_view_left)
    np.testing.assert_allclose(pair.T_left(T_view), T_left, atol=1e-12)


def test_a_pair_matches_across_its_eyes_also_where_one_is_dimmer(bed_pair):
    for gain in (1.0, 0.84):
        right = np.round(bed_pair.right * gain).astype(np.uint8)
        _, disparity_px = bed_pair.pair.match(bed_pair.left, right, bed_pair.points, margin_px=12, window_px=11)
        known = np.isfinite(disparity_px)
        assert known.sum() > 0.9 * bed_pair.seen.sum()
        np.testing.assert_allclose(np.median(disparity_px[known]), bed_pair.disparity_px, atol=0.05)


def test_without_points_on_edges_of_depth_disparities_beside_them_are_truer():
    back, front = texture(5), texture(6)
    is_front = np.zeros(back.shape, bool)
    is_front[:, 100:700:120] = is_front[:, 101:700:120] = True
    is_front = cv2.dilate(is_front.astype(np.uint8), np.ones((1, 39), np.uint8)).astype(bool)
    near_px, far_px = 40.0, 34.0
    left = np.where(is_front, front, back)
    moved = shifted(is_front.astype(np.uint8) * 255, -near_px, 0) > 127
    right = np.where(moved, shifted(front, -near_px, 0), shifted(back, -far_px, 0))
    points = corners_per_cell(left, 80, distance_px=3, margin_px=60)
    column, row = np.rint(points).astype(int).T
    true_px = np.where(is_front[row, column], near_px, far_px)

    def errors_px(*, with_edges):
        pair = stereo_pair(STRAIGHT, "test")
        _, found_px = pair.match(left, right, points, margin_px=12, window_px=9, with_edges=with_edges)
        return np.abs(found_px - true_px)[np.isfinite(found_px)]

    every, some = errors_px(with_edges=True), errors_px(with_edges=False)
    assert len(some) > 0.9 * len(every)
    assert np.mean(some > 0.25) < 0.6 * np.mean(every > 0.25)
    assert np.mean(some > 0.1) < 0.6 * np.mean(every > 0.1)


@dataclass(frozen=True)
class WallPair:
    """Two pictures of a wall across the view, and what is true of them."""

    pair: object
    left: np.ndarray
    right: np.ndarray
    points: np.ndarray
    seen: np.ndarray
    disparity_px: float


@pytest.fixture
def bed_pair():
    """A wall so near that a plain search would not find it in the other eye: 150.5 px."""
    left, disparity_px = texture(3), 150.5
    points = corners_per_cell(left, 10, distance_px=8, margin_px=12)
    return WallPair(
        stereo_pair(STRAIGHT, "test"),
        left,
        shifted(left, -disparity_px, 0),
        points,
        points[:, 0] > disparity_px + 12,
        disparity_px,
    )


def test_coarse_disparity_finds_what_is_far_apart():
    image = texture(4)
    small = [
        cv2.resize(picture, small_size(720, 480), interpolation=cv2.INTER_AREA)
        for picture in (image, shifted(image, -200, 0))
    ]
    right_half = grid()[grid()[:, 0] > 300]
    found = coarse_disparity(small[0], small[1], right_half, 720)
    assert np.median(np.abs(found - 200)) < 4


def test_an_eye_that_is_its_own_view_needs_no_map():
    assert Eye(LENS, np.eye(3), LENS.K).small_map() is None
    assert stereo_pair(wild("euroc"), "test").left.small_map() is not None


def test_a_rig_that_is_no_pair_is_refused_by_the_estimators_name():
    above = replace(STRAIGHT, T_body_right=STRAIGHT.T_body_left @ se3.transform(np.eye(3), [0, 0.12, 0]))
    with pytest.raises(VobenchError, match="mine needs the right camera to the right"):
        stereo_pair(above, "mine")
