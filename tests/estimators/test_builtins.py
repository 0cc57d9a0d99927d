"""The built-in visual estimators on short exact sequences: limits of error, and laws that all of them keep."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from vobench.errors import VobenchError
from vobench.estimator import EncoderReadings, Frame, ImuReadings, Status
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import (
    PIONEER_WHEELS,
    PRESETS,
    CalibrationError,
    looking,
    mounted_rig,
    paper_lens,
    stereo_rig,
    true_rig,
)
from vobench.motion.drive import drive
from vobench.sensor.imu import IMUS, STREAMS, measure

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI

LENS = paper_lens(square_pixels=True)
DOWN, AHEAD = stereo_rig(LENS, pitch_deg=90), stereo_rig(LENS, pitch_deg=10)
LEGS = {"down": ((8, 0.5, 0.0), (8, 0.4, 1.2)), "ahead": ((8, 0.5, 0.0), (8, 0.4, 1.0))}
RIGS = {"down": DOWN, "ahead": AHEAD}
STEREO = ["lk_epipolar", "stereo_pnp", "feature_vo"]


@pytest.fixture(scope="module")
def filmed(bed):
    """Frames by the name of a way, filmed when first asked for."""
    return cache(lambda name: tuple(bed.film(RIGS[name], bed.drive(*LEGS[name]))))


def ends(bed, results, name):
    return bed.accuracy(results, bed.drive(*LEGS[name]) @ RIGS[name].T_body_left)


def as_left(results, rig):
    """Results of an estimator that says where the body is, as the left camera's."""
    T_left_body = se3.inverse(rig.T_body_left)
    return [replace(r, T_odom_frame=T_left_body @ r.T_odom_frame @ rig.T_body_left) for r in results]


def positions(results):
    return np.stack([result.T_odom_frame[:3, 3] for result in results])


@pytest.mark.parametrize(
    ("estimator", "way", "most"),
    [
        ("stereo_pnp", "down", 0.002),
        ("stereo_pnp", "ahead", 0.002),
        ("planar_floor", "down", 0.001),
        ("feature_vo", "down", 0.01),
        ("feature_vo", "ahead", 0.01),
    ],
)
def test_its_end_is_off_by_a_small_share_of_the_path(bed, filmed, estimator, way, most):
    results = bed.estimated(estimator, RIGS[way], filmed(way))
    if estimator == "planar_floor":
        results = as_left(results, RIGS[way])
    accuracy = ends(bed, results, way)
    assert accuracy.end_fraction < most
    assert accuracy.end_rad < np.deg2rad(0.3)
    assert {result.status for result in results[1:]} == {Status.OK}


def step_errors_m(results, T_world_left):
    """How far each step (N - 1,) is from that of the truth."""
    poses = np.stack([result.T_odom_frame for result in results])
    steps, true_steps = (se3.inverse(T[:-1]) @ T[1:] for T in (poses, T_world_left))
    return np.linalg.norm((se3.inverse(true_steps) @ steps)[:, :3, 3], axis=1)


def test_positions_of_orb_are_refined_to_sub_pixels(bed, filmed):
    """Its steps have less than half the error of plain frame-to-frame matching of detected positions."""
    frames = filmed("ahead")[:7]
    truth = bed.drive(*LEGS["ahead"])[:7] @ AHEAD.T_body_left
    refined = bed.estimated("feature_vo", AHEAD, frames)
    detected = bed.estimated("feature_vo", AHEAD, frames, window_px=0, keep_below_px=0.0)
    refined_errors_m = step_errors_m(refined, truth)
    detected_errors_m = step_errors_m(detected, truth)
    assert np.sqrt(np.mean(refined_errors_m**2)) < 0.5 * np.sqrt(np.mean(detected_errors_m**2))


def test_positions_of_sift_are_used_as_detected(bed, filmed):
    """They are more accurate than Lucas-Kanade with a small window."""
    frames = filmed("ahead")[:4]
    default = bed.estimated("feature_vo", AHEAD, frames, detector="sift")
    detected = bed.estimated("feature_vo", AHEAD, frames, detector="sift", window_px=0)
    assert positions(default).tobytes() == positions(detected).tobytes()


