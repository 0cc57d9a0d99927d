"""The offset of a clock: found whatever the frames and scale, and refused where nothing moves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.trajectory.time_offset import estimate_offset, motion_correlation, offsets_in_stretches, speeds
from vobench.trajectory.trajectory import Trajectory


def wander(t_ns, seed=3):
    """A motion whose speeds of turning and moving never repeat."""
    rng = np.random.default_rng(seed)
    t_s = np.asarray(t_ns) / 1e9
    waves = [
        np.sin(2 * np.pi * rng.uniform(0.05, 0.7, 8)[:, None] * t_s + rng.uniform(0, 6, 8)[:, None]) for _ in range(4)
    ]
    x, y, z, yaw = (wave.sum(0) for wave in waves)
    return Trajectory(t_ns, se3.transform(se3.rotation_z(yaw), np.stack([x, y, z], -1)))


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 1000), st.integers(-(10**10), 10**10), st.floats(0.1, 10))
def test_the_offset_is_found_in_any_frame_and_at_any_scale(seed, offset_ns, scale):
    rng = np.random.default_rng(seed)
    truth = wander(np.arange(3000) * 10_000_000)
    est = wander(np.arange(100, 2900, 3) * 10_000_000 // 1)
    q = rng.normal(size=4)
    T_other = se3.transform(se3.from_quaternion(q / np.linalg.norm(q)), rng.normal(size=3))
    moved = T_other @ se3.transform(est.T_world_frame[:, :3, :3], scale * est.positions_m)
    found = estimate_offset(truth, Trajectory(est.t_ns - offset_ns, moved))
    assert found.offset_ns == pytest.approx(offset_ns, abs=1_000_000)
    assert found.correlation > 0.99


def test_clocks_of_different_epochs_are_brought_together():
    truth = wander(np.arange(2000) * 10_000_000)
    epoch_ns = 1_305_031_102 * 10**9
    found = estimate_offset(Trajectory(truth.t_ns + epoch_ns, truth.T_world_frame), truth)
    assert found.offset_ns == pytest.approx(epoch_ns, abs=1_000_000)


@pytest.mark.parametrize(
    ("n", "step_m", "message"),
    [
        (1, 0.0, "two poses or more"),
        (10, 0.1, "25 to"),
        (100, 0.0, "no correlated motion"),
        (100, 0.1, "no correlated motion"),
    ],
)
def test_too_short_or_without_a_change_of_speed_there_is_no_offset(n, step_m, message):
    T = se3.transform(np.eye(3), np.arange(n)[:, None] * [step_m, 0.0, 0.0])
    path = Trajectory(np.arange(n) * 10**8, T)
    with pytest.raises(AlignmentError, match=message):
        estimate_offset(path, path)


def test_25_steps_are_enough_and_24_are_not():
    stamps = np.arange(26) * 10**8
    assert estimate_offset(wander(stamps), wander(stamps)).offset_ns == pytest.approx(0, abs=1_000_000)
    with pytest.raises(AlignmentError, match="have 24 and 24"):
        estimate_offset(wander(stamps[:-1]), wander(stamps[:-1]))


def test_a_hole_after_the_first_pose_moves_no_clock():
    stamps = np.arange(3000) * 10_000_000
    truth, est = wander(np.r_[stamps[:1], stamps[300:]]), wander(stamps[400:2900:3])
    found = estimate_offset(truth, Trajectory(est.t_ns - 2 * 10**9, est.T_world_frame))
    assert found.offset_ns == pytest.approx(2 * 10**9, abs=1_000_000)


def test_that_both_stand_still_is_no_likeness():
    """One moves, then stands; the other stands, then moves: where both stand, correlation has no meaning."""
    stamps = np.arange(3000) * 10_000_000
    first, second = wander(stamps, seed=1).T_world_frame, wander(stamps, seed=2).T_world_frame
    stops, starts = first[np.minimum(np.arange(3000), 900)], second[np.maximum(np.arange(3000), 2100)]
    with pytest.raises(AlignmentError, match="no correlated motion"):
        estimate_offset(Trajectory(stamps, stops), Trajectory(stamps, starts))


def test_too_few_steps_are_named_with_their_duration():
    stamps = np.arange(25) * 10**8
    with pytest.raises(AlignmentError) as error:
        estimate_offset(wander(stamps), wander(stamps))
    assert str(error.value) == (
        "a time offset needs 25 to 2000000 steps of 0.1 s on either side, but the recordings have 24 and 24"
    )


def test_one_pose_has_no_step():
    stamps = np.arange(100) * 10**8
    with pytest.raises(AlignmentError, match="needs two poses or more, got 1"):
        estimate_offset(wander(stamps), wander(stamps[:1]))


def test_speeds_are_the_angle_turned_and_the_distance_moved_within_the_window():
    t_ns = np.arange(50) * 10**8
    t_s = t_ns / 1e9
    steady = Trajectory(t_ns, se3.transform(se3.rotation_z(0.3 * t_s), np.stack([2 * t_s, 0 * t_s, t_s], -1)))
    turned_rad, moved_m = speeds(steady, np.array([0, 10**9, 123_456_789]), 5 * 10**8)
    np.testing.assert_allclose(turned_rad, 0.15)
    np.testing.assert_allclose(moved_m, np.sqrt(5) * 0.5)


def test_speeds_count_a_turn_about_any_axis_relative_to_the_body():
    t_ns = np.arange(20) * 10**8
    about_z = se3.rotation_z(0.2 * np.arange(20))
    tilted = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    plain = Trajectory(t_ns, se3.transform(about_z, np.zeros((20, 3))))
    other = Trajectory(t_ns, se3.transform(tilted @ about_z @ tilted.T, np.zeros((20, 3))))
    starts = t_ns[:10]
    np.testing.assert_allclose(speeds(plain, starts, 10**8)[0], speeds(other, starts, 10**8)[0])
    np.testing.assert_allclose(speeds(other, starts, 10**8)[0], 0.2)


def test_a_motion_correlates_fully_with_itself_and_less_with_itself_shifted():
    truth = wander(np.arange(600) * 50_000_000)
    own = motion_correlation(truth, truth, 0)
    assert own == pytest.approx(1.0)
    assert motion_correlation(truth, truth, 300_000_000) < 0.9
    assert motion_correlation(truth, truth, 300_000_000) < motion_correlation(truth, truth, 100_000_000) < own


def test_a_motion_of_constant_speed_has_no_likeness():
    t_ns = np.arange(100) * 10**8
    straight = Trajectory(t_ns, se3.transform(np.eye(3), np.arange(100)[:, None] * [0.1, 0, 0]))
    assert motion_correlation(straight, straight, 0) is None


def test_recordings_that_do_not_overlap_have_no_likeness():
    truth = wander(np.arange(100) * 10**8)
    assert motion_correlation(truth, truth, 100 * 10**8) is None


def test_a_motion_that_never_turns_is_compared_by_its_speed_alone():
    t_ns = np.arange(400) * 50_000_000
    x_m = np.cumsum(0.05 + 0.03 * np.sin(np.arange(400) ** 1.2 / 9))
    truth = Trajectory(t_ns, se3.transform(np.eye(3), x_m[:, None] * [1.0, 0, 0]))
    est = Trajectory(t_ns - 700_000_000, truth.T_world_frame)
    assert estimate_offset(truth, est).offset_ns == 700_000_000
    assert estimate_offset(truth, est).correlation == pytest.approx(1.0)


def test_every_stretch_of_a_clock_that_jumps_shows_its_own_offset():
    truth = wander(np.arange(4000) * 20_000_000)
    jump_ns = 120_000_000
    t_ns = truth.t_ns[100:3900].copy()
    t_ns[1900:] -= jump_ns
    keep = np.concatenate([[True], np.diff(t_ns) > 0])
    t_ns = np.maximum.accumulate(t_ns)
    rows = np.flatnonzero(np.concatenate([[True], np.diff(t_ns) > 0]) & keep)
    est = Trajectory(t_ns[rows], truth.T_world_frame[100:3900][rows])
    offsets_ns = offsets_in_stretches(truth, est, within_ns=300_000_000)
    assert len(offsets_ns) == 8
    np.testing.assert_allclose(offsets_ns[:3], 0, atol=2_000_000)
    np.testing.assert_allclose(offsets_ns[5:], jump_ns, atol=2_000_000)


def test_a_stretch_too_short_to_tell_shows_no_offset():
    truth = wander(np.arange(40) * 10**8)
    assert offsets_in_stretches(truth, truth, within_ns=10**8).tolist() == [0.0] * 8


def test_stamps_of_one_clock_make_the_offset_exact_and_others_round_it_to_a_tenth_of_a_millisecond():
    truth = wander(np.arange(2000) * 20_000_000)
    exact = Trajectory(truth.t_ns[100:1900] - 1_234_567_891, truth.T_world_frame[100:1900])
    assert estimate_offset(truth, exact).offset_ns == 1_234_567_891

    rng = np.random.default_rng(5)
    jittered = truth.t_ns[100:1900] + rng.integers(-9_000_000, 9_000_000, 1800)
    est = Trajectory(jittered - 1_234_567_891, wander(jittered).T_world_frame)
    offset_ns = estimate_offset(truth, est).offset_ns
    assert offset_ns % 100_000 == 0
    assert offset_ns == pytest.approx(1_234_567_891, abs=2_000_000)
