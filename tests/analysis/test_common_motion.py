"""Short motions of one drive agree at the same time only; those of two drives agree no better than at other times."""

import numpy as np
import pytest

from vobench.analysis.common_motion import motion_disagreement
from vobench.analysis.diagnose import diagnose
from vobench.geometry import se3
from vobench.runner.trajectory_pair import TrajectoryReading
from vobench.trajectory.trajectory import Trajectory

STEP_S = 0.1
PAIRS = 30


def drive(rng, poses=400, *, winds=True):
    """The poses of a car that turns at crossings, or sways on a straight road, at a speed that changes."""
    speed_mps = np.clip(10 * np.exp(np.cumsum(rng.normal(0, 0.02, poses))), 1, 25)
    turn_radps = np.deg2rad(0.5) * np.sin(np.linspace(0, 6, poses))
    begin = int(rng.uniform(30, 100))
    while winds and begin < poses:
        length = int(rng.uniform(20, 45))
        angle_rad = rng.choice([-1, 1]) * np.pi / 2 * rng.uniform(0.3, 1.1)
        turn_radps[begin : begin + length] += angle_rad / (length * STEP_S)
        begin += length + int(rng.uniform(40, 120))
    heading_rad = np.cumsum(turn_radps) * STEP_S
    velocity = speed_mps[:, None] * np.stack([np.cos(heading_rad), np.sin(heading_rad), 0 * heading_rad], -1)
    return se3.transform(se3.rotation_z(heading_rad), np.cumsum(velocity, axis=0) * STEP_S)


def odometry(rng, T, *, turn_rad=0.001, step_m=0.01, scale=1.0):
    """The poses that odometry with these errors in each step estimates of a drive."""
    motions = se3.inverse(T[:-1]) @ T[1:]
    motions[:, :3, 3] = scale * motions[:, :3, 3] + rng.normal(0, step_m, (len(motions), 3))
    errors = se3.transform(se3.rotation_z(rng.normal(0, turn_rad, len(motions))), np.zeros((len(motions), 3)))
    poses = [np.eye(4)]
    for motion in motions @ errors:
        poses.append(poses[-1] @ motion)
    return np.array(poses)


def faults(T_gt, T_est):
    t_ns = np.arange(len(T_gt)) * 10**8
    return [
        found.fault
        for found in diagnose(TrajectoryReading(Trajectory(t_ns, T_gt)), TrajectoryReading(Trajectory(t_ns, T_est)))
    ]


def test_the_same_motion_agrees_whatever_its_scale_and_world():
    rng = np.random.default_rng(0)
    T = drive(rng)
    moved = se3.transform(se3.rotation_z(1.0), [3.0, 4.0, 5.0]) @ T
    moved[:, :3, 3] *= 0.2
    assert motion_disagreement(T, moved) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("winds", [True, False])
def test_noisy_odometry_disagrees_far_less_than_that_of_another_drive(winds):
    rng = np.random.default_rng(1)
    related = []
    unrelated = []
    for _ in range(PAIRS):
        T = drive(rng, winds=winds)
        related.append(motion_disagreement(T, odometry(rng, T, turn_rad=0.01, step_m=0.05, scale=1.1)))
        unrelated.append(motion_disagreement(T, odometry(rng, drive(rng, winds=winds))))
    assert max(related) <= 0.1
    assert min(unrelated) > max(related)


def test_too_few_poses_tell_nothing():
    T = drive(np.random.default_rng(2))[:15]
    assert motion_disagreement(T, T) is None


@pytest.mark.slow
def test_of_thirty_unrelated_pairs_of_drives_at_least_28_are_named_and_none_of_thirty_clean_ones():
    rng = np.random.default_rng(3)
    clean = []
    unrelated = []
    for _ in range(PAIRS):
        T = drive(rng)
        clean += faults(T, odometry(rng, T))
        unrelated.append(faults(T, odometry(rng, drive(rng))))
    assert clean == []
    assert unrelated.count(["unrelated"]) >= 28


@pytest.mark.slow
def test_a_straight_road_shows_no_other_frame_though_its_positions_hardly_fix_the_roll():
    rng = np.random.default_rng(4)
    for _ in range(PAIRS):
        T = drive(rng, winds=False)
        T[:, 2, 3] += np.cumsum(rng.normal(0, 0.002, len(T)))
        assert faults(T, odometry(rng, T)) == []