def test_detected_positions_of_sift_are_nearer_to_the_truth_than_those_of_orb(bed, filmed):
    truth = bed.drive(*LEGS["ahead"])[:6] @ AHEAD.T_body_left
    orb, sift = (
        bed.estimated("feature_vo", AHEAD, filmed("ahead")[:6], detector=name, window_px=0) for name in ("orb", "sift")
    )
    assert bed.accuracy(sift, truth).end_m < bed.accuracy(orb, truth).end_m


@pytest.mark.parametrize(("way", "most"), [("down", 0.02), ("ahead", 0.04)])
def test_one_camera_knows_the_path_but_for_its_length(bed, filmed, way, most):
    T_world_left = bed.drive(*LEGS[way]) @ RIGS[way].T_body_left
    frames = [replace(f, right=None) for f in filmed(way)]
    results = bed.estimated("mono_vo", RIGS[way], frames)
    begun = next(k for k, result in enumerate(results) if result.status is Status.OK)
    truth = (se3.inverse(T_world_left[0]) @ T_world_left)[begun:, :3, 3]
    said = positions(results[begun:])
    scale = (truth * said).sum() / (said * said).sum()
    assert begun < 10
    assert np.linalg.norm(scale * said - truth, axis=1).max() < most * np.linalg.norm(truth[-1])


@pytest.mark.parametrize("estimator", [*STEREO, "mono_vo", "planar_floor"])
def test_equal_pictures_give_equal_bits_and_poses_are_rotations(bed, filmed, estimator):
    once, again = (bed.estimated(estimator, DOWN, filmed("down")[:5]) for _ in range(2))
    poses = [np.stack([result.T_odom_frame for result in results]) for results in (once, again)]
    assert poses[0].tobytes() == poses[1].tobytes()
    assert se3.is_rotation(poses[0][:, :3, :3], tolerance=1e-9)


@pytest.mark.parametrize("estimator", [*STEREO, "mono_vo", "planar_floor"])
def test_black_pictures_are_lost_with_a_reason_and_then_it_goes_on(bed, filmed, estimator):
    frames = [
        replace(f, left=np.zeros_like(f.left), right=np.zeros_like(f.right)) if k in (3, 4) else f
        for k, f in enumerate(filmed("down")[:9])
    ]
    results = bed.estimated(estimator, DOWN, frames)
    for result in results[3:5]:
        assert (result.status, result.T_odom_frame) == (Status.LOST, None)
        assert result.reason
    assert all(result.T_odom_frame is not None for result in results[5:])


@pytest.mark.parametrize("estimator", [*STEREO, "mono_vo", "planar_floor"])
def test_who_stands_still_under_noise_stays_within_a_millimetre(bed, filmed, estimator):
    rng, first = np.random.default_rng(1), filmed("ahead")[0]
    noisy = [replace(first, left=grainy(first.left, rng), right=grainy(first.right, rng)) for _ in range(12)]
    results = bed.estimated(estimator, AHEAD, noisy)
    assert np.abs(positions(results)).max() < 0.001


@pytest.mark.parametrize("estimator", [*STEREO, "mono_vo", "planar_floor", "wheel_visual", "imu_visual"])
@pytest.mark.parametrize("size", [(20, 16), (64, 48), (1226, 370)])
def test_pictures_of_nothing_are_no_crash_and_no_nan(bed, estimator, size):
    """Noise, white, and noise again, of any size: a pose is a pose or there is none."""
    lens, rng = Pinhole(*size, size[0], size[0], (size[0] - 1) / 2, (size[1] - 1) / 2), np.random.default_rng(7)
    imu = replace(IMUS["adis16448"]).calibration
    running = bed.started(estimator, replace(stereo_rig(lens, pitch_deg=30), imu=imu))
    level = ImuReadings(np.zeros(1, np.int64), np.zeros((1, 3)), np.array([[0, 0, 9.8]]))
    for k in range(4):
        left, right = (
            rng.integers(0, 256, (2, *size[::-1])).astype(np.uint8)
            if k != 2
            else np.full((2, *size[::-1]), 255, np.uint8)
        )
        stamp = np.array([k * 10**8], np.int64)
        readings = {"encoders": EncoderReadings(stamp, np.full((1, 2), 50 * k)), "imu": replace(level, t_ns=stamp)}
        result = running.process(Frame(k, k * 10**8, left, right, **readings))
        assert result.T_odom_frame is None or se3.is_rotation(result.T_odom_frame[:3, :3], tolerance=1e-9)
        assert result.T_odom_frame is None or np.isfinite(result.T_odom_frame).all()
        assert np.isfinite(list(result.stats.values())).all()


