"""Replayed recordings: near the recorded poses, with accelerations that a body could have."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.errors import MotionError, SettingError
from vobench.geometry import se3
from vobench.motion.replay import AXES, Replay
from vobench.motion.spline import pose_spline
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import parse_tum

DATA = Path(__file__).parents[2] / ".." / "shared" / "data" / "trajectories"
WITH_DATA = pytest.mark.skipif(not DATA.is_dir(), reason="no folder ../shared/data with real trajectories")
NOISE_M, NOISE_RAD = 1e-4, 1e-3


def interpolated(trajectory, **keys):
    return Replay(file="", exact=True, **keys).motion(trajectory)


def smoothed(trajectory, **keys):
    return Replay(file="", **keys).motion(trajectory)


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


def left_over(motion, trajectory):
    """How far the motion is from the recorded poses, RMS in m and in rad."""
    off = se3.inverse(motion.at(trajectory.t_ns - trajectory.t_ns[0]).T_world_body) @ trajectory.T_world_frame
    return rms(off[:, :3, 3]), rms(Rotation.from_matrix(off[:, :3, :3]).as_rotvec())


def between(motion):
    return np.linspace(motion.start_ns + 5e8, motion.end_ns - 5e8, 3000)


def test_interpolated_passes_through_every_pose():
    trajectory = recorded(30, noise=1.0)
    replay = interpolated(trajectory)
    found = replay.at(trajectory.t_ns - trajectory.t_ns[0]).T_world_body
    np.testing.assert_allclose(found, trajectory.T_world_frame, atol=1e-9)


def test_smoothed_gives_back_a_smooth_motion():
    motion, replay = carried(), smoothed(recorded())
    truth, found = motion.at(between(motion)), replay.at(between(motion))
    np.testing.assert_allclose(found.T_world_body, truth.T_world_body, atol=1e-4)
    np.testing.assert_allclose(found.acceleration_mps2, truth.acceleration_mps2, atol=5e-3)
    np.testing.assert_allclose(found.angular_velocity_radps, truth.angular_velocity_radps, atol=5e-3)


def test_of_a_noisy_recording_smoothing_leaves_a_tenth_of_the_false_acceleration():
    motion, trajectory = carried(), recorded(noise=1.0)
    t_ns = between(motion)
    truth = motion.at(t_ns)
    exact, smooth = (replay(trajectory).at(t_ns) for replay in (interpolated, smoothed))
    false = [rms(k.acceleration_mps2 - truth.acceleration_mps2) for k in (exact, smooth)]
    assert false[0] > 1  # which is why interpolation is for cameras only
    assert false[1] < 0.1 * false[0]
    assert rms(smooth.angular_velocity_radps - truth.angular_velocity_radps) < 0.2 * rms(
        exact.angular_velocity_radps - truth.angular_velocity_radps
    )


def test_what_smoothing_leaves_of_a_recording_is_its_noise():
    trajectory = recorded(noise=1.0)
    off_m, off_rad = left_over(smoothed(trajectory), trajectory)
    assert 0.85 * NOISE_M * np.sqrt(3) < off_m < NOISE_M * np.sqrt(3)
    assert 0.85 * NOISE_RAD * np.sqrt(3) < off_rad < NOISE_RAD * np.sqrt(3)


def test_more_knots_follow_the_recording_more_closely():
    trajectory = recorded(noise=1.0)
    loose, close = (left_over(smoothed(trajectory, knot_hz=hz), trajectory)[0] for hz in (5, 30))
    assert close < loose


def test_slow_recordings_get_fewer_knots_than_asked_for():
    trajectory = recorded(5)
    assert left_over(smoothed(trajectory, knot_hz=100), trajectory)[0] < 0.05


def test_a_recording_that_ends_where_a_knot_would_be_is_smoothed_like_any_other():
    trajectory = recorded()
    whole = Trajectory(trajectory.t_ns[:201], trajectory.T_world_frame[:201])
    assert left_over(smoothed(whole), whole)[0] < 1e-4


def test_a_hole_is_bridged():
    trajectory = recorded(noise=1.0, without=lambda t_s: (t_s > 4) & (t_s < 4.6))
    replay = smoothed(trajectory)
    t_ns = np.linspace(4e9, 4.6e9, 50)
    off_m = np.linalg.norm(replay.at(t_ns).T_world_body[:, :3, 3] - carried().at(t_ns).T_world_body[:, :3, 3], axis=1)
    assert off_m.max() < 0.002
    for replayed in (interpolated, smoothed):
        with pytest.raises(MotionError, match=r"no pose from 4\.000 s to 4\.600 s after its start"):
            replayed(trajectory, max_gap_s=0.5)


def test_the_order_of_quaternion_signs_does_not_matter():
    t_s = np.arange(0, 11, 0.02)
    spinning = Trajectory(np.rint(t_s * 1e9).astype(np.int64), se3.transform(se3.rotation_z(2 * t_s), np.zeros(3)))
    k = smoothed(spinning).at(np.linspace(0, 10e9, 500))
    np.testing.assert_allclose(k.angular_velocity_radps, np.broadcast_to([0, 0, 2], (500, 3)), atol=1e-4)


@pytest.mark.parametrize("replayed", [interpolated, smoothed])
def test_twice_the_speed_is_half_the_time_on_the_same_way(replayed):
    trajectory = recorded()
    plain, fast = (replayed(trajectory, speed=speed) for speed in (1.0, 2.0))
    assert fast.end_ns == pytest.approx(plain.end_ns / 2, abs=1)
    t_ns = np.linspace(0, fast.end_ns, 50)
    a, b = plain.at(2 * t_ns), fast.at(t_ns)
    np.testing.assert_allclose(b.T_world_body, a.T_world_body, atol=1e-9)
    np.testing.assert_allclose(b.twist, 2 * a.twist, atol=1e-9)
    np.testing.assert_allclose(b.acceleration_mps2, 4 * a.acceleration_mps2, atol=1e-6)


@pytest.mark.parametrize("replayed", [interpolated, smoothed])
def test_a_start_moves_the_recording_and_keeps_the_vertical(replayed):
    trajectory = recorded()
    placed, plain = replayed(trajectory, start_m=(1, 2, 3), start_heading_deg=np.rad2deg(0.5)), replayed(trajectory)
    first = placed.at(np.array([0])).T_world_body[0]
    np.testing.assert_allclose([*first[:3, 3], np.arctan2(first[1, 0], first[0, 0])], [1, 2, 3, 0.5], atol=1e-12)
    t_ns = np.linspace(0, plain.end_ns, 50)
    np.testing.assert_allclose(
        placed.at(t_ns).T_world_body[:, 2, :3], plain.at(t_ns).T_world_body[:, 2, :3], atol=1e-12
    )
    np.testing.assert_allclose(placed.at(t_ns).twist, plain.at(t_ns).twist, atol=1e-12)


AHEAD, LEFT, UP = np.eye(3)
# Each convention's axes in ours, and whether its world is turned like its body.
CONVENTIONS = {
    "body": ([AHEAD, LEFT, UP], False),
    "camera": ([-LEFT, -UP, AHEAD], False),
    "kitti": ([-LEFT, -UP, AHEAD], True),
    "euroc": ([UP, -LEFT, AHEAD], False),
    "tartanair": ([AHEAD, -LEFT, -UP], True),
}


@pytest.mark.parametrize("name", AXES)
def test_a_level_drive_in_any_convention_of_axes_is_the_drive_of_the_body(name):
    axes, turns_world = CONVENTIONS[name]
    t_s = np.arange(0, 3, 0.1)
    T_body = se3.transform(se3.rotation_z(np.sin(t_s)), np.stack([t_s, t_s**2 / 5, 0 * t_s], -1))
    T_body_sensor = se3.transform(np.stack(axes, -1), np.zeros(3))
    T = T_body @ T_body_sensor
    T = se3.inverse(T_body_sensor) @ T if turns_world else T
    np.testing.assert_allclose(AXES[name].apply(T) if AXES[name] else T, T_body, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"speed": 0.0}, "speed: should be 0.01 or more"),
        ({"speed": np.nan}, "speed: should be a finite number"),
        ({"start_m": (0, 0, np.nan)}, r"start_m\.2: should be a finite number"),
        ({"start_m": (0, 0)}, r"start_m\.2: this key is missing"),
        ({"knot_hz": 0.0}, "knot_hz: should be greater than 0"),
    ],
)
def test_options_that_make_no_motion_are_a_sentence(options, sentence):
    with pytest.raises(SettingError, match=sentence):
        Replay(file="", **options)


@pytest.mark.parametrize(("replayed", "fewest"), [(interpolated, 3), (smoothed, 12)])
def test_too_few_poses_are_a_sentence(replayed, fewest):
    trajectory = recorded()
    few = Trajectory(trajectory.t_ns[: fewest - 1], trajectory.T_world_frame[: fewest - 1])
    with pytest.raises(MotionError, match=f"needs {fewest} poses or more, but the recording has {fewest - 1}"):
        replayed(few)
    enough = Trajectory(trajectory.t_ns[:fewest], trajectory.T_world_frame[:fewest])
    assert replayed(enough).end_ns > 0


@WITH_DATA
def test_freiburg1_smoothed_is_as_a_hand_moves_and_interpolated_is_not():
    trajectory = parse_tum((DATA / "freiburg1_xyz-groundtruth.txt").read_text(), name="freiburg1")
    body = Trajectory(trajectory.t_ns, AXES["camera"].apply(trajectory.T_world_frame))
    exact, smooth = interpolated(body), smoothed(body)
    off_m, off_rad = left_over(smooth, body)
    assert off_m < 5e-4
    assert off_rad < np.deg2rad(0.3)
    t_ns = between(smooth)
    assert rms(exact.at(t_ns).acceleration_mps2) > 5
    assert rms(smooth.at(t_ns).acceleration_mps2) < 1


@WITH_DATA
def test_kitti_00_smoothed_drives_ahead_on_wheels():
    stamps_s = np.array((DATA / "KITTI_00_gt_times.txt").read_text().split(), float)
    T = parse_any((DATA / "KITTI_00_gt.txt").read_text(), name="kitti").T
    body = Trajectory(np.rint(stamps_s * 1e9).astype(np.int64), AXES["kitti"].apply(T))
    replay = smoothed(body)
    off_m, off_rad = left_over(replay, body)
    assert off_m < 0.01
    assert off_rad < np.deg2rad(0.1)
    k = replay.at(between(replay))
    assert 7 < k.velocity_mps[:, 0].mean() < 9
    assert np.abs(k.velocity_mps[:, 1:].mean(0)).max() < 0.2
    assert rms(k.acceleration_mps2) < 2
