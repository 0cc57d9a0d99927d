"""The reference estimator against exact motion: straight, turning, spinning, standing, in the dark."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import VobenchError
from vobench.estimator import Result, Status
from vobench.geometry import se3
from vobench.geometry.camera import DoubleSphere, Equirectangular, Pinhole
from vobench.geometry.rig import PRESETS, CalibrationError, mounted_rig, paper_lens, stereo_rig, true_rig

SQUARE, LITERAL = paper_lens(square_pixels=True), paper_lens(square_pixels=False)
DOWN, AHEAD = stereo_rig(SQUARE, pitch_deg=90), stereo_rig(SQUARE, pitch_deg=10)
# Straight, then a left turn: up to 17 mm and 2.3 deg a frame, as on the paper's path.
DOWN_LEGS, AHEAD_LEGS = ((12, 0.5, 0.0), (12, 0.4, 1.2)), ((10, 0.5, 0.0), (9, 0.4, 1.0))


@pytest.fixture(scope="module")
def down_frames(bed):
    return bed.film(DOWN, bed.drive(*DOWN_LEGS))


@pytest.fixture(scope="module")
def ahead_frames(bed):
    return bed.film(AHEAD, bed.drive(*AHEAD_LEGS))


@pytest.fixture(scope="module")
def down_results(bed, down_frames):
    return bed.estimated("lk_epipolar", DOWN, down_frames)


def poses(results: list[Result]) -> np.ndarray:
    return np.stack([result.T_odom_frame for result in results])


def dark(frame):
    return replace(frame, left=np.zeros_like(frame.left), right=np.zeros_like(frame.right))


def test_a_camera_that_looks_at_the_floor_is_followed_to_three_thousandths_of_its_path(bed, down_results):
    accuracy = bed.accuracy(down_results, bed.drive(*DOWN_LEGS) @ DOWN.T_body_left)
    assert accuracy.end_fraction < 0.003
    assert accuracy.end_rad < np.deg2rad(0.2)
    assert [result.status for result in down_results] == [Status.INIT] + [Status.OK] * 24


def test_a_camera_that_looks_ahead_is_followed_to_half_a_percent_of_its_path(bed, ahead_frames):
    results = bed.estimated("lk_epipolar", AHEAD, ahead_frames)
    accuracy = bed.accuracy(results, bed.drive(*AHEAD_LEGS) @ AHEAD.T_body_left)
    assert accuracy.end_fraction < 0.005
    assert accuracy.end_rad < np.deg2rad(0.1)
    assert min(result.stats.get("h_ratio", 1.0) for result in results) < 0.8, "no frame was refined"


def test_refining_helps_where_the_scene_is_no_plane(bed, ahead_frames):
    truth = bed.drive(*AHEAD_LEGS)[:6] @ AHEAD.T_body_left
    errors = [
        bed.accuracy(bed.estimated("lk_epipolar", AHEAD, ahead_frames[:6], refine_below_h_ratio=below), truth).end_m
        for below in (0.0, 2.0)
    ]
    assert errors[1] < errors[0]


def test_pixels_need_not_be_square(bed):
    rig, T_world_body = stereo_rig(LITERAL, pitch_deg=90), bed.drive((5, 0.5, 0.0), (4, 0.4, 1.2))
    results = bed.estimated("lk_epipolar", rig, bed.film(rig, T_world_body))
    accuracy = bed.accuracy(results, T_world_body @ rig.T_body_left)
    assert accuracy.end_m < 0.001
    assert accuracy.end_rad < np.deg2rad(0.15)


def test_the_poses_are_rotations_and_start_at_the_identity(down_results):
    T = poses(down_results)
    np.testing.assert_array_equal(T[0], np.eye(4))
    assert se3.is_rotation(T[:, :3, :3], tolerance=1e-12)


def test_the_same_pictures_give_the_same_bits(bed, down_frames, down_results):
    again = poses(bed.estimated("lk_epipolar", DOWN, down_frames[:12]))
    assert again.tobytes() == poses(down_results[:12]).tobytes()


def test_a_pure_rotation_moves_nothing(bed):
    on_axle = stereo_rig(SQUARE, pitch_deg=10, forward_m=0.0)
    about_the_camera = on_axle.T_body_left @ np.linalg.inv(se3.transform(np.eye(3), on_axle.T_body_left[:3, 3]))
    T_world_left = se3.transform(np.eye(3), [0, 0, 0.4]) @ bed.drive((8, 0.0, 1.0)) @ about_the_camera
    still_rig = replace(on_axle, T_body_left=np.eye(4), T_body_right=on_axle.T_left_right)
    results = bed.estimated("lk_epipolar", still_rig, bed.film(still_rig, T_world_left))
    truth = se3.inverse(T_world_left[0]) @ T_world_left[-1]
    error = se3.inverse(truth) @ results[-1].T_odom_frame
    assert np.linalg.norm(error[:3, 3]) < 0.0015
    assert se3.rotation_angle(error[:3, :3]) < np.deg2rad(0.1)


def test_a_camera_that_stands_still_under_noise_says_so_and_does_not_drift(bed, down_frames):
    rng = np.random.default_rng(1)
    first = down_frames[0]
    noisy = [
        replace(first, **{side: grainy(getattr(first, side), rng) for side in ("left", "right")}) for _ in range(6)
    ]
    results = bed.estimated("lk_epipolar", DOWN, noisy)
    assert {result.status for result in results[1:]} == {Status.STATIONARY}
    np.testing.assert_array_equal(poses(results), np.broadcast_to(np.eye(4), (6, 4, 4)))


def grainy(image, rng, sigma=2.0):
    return np.clip(image + rng.normal(0, sigma, image.shape), 0, 255).round().astype(np.uint8)


def test_creeping_below_the_gate_adds_up_until_it_shows(bed):
    T_world_body = bed.drive((8, 0.0006, 0.0))  # 0.02 mm and 0.03 px a frame
    results = bed.estimated("lk_epipolar", DOWN, bed.film(DOWN, T_world_body))
    assert {result.status for result in results[1:]} == {Status.STATIONARY, Status.OK}
    moved_m = np.linalg.norm(results[-1].T_odom_frame[:3, 3])
    assert moved_m == pytest.approx(8 * 2e-5, abs=5e-5)


def test_a_slow_camera_keeps_its_view_and_so_does_not_drift(bed):
    T_world_body = bed.drive((8, 0.15, 0.1))
    frames = bed.film(AHEAD, T_world_body)
    truth = T_world_body @ AHEAD.T_body_left
    kept, stepped = (
        bed.accuracy(bed.estimated("lk_epipolar", AHEAD, frames, keep_below_px=px), truth).end_m for px in (8.0, 0.0)
    )
    assert kept < 0.0005
    assert kept < stepped


def test_one_black_frame_is_lost_with_its_reason_and_bridged(bed, down_frames, down_results):
    frames = [dark(frame) if k == 4 else frame for k, frame in enumerate(down_frames[:9])]
    results = bed.estimated("lk_epipolar", DOWN, frames)
    assert (results[4].status, results[4].reason, results[4].T_odom_frame) == (Status.LOST, "few_corners", None)
    assert [result.status for result in results[5:]] == [Status.OK] * 4
    assert np.linalg.norm(results[8].T_odom_frame[:3, 3] - down_results[8].T_odom_frame[:3, 3]) < 0.0005


def test_after_a_gap_too_wide_to_bridge_it_carries_on_from_its_last_pose(bed, down_frames):
    frames = [down_frames[0], *[dark(down_frames[1])] * 2, down_frames[-2], down_frames[-1]]
    results = bed.estimated("lk_epipolar", DOWN, frames)
    assert [result.status for result in results] == ["init", "lost", "lost", "lost", "ok"]
    assert results[3].reason in {"few_tracks", "no_scale", "transfer_error"}
    assert np.linalg.norm(results[4].T_odom_frame[:3, 3]) < 0.03, "one step from the last pose, not the whole gap"


def test_darkness_throughout_gives_no_pose_at_all(bed, down_frames):
    results = bed.estimated("lk_epipolar", DOWN, [dark(frame) for frame in down_frames[:3]])
    assert [(result.T_odom_frame, result.reason) for result in results] == [(None, "few_corners")] * 3


def test_missing_pictures_are_lost_frames(bed, down_frames):
    results = bed.estimated("lk_epipolar", DOWN, [down_frames[0], replace(down_frames[1], right=None)])
    assert results[1].status is Status.LOST


def test_thirty_percent_of_flicker_is_survived(bed, down_frames):
    def flickering(k, image):
        return np.clip(image * (1.3 if k % 2 else 0.7), 0, 255).astype(np.uint8)

    frames = [
        replace(f, left=flickering(k, f.left), right=flickering(k, f.right)) for k, f in enumerate(down_frames[:8])
    ]
    results = bed.estimated("lk_epipolar", DOWN, frames)
    accuracy = bed.accuracy(results, bed.drive(*DOWN_LEGS)[:8] @ DOWN.T_body_left)
    assert accuracy.end_fraction < 0.02


def test_exchanged_cameras_are_noticed(bed, down_frames):
    swapped = [replace(frame, left=frame.right, right=frame.left) for frame in down_frames[:3]]
    results = bed.estimated("lk_epipolar", DOWN, swapped)
    assert [result.reason for result in results[1:]] == ["no_scale"] * 2


@pytest.mark.parametrize("size", [(2400, 1600), (64, 48), (20, 16)])
def test_faint_pictures_of_any_size_do_not_crash_it(bed, size):
    rng = np.random.default_rng(2)
    lens = Pinhole(*size, size[0], size[0], (size[0] - 1) / 2, (size[1] - 1) / 2)
    faint = [rng.integers(100, 103, size[::-1]).astype(np.uint8) for _ in range(2)]
    estimator = bed.started("lk_epipolar", stereo_rig(lens, pitch_deg=10))
    frame = bed.film(stereo_rig(Pinhole(8, 8, 8, 8, 3.5, 3.5), pitch_deg=10), np.eye(4)[None])[0]
    results = [estimator.process(replace(frame, left=image, right=image)) for image in faint]
    assert results[1].status is Status.LOST


def test_tracks_and_numbers_come_with_every_pose(down_results):
    result = down_results[1]
    assert {"tracks", "inliers", "parallax_px", "h_ratio", "transfer_px"} <= result.stats.keys()
    assert result.tracks.uv_px.shape == result.tracks.uv_last_px.shape == (result.stats["tracks"], 2)
    assert result.tracks.inlier.sum() == result.stats["inliers"] > 300
    length = np.linalg.norm(result.tracks.uv_px - result.tracks.uv_last_px, axis=1)
    assert np.median(length) == pytest.approx(SQUARE.fx_px * 0.5 / 30 / 0.4, rel=0.01)


LENS_LEGS = ((3, 0.5, 0.0), (3, 0.4, 1.0))


def mounted_preset(name, **error):
    preset = PRESETS[name]
    rig = mounted_rig(preset.left, preset.right, preset.T_left_right, pitch_deg=15)
    return rig, true_rig(rig, CalibrationError(**error))


@pytest.mark.parametrize("name", ["euroc", "fisheye"])
def test_lenses_that_bend_lines_and_cameras_that_are_not_parallel_are_followed(bed, name):
    rig, _ = mounted_preset(name)
    T_world_body = bed.drive(*LENS_LEGS)
    results = bed.estimated("lk_epipolar", rig, bed.film(rig, T_world_body))
    accuracy = bed.accuracy(results, T_world_body @ rig.T_body_left)
    assert {result.status for result in results[1:]} == {Status.OK}
    assert accuracy.end_fraction < 0.01
    assert accuracy.end_rad < np.deg2rad(0.2)


@pytest.mark.parametrize("model", ["double_sphere", "equirectangular"])
def test_cameras_that_see_behind_themselves_are_followed_by_what_lies_before_them(bed, model):
    lens = {
        "double_sphere": DoubleSphere(512, 512, 158.0, 157.0, 254.9, 256.9, -0.18, 0.59),
        "equirectangular": Equirectangular(1024, 512),
    }[model]
    rig, T_world_body = stereo_rig(lens, pitch_deg=15), bed.drive(*LENS_LEGS)
    results = bed.estimated("lk_epipolar", rig, bed.film(rig, T_world_body))
    accuracy = bed.accuracy(results, T_world_body @ rig.T_body_left)
    assert accuracy.end_fraction < 0.02
    assert accuracy.end_rad < np.deg2rad(0.3)


def test_a_baseline_told_too_short_makes_the_path_too_short(bed):
    told, true = mounted_preset("euroc", baseline_ratio=0.1)
    T_world_body = bed.drive((8, 0.5, 0.0))
    results = bed.estimated("lk_epipolar", told, bed.film(true, T_world_body))
    moved_m = np.linalg.norm(results[-1].T_odom_frame[:3, 3])
    assert moved_m == pytest.approx(8 * 0.5 / 30 / 1.1, rel=0.01)


def test_a_small_turn_between_the_cameras_that_is_told_does_no_harm(bed):
    turn = np.eye(4)
    turn[:3, :3] = se3.rotation_z(0.01)
    crooked = replace(DOWN, T_body_right=DOWN.T_body_right @ turn)
    T_world_body = bed.drive((6, 0.5, 0.0))
    results = bed.estimated("lk_epipolar", crooked, bed.film(crooked, T_world_body))
    assert bed.accuracy(results, T_world_body @ crooked.T_body_left).end_fraction < 0.005


def test_unequal_lenses_are_followed(bed):
    unequal = replace(DOWN, right=LITERAL)
    T_world_body = bed.drive((6, 0.5, 0.0))
    results = bed.estimated("lk_epipolar", unequal, bed.film(unequal, T_world_body))
    assert bed.accuracy(results, T_world_body @ unequal.T_body_left).end_fraction < 0.01


@pytest.mark.parametrize(
    ("T_left_right", "where"),
    [
        (se3.transform(np.eye(3), [0, 0.12, 0]), r"it is at \(0, 0\.12, 0\) m and turned by 0 deg"),
        (se3.transform(np.eye(3), [-0.12, 0, 0]), r"it is at \(-0\.12, 0, 0\) m"),
        (se3.transform(np.diag([-1.0, 1.0, -1.0]), [0.12, 0, 0]), "turned by 180 deg"),
    ],
)
def test_cameras_that_are_no_pair_side_by_side_are_refused(bed, T_left_right, where):
    with pytest.raises(VobenchError, match=f"to the right of the left and both looking the same way.*{where}"):
        bed.started("lk_epipolar", replace(DOWN, T_body_right=DOWN.T_body_left @ T_left_right))


def test_pictures_of_two_sizes_are_refused(bed):
    with pytest.raises(VobenchError, match=r"two images of one size, got \(720, 480\) and \(640, 480\) px"):
        bed.started("lk_epipolar", replace(DOWN, right=PRESETS["tartanair"].right))


@pytest.mark.parametrize(("name", "value"), [("min_trax", 3), ("margin_px", -1), ("ransac_px", "half")])
def test_a_wrong_parameter_is_named(bed, name, value):
    with pytest.raises(VobenchError, match=name):
        bed.started("lk_epipolar", DOWN, **{name: value})