@pytest.mark.parametrize("name", ["euroc", "fisheye"])
def test_points_are_followed_through_lenses_that_bend_lines(bed, name):
    preset, legs = PRESETS[name], ((3, 0.5, 0.0), (3, 0.4, 1.0))
    rig = mounted_rig(preset.left, preset.right, preset.T_left_right, pitch_deg=15)
    T_world_body = bed.drive(*legs)
    results = bed.estimated("stereo_pnp", rig, bed.film(rig, T_world_body))
    accuracy = bed.accuracy(results, T_world_body @ rig.T_body_left)
    assert accuracy.end_fraction < 0.01
    assert accuracy.end_rad < np.deg2rad(0.1)


def grainy(image, rng, sigma=2.0):
    return np.clip(image + rng.normal(0, sigma, image.shape), 0, 255).round().astype(np.uint8)


@pytest.mark.parametrize("estimator", ["lk_epipolar", "stereo_pnp"])
def test_a_fast_turn_is_followed_by_prediction(bed, estimator):
    """Up to 7.6° and 90 px from one picture to the next, from rest."""
    legs = [(1, 0.3, turn) for turn in np.r_[0.5:4.0:5j, np.full(5, 4.0), 4.0:0.5:5j]]
    T_world_body = bed.drive(*legs)
    results = bed.estimated(estimator, AHEAD, bed.film(AHEAD, T_world_body))
    assert {result.status for result in results[1:]} == {Status.OK}
    accuracy = bed.accuracy(results, T_world_body @ AHEAD.T_body_left)
    assert accuracy.end_m < 0.003
    assert accuracy.end_rad < np.deg2rad(0.3)


@pytest.mark.parametrize("estimator", ["lk_epipolar", "stereo_pnp"])
def test_eyes_of_unlike_gain_see_as_much_as_equal_ones(bed, filmed, estimator):
    frames = filmed("ahead")
    dim = [replace(f, right=np.round(f.right * 0.84).astype(np.uint8)) for f in frames]
    equal, unlike = (bed.estimated(estimator, AHEAD, seen) for seen in (frames, dim))
    tracks = [np.mean([r.stats["inliers"] for r in results[1:]]) for results in (equal, unlike)]
    assert tracks[1] > 0.9 * tracks[0]
    assert ends(bed, unlike, "ahead").end_fraction < 0.002


@pytest.mark.parametrize("estimator", ["lk_epipolar", "stereo_pnp"])
@pytest.mark.parametrize("yaw_deg", [0.0, 0.0435, -0.0435])
def test_an_offset_of_disparity_is_told_and_a_perfect_pair_is_left_alone(bed, estimator, yaw_deg):
    """0.0435° between the eyes are 0.5 px; at 0.15 m a picture, depths differ enough to show them."""
    true = true_rig(AHEAD, CalibrationError(right_yaw_deg=yaw_deg))
    results = bed.estimated(estimator, AHEAD, bed.film(true, bed.drive((14, 3.0, 0.4))))
    assert results[-1].stats["offset_px"] == pytest.approx(LENS.fx_px * np.deg2rad(yaw_deg), abs=0.2)
    assert (results[-1].stats["offset_px"] == 0) == (yaw_deg == 0)


METRES_PER_TICK = 2 * np.pi * PIONEER_WHEELS.radius_m / PIONEER_WHEELS.ticks_per_revolution


def rolling(frames, legs, rng, *, slip=0.03):
    """The frames with what the wheels count on the way: each step of each wheel is off by a share of it."""
    steps = np.array([(speed / 30, turn / 30) for count, speed, turn in legs for _ in range(count)])
    half = PIONEER_WHEELS.track_m / 2
    wheels_m = np.stack([steps[:, 0] - half * steps[:, 1], steps[:, 0] + half * steps[:, 1]], -1)
    counted = np.cumsum(wheels_m * (1 + slip * rng.standard_normal(wheels_m.shape)), axis=0)
    ticks = np.r_[np.zeros((1, 2)), counted / METRES_PER_TICK].round().astype(np.int64)
    return [
        replace(f, encoders=EncoderReadings(np.array([f.t_ns], np.int64), ticks[k : k + 1]))
        for k, f in enumerate(frames)
    ]


