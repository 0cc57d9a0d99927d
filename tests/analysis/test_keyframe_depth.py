"""Depth of keyframes, on images whose depth is known."""

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.pictures import DISPARITY_PX, HEIGHT_PX, STEP_PX, WIDTH_PX, pair, part, view
from vobench.analysis.keyframe_depth import (
    LEAST_DISPARITY_PX,
    Keyframe,
    dense_disparity,
    filled,
    keyframes_of,
    seen_from,
    view_geometry,
)
from vobench.analysis.stereo_matches import PairShot
from vobench.estimator.stereo import stereo_pair
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady
from vobench.geometry.rig import stereo_rig


def shots_along_the_wall(count: int) -> list[PairShot]:
    """Shots whose true poses agree with the disparity of the wall."""
    step_m = pair().baseline_m * STEP_PX / DISPARITY_PX
    shots = []
    for index, shot in enumerate(part(0, count).shots):
        shots.append(replace(shot, T_world_left=se3.transform(np.eye(3), [step_m * index, 0, 0])))
    return shots


def disparity_of(keyframe: Keyframe) -> np.ndarray:
    return keyframe.rho * pair().focal_baseline


def test_a_flat_wall_has_one_disparity() -> None:
    disparity_px = dense_disparity(view(40, 0), view(40 + DISPARITY_PX, 1), 32)
    is_matched = np.isfinite(disparity_px)
    assert is_matched[:, DISPARITY_PX:].mean() > 0.9
    assert np.quantile(np.abs(disparity_px[is_matched] - DISPARITY_PX), 0.95) < 0.5


def test_what_the_right_image_does_not_show_has_no_disparity() -> None:
    right = view(40 + DISPARITY_PX, 1)
    right[:, 60:120] = np.random.default_rng(0).integers(0, 255, (HEIGHT_PX, 60))
    disparity_px = dense_disparity(view(40, 0), right, 32)
    hidden = disparity_px[:, 60 + DISPARITY_PX + 5 : 120 + DISPARITY_PX - 5]
    assert np.isfinite(hidden).mean() < 0.2


def test_keyframes_have_the_depth_of_the_wall_everywhere() -> None:
    for keyframe in keyframes_of(shots_along_the_wall(5), pair(), view_geometry(pair()), most_disparity_px=30):
        error_px = np.abs(disparity_of(keyframe) - DISPARITY_PX)
        assert np.quantile(error_px, 0.95) < 0.35


def test_noise_is_no_texture() -> None:
    rng = np.random.default_rng(0)
    edge = np.where(np.arange(WIDTH_PX + 40) < 80, 60.0, 90.0)
    plain = np.tile(edge, (HEIGHT_PX, 1))
    shots = []
    for shot in shots_along_the_wall(3):
        left, right = (
            np.rint(plain[:, start_px : start_px + WIDTH_PX] + rng.normal(0, 4, (HEIGHT_PX, WIDTH_PX))).astype(np.uint8)
            for start_px in (20, 20 + DISPARITY_PX)
        )
        shots.append(replace(shot, left=left, right=right, T_world_left=np.eye(4)))
    for keyframe in keyframes_of(shots, pair(), view_geometry(pair()), most_disparity_px=60):
        is_right = np.abs(disparity_of(keyframe) - DISPARITY_PX) < 1.5
        assert is_right.mean() > 0.95  # 0.79 if noise is matched


def test_depth_that_no_other_keyframe_confirms_is_not_used() -> None:
    shots = shots_along_the_wall(5)
    wrong = shots[2].right.copy()
    wrong[30:90] = np.roll(wrong[30:90], 6, axis=1)  # as if these rows were nearer or farther
    shots[2] = replace(shots[2], right=wrong)
    keyframe = keyframes_of(shots, pair(), view_geometry(pair()), most_disparity_px=30)[2]
    error_px = np.abs(disparity_of(keyframe)[35:85, 30:150] - DISPARITY_PX)
    assert np.quantile(error_px, 0.9) < 0.5


def test_unknown_depth_is_that_of_the_farther_side() -> None:
    rho = np.array([[0.5, np.nan, np.nan, 0.2, np.nan], [np.nan] * 5])
    complete = filled(rho, 0.01)
    assert complete[0].tolist() == [0.5, 0.2, 0.2, 0.2, 0.2]
    assert complete[1].tolist() == [0.5, 0.2, 0.2, 0.2, 0.2]
    assert filled(np.full((2, 2), np.nan), 0.01).tolist() == [[0.01] * 2] * 2


def test_a_lens_without_distortion_has_a_view_without_margins() -> None:
    geometry = view_geometry(pair())
    assert (geometry.width_px, geometry.height_px) == (WIDTH_PX, HEIGHT_PX)
    assert geometry.is_recorded.all()


def test_a_view_of_a_lens_that_compresses_its_edges_has_margins_for_all_that_is_recorded() -> None:
    lens = BrownConrady(WIDTH_PX, HEIGHT_PX, 120.0, 120.0, WIDTH_PX / 2 - 0.5, HEIGHT_PX / 2 - 0.5, -0.15, 0, 0, 0, 0)
    compressed = stereo_pair(stereo_rig(lens, pitch_deg=0), "a test")
    geometry = view_geometry(compressed)
    corners_px = np.array([[0.0, 0], [WIDTH_PX - 1, 0], [0, HEIGHT_PX - 1], [WIDTH_PX - 1, HEIGHT_PX - 1]])
    rays = compressed.left.rays(corners_px)
    pixels = (rays @ geometry.K.T)[:, :2]
    assert geometry.width_px > WIDTH_PX + 8
    center_px = geometry.K[:2, 2]
    assert geometry.records(center_px + 0.98 * (pixels - center_px)).all()
    middle_of_left_edge = np.array([[0.0, geometry.height_px / 2]])
    assert geometry.contains(middle_of_left_edge).all()
    assert not geometry.records(middle_of_left_edge).any()
    assert not geometry.records(np.array([[-3.0, 5.0], [5.0, 1e4]])).any()


def test_pixels_and_points_of_a_view_correspond() -> None:
    geometry = view_geometry(pair())
    pixels = geometry.pixel_grid().reshape(-1, 2)
    here = Keyframe(np.zeros((0, 0), np.uint8), np.zeros((0, 0)), np.eye(4))
    seen_px, depth_m = seen_from(here, here, pixels, np.full(len(pixels), 1 / 3.0), geometry)
    assert seen_px == pytest.approx(pixels)
    assert depth_m == pytest.approx(np.full(len(pixels), 3.0))
    ahead = replace(here, T_world_view=se3.transform(np.eye(3), [0, 0, 4.0]))
    behind_px, _ = seen_from(ahead, here, pixels, np.full(len(pixels), 1 / 3.0), geometry)
    assert np.isnan(behind_px).all()
    assert geometry.least_rho * geometry.focal_baseline == pytest.approx(LEAST_DISPARITY_PX)
