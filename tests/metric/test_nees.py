"""Consistency: honest covariances give the degrees of freedom, others don't, and frames don't matter."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.errors import AlignmentError, TrajectoryError
from vobench.geometry import se3
from vobench.metric.nees import METRICS, consistency, independent_samples, median_interval, rotation_vector
from vobench.metric.score import ScoreSettings, score
from vobench.trajectory.align import Alignment
from vobench.trajectory.trajectory import Trajectory

N = 4000
STAY = Alignment("none", np.eye(3), np.zeros(3), 1.0, ())


def case(rng, factor=1.0):
    """Poses with errors drawn from covariances, each its own, and the covariances times a factor."""
    roots = rng.normal(size=(N, 6, 6)) * 0.02
    P = roots @ np.swapaxes(roots, 1, 2) + 1e-5 * np.eye(6)
    e = (np.linalg.cholesky(P) @ rng.normal(size=(N, 6, 1)))[..., 0]
    T_est = se3.transform(Rotation.random(N, random_state=rng).as_matrix(), rng.normal(size=(N, 3)))
    R_gt = Rotation.from_rotvec(e[:, 3:]).as_matrix() @ T_est[:, :3, :3]
    return se3.transform(R_gt, T_est[:, :3, 3] + e[:, :3]), T_est, factor * P


@pytest.mark.parametrize("factor", [1.0, 4.0, 0.25])
def test_honest_covariances_average_to_their_degrees_of_freedom(factor):
    T_gt, T_est, P = case(np.random.default_rng(1), factor)
    found = consistency(T_gt, T_est, P, STAY)
    means = [e.mean() * factor for e in (found.pose, found.trans, found.rot)]
    assert means == pytest.approx([6, 3, 3], rel=0.05)


def test_an_alignment_of_the_estimates_world_turns_its_covariances_too():
    rng = np.random.default_rng(2)
    T_gt, T_est, P = case(rng)
    R, t, scale = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3), 2.5
    moved = se3.transform(R.T @ T_est[:, :3, :3], (T_est[:, :3, 3] - t) @ R / scale)
    turn_back = np.kron(np.diag([1 / scale, 1.0]), R.T)
    there = consistency(T_gt, moved, turn_back @ P @ turn_back.T, Alignment("sim3", R, t, scale, ()))
    here = consistency(T_gt, T_est, P, STAY)
    np.testing.assert_allclose(there.pose, here.pose, rtol=1e-7)
    np.testing.assert_allclose(there.rot, here.rot, rtol=1e-7)


def test_rotation_vectors_are_scipys_up_to_half_a_turn():
    rng = np.random.default_rng(3)
    axis = rng.normal(size=(50, 3))
    vectors = (
        axis
        / np.linalg.norm(axis, axis=1, keepdims=True)
        * np.r_[0, 1e-15, 1e-9, np.pi - 1e-9, np.linspace(0.1, 3, 46)][:, None]
    )
    np.testing.assert_allclose(rotation_vector(Rotation.from_rotvec(vectors).as_matrix()), vectors, atol=2e-8)


@pytest.mark.parametrize("bad", [np.zeros((6, 6)), np.diag([1, 1, 1, 1, 1, -1.0]), np.full((6, 6), np.nan)])
def test_what_is_no_covariance_is_refused(bad):
    T_gt, T_est, P = case(np.random.default_rng(4))
    P[0] = bad
    with pytest.raises(TrajectoryError, match="covariance 0 should be finite and positive definite"):
        consistency(T_gt, T_est, P, STAY)


def test_a_score_has_it_where_the_estimate_states_covariances():
    T_gt, T_est, P = case(np.random.default_rng(5))
    t_ns = np.arange(N) * 10**8
    gt, est = Trajectory(t_ns, T_gt), Trajectory(t_ns, T_est)
    result = score(gt, est, settings=ScoreSettings(alignment="none"), covariance=P)
    assert result.metric("nees_pose").statistics.mean == pytest.approx(6, rel=0.05)
    assert score(gt, est).metric("nees_pose") is None
    with pytest.raises(AlignmentError, match=r"covariance should be \(4000, 6, 6\)"):
        score(gt, est, covariance=P[:5])


def test_covariances_in_space_are_not_compared_in_a_plane():
    t_ns = np.arange(5, dtype=np.int64) * 10**8
    T = se3.transform(np.eye(3), np.arange(15.0).reshape(5, 3) ** 2)
    truth = Trajectory(t_ns, T)
    with pytest.raises(AlignmentError, match="covariances need poses in space, but the setting project is xy"):
        score(truth, truth, settings=ScoreSettings(project="xy"), covariance=np.tile(np.eye(6), (5, 1, 1)))


def test_each_definition_states_the_degrees_of_freedom_of_its_part():
    stated = {metric.id: metric.blind.split()[-3] for metric in METRICS}
    assert stated == {"nees_pose": "6", "nees_trans": "3", "nees_rot": "3"}
    assert {metric.unit for metric in METRICS} == {"1"}
    assert {metric.headline for metric in METRICS} == {"mean"}


def test_a_position_error_of_one_standard_deviation_counts_one():
    T = se3.transform(np.eye(3), [[0.0, 0, 0]])
    T_est = se3.transform(np.eye(3), [[0.2, 0, 0]])
    P = np.diag([0.2**2, 1, 1, 1, 1, 1])[None]
    result = consistency(T, T_est, P, STAY)
    np.testing.assert_allclose([result.pose[0], result.trans[0], result.rot[0]], [1.0, 1.0, 0.0])


def test_an_alignment_with_scale_scales_the_covariance_of_positions_alone():
    alignment = Alignment("sim3", np.eye(3), np.zeros(3), 3.0, ())
    R = Rotation.from_rotvec([[0.1, 0, 0]]).as_matrix()
    T_gt = se3.transform(R, [[3.0 + 0.6, 0, 0]])
    T_est = se3.transform(np.eye(3), [[1.0, 0, 0]])
    P = np.diag([0.2**2, 1, 1, 0.1**2, 1, 1])[None]
    result = consistency(T_gt, T_est, P, alignment)
    np.testing.assert_allclose([result.trans[0], result.rot[0], result.pose[0]], [1.0, 1.0, 2.0])


@pytest.mark.parametrize("angle", [0.0, 1e-13, 1e-6, 1.0, 3.1])
def test_a_rotation_vector_is_axis_times_angle(angle):
    axis = np.array([1.0, -2.0, 2.0]) / 3
    R = Rotation.from_rotvec(angle * axis).as_matrix()
    np.testing.assert_allclose(rotation_vector(R), angle * axis, atol=1e-15, rtol=1e-9)


def test_independent_errors_count_nearly_all_and_correlated_ones_few():
    rng = np.random.default_rng(0)
    independent = rng.chisquare(6, 400)
    assert independent_samples(independent) == pytest.approx(400, rel=0.1)
    walk = np.cumsum(rng.standard_normal((400, 6)), axis=0)
    assert independent_samples(np.sum(walk**2, axis=1)) < 5
    assert independent_samples(np.full(9, 3.0)) == 1


@pytest.mark.parametrize("samples", [1, 5, 31])
def test_the_median_of_consistent_errors_is_in_its_interval_in_95_of_100_cases(samples):
    low, high = median_interval(samples, 6)
    medians = np.median(np.random.default_rng(samples).chisquare(6, (4000, samples)), axis=1)
    assert np.mean((low <= medians) & (medians <= high)) == pytest.approx(0.95, abs=0.012)