def dark_from(frames, first, count):
    return [
        replace(f, left=np.zeros_like(f.left), right=np.zeros_like(f.right)) if first <= k < first + count else f
        for k, f in enumerate(frames)
    ]


def test_wheels_and_eyes_together_beat_both_where_the_light_goes_out(bed, filmed):
    frames = dark_from(rolling(filmed("ahead"), LEGS["ahead"], np.random.default_rng(2)), 6, 5)
    both = as_left(bed.estimated("wheel_visual", AHEAD, frames), AHEAD)
    wheels = as_left(bed.estimated("wheel_odometry", AHEAD, frames), AHEAD)
    eyes = bed.estimated("stereo_pnp", AHEAD, frames)
    off_m = [ends(bed, results, "ahead").end_m for results in (both, wheels, eyes)]
    assert off_m[0] < min(off_m[1:])
    assert {result.reason for result in both[6:11]} == {"wheels"}


def test_wheels_that_spin_are_not_believed(bed, filmed):
    frames = rolling(
        filmed("ahead"), [(n, 2 * speed, turn) for n, speed, turn in LEGS["ahead"]], np.random.default_rng(3)
    )
    results = bed.estimated("wheel_visual", AHEAD, frames)
    assert ends(bed, as_left(results, AHEAD), "ahead").end_fraction < 0.01
    assert max(result.stats.get("slip", 0) for result in results) == 1


@cache
def driven():
    """A robot's drive of some seconds, its pictures at 15 Hz, and what an IMU on it reads."""
    motion, imu = drive(((0.5, 0.3),)).motion, replace(IMUS["adis16448"], position_m=(0.1, 0.05, 0.2))
    rngs = dict(zip(STREAMS, np.random.default_rng(4).spawn(len(STREAMS)), strict=True))
    readings, _ = measure(motion, imu, rngs=rngs)
    stamps = np.arange(22, dtype=np.int64) * 10**9 // 15
    return motion.at(stamps).T_world_body, stamps, readings, replace(AHEAD, imu=imu.calibration)


def with_imu(frames, stamps, readings):
    cuts = np.r_[0, np.searchsorted(readings.t_ns, stamps, side="right")]
    return [
        replace(
            f,
            t_ns=int(stamps[k]),
            imu=ImuReadings(*(getattr(readings, name)[a:b] for name in ("t_ns", "gyro_radps", "accel_mps2"))),
        )
        for k, (f, a, b) in enumerate(zip(frames, cuts[:-1], cuts[1:], strict=True))
    ]


def test_an_imu_bridges_the_dark_in_which_eyes_alone_stay_behind_and_it_alone_runs_away(bed):
    T_world_body, stamps, readings, rig = driven()
    frames = dark_from(with_imu(bed.film(rig, T_world_body), stamps, readings), 12, 5)
    both, eyes = (bed.estimated(name, rig, frames) for name in ("imu_visual", "stereo_pnp"))
    eyes = [eyes[11] if r.T_odom_frame is None else r for r in eyes]  # where it lost sight it stays where it was
    alone = as_left(bed.estimated("imu_dead_reckoning", rig, frames), rig)
    truth = positions_of(T_world_body @ rig.T_body_left)
    worst_m = [np.linalg.norm(positions(results) - truth, axis=1).max() for results in (both, eyes, alone)]
    assert worst_m[0] < 0.1 * min(worst_m[1:])
    assert {result.reason for result in both[12:17]} == {"inertial"}
    assert {result.status for result in both[1:12]} == {Status.OK}


def positions_of(T_world_frame):
    return (se3.inverse(T_world_frame[0]) @ T_world_frame)[:, :3, 3]


@pytest.mark.parametrize(
    ("estimator", "rig", "said"),
    [
        ("wheel_visual", replace(AHEAD, wheels=None), "needs wheels"),
        ("imu_visual", AHEAD, "needs an IMU"),
        ("planar_floor", replace(AHEAD, T_body_left=looking(pitch_deg=90, position_m=(0, 0, 0))), "above the floor"),
    ],
)
def test_a_rig_without_what_it_needs_is_refused(bed, estimator, rig, said):
    with pytest.raises(VobenchError, match=said):
        bed.started(estimator, rig)


def test_a_detector_that_nobody_knows_is_named(bed):
    with pytest.raises(VobenchError, match="detector is 'surf', expected one of orb, sift"):
        bed.started("feature_vo", AHEAD, detector="surf")
