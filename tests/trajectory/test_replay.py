"""Replayed recordings: near the recorded poses, with accelerations that a body could have."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.trajectory.replay import AXES, interpolated, smoothed
from vobench.trajectory.spline import pose_spline
from vobench.trajectory.text import parse_tum
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.unstamped import parse_kitti

DATA = Path(__file__).parents[2] / ".." / "shared" / "data" / "trajectories"
WITH_DATA = pytest.mark.skipif(not DATA.is_dir(), reason="no folder ../shared/data with real trajectories")
NOISE_M, NOISE_RAD = 1e-4, 1e-3


def carried():
    rng = np.random.default_rng(0)
    R = Rotation.from_rotvec(np.cumsum(0.3 * rng.normal(size=(12, 3)), 0)).as_matrix()
    return pose_spline(np.arange(12.0), se3.transform(R, np.cumsum(0.3 * rng.normal(size=(12, 3)), 0)))


def recorded(rate_hz=100, noise=0.0, without=lambda t_s: np.zeros(len(t_s), bool)):
    motion, rng = carried(), np.random.default_rng(1)
    t_s = np.arange(0, 11, 1 / rate_hz)
    t_s = t_s[~without(t_s)]
    T = motion.at(t_s * 1e9).T_world_body
    T[:, :3, :3] @= Rotation.from_rotvec(noise * NOISE_RAD * rng.normal(size=(len(t_s), 3))).as_matrix()
    T[:, :3, 3] += noise * NOISE_M * rng.normal(size=(len(t_s), 3))
    return Trajectory(np.rint(t_s * 1e9).astype(np.int64) + 10**18, T)


def rms(vectors):
    return np.sqrt(np.mean(np.sum(vectors**2, axis=-1)))


def between(motion):
    return np.linspace(motion.start_ns + 5e8, motion.end_ns - 5e8, 3000)


def test_interpolated_passes_through_every_pose():
    trajectory = recorded(30, noise=1.0)
    replay = interpolated(trajectory)
    found = replay.motion.at(trajectory.t_ns - trajectory.t_ns[0]).T_world_body
    np.testing.assert_allclose(found, trajectory.T_world_frame, atol=1e-9)
    assert replay.residual.position_max_m < 1e-12
    assert replay.gaps_s == ()


def test_smoothed_gives_back_a_smooth_motion():
    motion, replay = carried(), smoothed(recorded())
    truth, found = motion.at(between(motion)), replay.motion.at(between(motion))
    np.testing.assert_allclose(found.T_world_body, truth.T_world_body, atol=1e-4)
    np.testing.assert_allclose(found.acceleration_mps2, truth.acceleration_mps2, atol=5e-3)
    np.testing.assert_allclose(found.turn_radps, truth.turn_radps, atol=5e-3)


def test_of_a_noisy_recording_smoothing_leaves_a_tenth_of_the_false_acceleration():
    motion, trajectory = carried(), recorded(noise=1.0)
    t_ns = between(motion)
    truth = motion.at(t_ns)
    exact, smooth = (replay(trajectory).motion.at(t_ns) for replay in (interpolated, smoothed))
    false = [rms(k.acceleration_mps2 - truth.acceleration_mps2) for k in (exact, smooth)]
    assert false[0] > 1  # which is why interpolation is for cameras only
    assert false[1] < 0.1 * false[0]
    assert rms(smooth.turn_radps - truth.turn_radps) < 0.2 * rms(exact.turn_radps - truth.turn_radps)


def test_the_residual_of_a_smoothed_recording_is_its_noise():
    residual = smoothed(recorded(noise=1.0)).residual
    assert 0.85 * NOISE_M * np.sqrt(3) < residual.position_rms_m < NOISE_M * np.sqrt(3)
    assert 0.85 * NOISE_RAD * np.sqrt(3) < residual.rotation_rms_rad < NOISE_RAD * np.sqrt(3)
    assert residual.position_rms_m < residual.position_max_m < 6 * residual.position_rms_m


def test_more_knots_follow_the_recording_more_closely():
    trajectory = recorded(noise=1.0)
    loose, close = (smoothed(trajectory, knot_hz=hz).residual.position_rms_m for hz in (5, 30))
    assert close < loose


def test_slow_recordings_get_fewer_knots_than_asked_for():
    trajectory = recorded(5)
    assert smoothed(trajectory, knot_hz=100).residual.position_rms_m < 0.05


def test_a_hole_is_recognised_and_bridged():
    trajectory = recorded(noise=1.0, without=lambda t_s: (t_s > 4) & (t_s < 4.6))
    replay = smoothed(trajectory)
    np.testing.assert_allclose(replay.gaps_s, [(4.0, 4.6)], atol=1e-9)
    t_ns = np.linspace(4e9, 4.6e9, 50)
    off_m = np.linalg.norm(
        replay.motion.at(t_ns).T_world_body[:, :3, 3] - carried().at(t_ns).T_world_body[:, :3, 3], axis=1
    )
    assert off_m.max() < 0.002
    for replayed in (interpolated, smoothed):
        with pytest.raises(MotionError, match=r"no pose from 4\.000 s to 4\.600 s after its start"):
            replayed(trajectory, max_gap_s=0.5)


def test_the_order_of_quaternion_signs_does_not_matter():
    t_s = np.arange(0, 11, 0.02)
    spinning = Trajectory(np.rint(t_s * 1e9).astype(np.int64), se3.transform(se3.rotation_z(2 * t_s), np.zeros(3)))
    k = smoothed(spinning).motion.at(np.linspace(0, 10e9, 500))
    np.testing.assert_allclose(k.turn_radps, np.broadcast_to([0, 0, 2], (500, 3)), atol=1e-4)


@pytest.mark.parametrize("replayed", [interpolated, smoothed])
def test_twice_the_speed_is_half_the_time_on_the_same_way(replayed):
    trajectory = recorded()
    plain, fast = (replayed(trajectory, speed=speed).motion for speed in (1.0, 2.0))
    assert fast.end_ns == pytest.approx(plain.end_ns / 2, abs=1)
    t_ns = np.linspace(0, fast.end_ns, 50)
    a, b = plain.at(2 * t_ns), fast.at(t_ns)
    np.testing.assert_allclose(b.T_world_body, a.T_world_body, atol=1e-9)
    np.testing.assert_allclose(b.twist, 2 * a.twist, atol=1e-9)
    np.testing.assert_allclose(b.acceleration_mps2, 4 * a.acceleration_mps2, atol=1e-6)


@pytest.mark.parametrize("replayed", [interpolated, smoothed])
def test_a_start_moves_the_recording_and_keeps_the_vertical(replayed):
    trajectory = recorded()
    placed, plain = replayed(trajectory, start=(1, 2, 3, 0.5)).motion, replayed(trajectory).motion
    first = placed.at(np.array([0])).T_world_body[0]
    np.testing.assert_allclose([*first[:3, 3], np.arctan2(first[1, 0], first[0, 0])], [1, 2, 3, 0.5], atol=1e-12)
    t_ns = np.linspace(0, plain.end_ns, 50)
    np.testing.assert_allclose(
        placed.at(t_ns).T_world_body[:, 2, :3], plain.at(t_ns).T_world_body[:, 2, :3], atol=1e-12
    )
    np.testing.assert_allclose(placed.at(t_ns).twist, plain.at(t_ns).twist, atol=1e-12)


@pytest.mark.parametrize("form", ["camera", "kitti"])
def test_a_camera_that_looks_ahead_makes_a_body_that_drives_ahead(form):
    """The same level drive, as TUM RGB-D and as KITTI would have recorded it."""
    R_body_camera = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    t_s = np.arange(0, 3, 0.1)
    T_body = se3.transform(se3.rotation_z(np.sin(t_s)), np.stack([t_s, t_s**2 / 5, 0 * t_s], -1))
    T_camera = T_body @ se3.transform(R_body_camera, np.zeros(3))
    if form == "kitti":
        T_camera = se3.inverse(T_camera[0]) @ T_camera
    trajectory = Trajectory(np.rint(t_s * 1e9).astype(np.int64), T_camera)
    found = interpolated(trajectory, axes=AXES[form]).motion.at(trajectory.t_ns).T_world_body
    np.testing.assert_allclose(found, T_body, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"speed": 0.0}, "speed is 0; it should be a finite factor above 0"),
        ({"speed": np.nan}, "speed is nan"),
        ({"start": (0, 0, np.nan, 0)}, "start is .*; it should be four finite numbers"),
        ({"start": (0, 0, 0)}, "start is .*; it should be four finite numbers"),
        ({"knot_hz": 0.0}, "knot_hz is 0"),
    ],
)
def test_options_that_make_no_motion_are_a_sentence(options, sentence):
    with pytest.raises(MotionError, match=sentence):
        smoothed(recorded(), **options)


@pytest.mark.parametrize(("replayed", "fewest"), [(interpolated, 3), (smoothed, 12)])
def test_too_few_poses_are_a_sentence(replayed, fewest):
    trajectory = recorded()
    few = Trajectory(trajectory.t_ns[: fewest - 1], trajectory.T_world_frame[: fewest - 1])
    with pytest.raises(MotionError, match=f"needs {fewest} poses or more, but the recording has {fewest - 1}"):
        replayed(few)
    enough = Trajectory(trajectory.t_ns[:fewest], trajectory.T_world_frame[:fewest])
    assert replayed(enough).motion.end_ns > 0


@WITH_DATA
def test_freiburg1_smoothed_is_as_a_hand_moves_and_interpolated_is_not():
    trajectory = parse_tum((DATA / "freiburg1_xyz-groundtruth.txt").read_text(), name="freiburg1")
    exact, smooth = (replayed(trajectory, axes=AXES["camera"]) for replayed in (interpolated, smoothed))
    assert smooth.residual.position_rms_m < 5e-4
    assert smooth.residual.rotation_rms_rad < np.deg2rad(0.3)
    np.testing.assert_allclose(smooth.gaps_s, [(10.1698, 10.2799)], atol=1e-3)
    t_ns = between(smooth.motion)
    assert rms(exact.motion.at(t_ns).acceleration_mps2) > 5
    assert rms(smooth.motion.at(t_ns).acceleration_mps2) < 1


@WITH_DATA
def test_kitti_00_smoothed_drives_ahead_on_wheels():
    stamps_s = np.array((DATA / "KITTI_00_gt_times.txt").read_text().split(), float)
    T = parse_kitti((DATA / "KITTI_00_gt.txt").read_text(), name="kitti")
    replay = smoothed(Trajectory(np.rint(stamps_s * 1e9).astype(np.int64), T), axes=AXES["kitti"])
    assert replay.residual.position_rms_m < 0.01
    assert replay.residual.rotation_rms_rad < np.deg2rad(0.1)
    k = replay.motion.at(between(replay.motion))
    assert 7 < k.velocity_mps[:, 0].mean() < 9
    assert np.abs(k.velocity_mps[:, 1:].mean(0)).max() < 0.2
    assert rms(k.acceleration_mps2) < 2
