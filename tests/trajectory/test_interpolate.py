"""Poses between stamps, and matches that are read there."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.geometry import se3
from vobench.trajectory.associate import associate, match
from vobench.trajectory.interpolate import poses_at
from vobench.trajectory.trajectory import Trajectory

SEEDS = st.integers(0, 2**32 - 1)


def random_path(rng, n=10):
    q = rng.normal(size=(n, 4))
    R = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    return Trajectory(np.cumsum(rng.integers(1, 10**9, n)), se3.transform(R, rng.normal(size=(n, 3))))


def screw(t_ns):
    """A motion of constant speed and constant turn."""
    t_s = np.asarray(t_ns) / 1e9
    return Trajectory(t_ns, se3.transform(se3.rotation_z(0.7 * t_s), t_s[:, None] * [1.0, -2.0, 0.5]))


@given(SEEDS)
def test_at_a_stamp_is_its_pose(seed):
    path = random_path(np.random.default_rng(seed))
    np.testing.assert_allclose(poses_at(path, path.t_ns), path.T_world_frame, atol=1e-12)


@given(SEEDS)
def test_a_constant_motion_is_met_exactly(seed):
    rng = np.random.default_rng(seed)
    t_ns = np.sort(rng.choice(10**10, 50, replace=False))
    sparse = screw(np.arange(11, dtype=np.int64) * 10**9)
    np.testing.assert_allclose(poses_at(sparse, t_ns), screw(t_ns).T_world_frame, atol=1e-12)


@given(SEEDS, st.floats(0, 1))
def test_between_two_poses_the_angle_is_shared_out(seed, share):
    path = random_path(np.random.default_rng(seed), 2)
    t_ns = np.array([path.t_ns[0] + round(share * (path.t_ns[1] - path.t_ns[0]))])
    share = (t_ns[0] - path.t_ns[0]) / (path.t_ns[1] - path.t_ns[0])
    R0, R1 = path.T_world_frame[:, :3, :3]
    R = poses_at(path, t_ns)[0, :3, :3]
    assert se3.rotation_angle(R0.T @ R) == pytest.approx(share * se3.rotation_angle(R0.T @ R1), abs=1e-7)
    assert se3.rotation_angle(R.T @ R1) == pytest.approx((1 - share) * se3.rotation_angle(R0.T @ R1), abs=1e-7)


def test_before_the_first_and_after_the_last_stand_the_ends():
    path = random_path(np.random.default_rng(1))
    ends = poses_at(path, np.array([path.t_ns[0] - 10**9, path.t_ns[-1] + 10**9]))
    np.testing.assert_allclose(ends, path.T_world_frame[[0, -1]], atol=1e-12)
    one = Trajectory(path.t_ns[:1], path.T_world_frame[:1])
    np.testing.assert_allclose(poses_at(one, path.t_ns[:3]), np.repeat(one.T_world_frame, 3, 0), atol=1e-12)


@pytest.mark.parametrize("offset_ns", [0, 3_000_000])
@pytest.mark.parametrize("truth_is_denser", [True, False])
def test_interpolated_matches_of_one_motion_are_the_same_pose(truth_is_denser, offset_ns):
    dense, sparse = screw(np.arange(1001) * 10_000_000), screw(np.arange(301) * 33_333_333)
    gt, est = (dense, sparse) if truth_is_denser else (sparse, dense)
    late = Trajectory(est.t_ns - offset_ns, est.T_world_frame)
    found = match(gt, late, method="interpolate", offset_ns=offset_ns)
    np.testing.assert_allclose(found.T_est, found.T_gt, atol=1e-12)
    nearest = match(gt, late, method="nearest", offset_ns=offset_ns)
    assert len(found) == len(nearest)
    assert np.abs(nearest.T_est - nearest.T_gt).max() > 1e-3
    assert found.pairs.gt.tolist() == associate(gt.t_ns, est.t_ns, method="evo").gt.tolist()


def test_a_match_is_on_the_truths_clock():
    gt, est = screw(np.arange(100) * 10**7), screw(np.arange(30) * 33_000_000 + 10**9)
    nearest = match(gt, est, offset_ns=-(10**9))
    np.testing.assert_array_equal(nearest.t_ns, gt.t_ns[nearest.pairs.gt])
    between = match(gt, est, method="interpolate", offset_ns=-(10**9))
    np.testing.assert_array_equal(between.t_ns, est.t_ns[between.pairs.est] - 10**9)
