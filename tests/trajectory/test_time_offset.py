"""The offset of a clock: found whatever the frames and scale, and refused where nothing moves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.trajectory.time_offset import estimate_offset
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
