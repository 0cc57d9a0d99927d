"""The oracle: its noise has the stated level about the true poses, and its covariance is that of its noise."""

import numpy as np
import pytest

from vobench.estimator.oracle import NoisyTruth
from vobench.estimator.program import EstimatorFailure
from vobench.estimator.protocol import Frame, Status
from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory

N = 1500
PARAMS = {"position_m": 0.02, "rotation_rad": 0.01, "stated": 1.0}
T_NS = np.arange(N, dtype=np.int64)
WORLD = np.stack([se3.transform(se3.rotation_z(0.01 * n), [n * 0.1, 1.0, 2.0]) for n in range(N)])


def answers(seed=0, **params):
    with NoisyTruth(Trajectory(T_NS, WORLD)) as oracle:
        oracle.start(None, {**PARAMS, **params}, seed)
        return [oracle.process(Frame(n, n)).result for n in range(N)]


def errors(results) -> np.ndarray:
    """Position errors and rotation vectors (N, 6) about the axes of odom."""
    T_odom_true = se3.inverse(WORLD[0]) @ WORLD
    rows = []
    for result, T in zip(results, T_odom_true, strict=True):
        R = result.T_odom_frame[:3, :3] @ T[:3, :3].T
        turn = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2  # small angles
        rows.append(np.r_[result.T_odom_frame[:3, 3] - T[:3, 3], turn])
    return np.array(rows)


def test_the_noise_has_its_deviations_in_every_axis_and_no_mean():
    noise = errors(answers())
    np.testing.assert_allclose(noise.std(axis=0), [0.02] * 3 + [0.01] * 3, rtol=0.08)
    np.testing.assert_allclose(noise.mean(axis=0) / noise.std(axis=0), 0, atol=4 / np.sqrt(N))
    correlations = np.corrcoef(noise.T) - np.eye(6)
    assert np.abs(correlations).max() < 5 / np.sqrt(N)


def test_the_stated_covariance_is_that_of_the_noise_times_the_stated_factor():
    for stated in (1.0, 4.0, 0.25):
        covariance = answers(stated=stated)[0].covariance
        np.testing.assert_allclose(covariance, stated * np.diag([4e-4] * 3 + [1e-4] * 3), rtol=1e-12)


def test_a_large_rotation_is_exactly_that_of_its_vector():
    results = answers(rotation_rad=1.0)
    assert all(se3.is_rotation(result.T_odom_frame[:3, :3], tolerance=1e-9) for result in results)
    angles = [
        se3.rotation_angle(r.T_odom_frame[:3, :3] @ (se3.inverse(WORLD[0]) @ T)[:3, :3].T)
        for r, T in zip(results, WORLD, strict=True)
    ]
    assert np.median(angles) == pytest.approx(1.54, abs=0.1)  # of a normal vector in space


def test_equal_seeds_draw_equal_noise_and_others_other_noise():
    once, again, other = answers(1), answers(1), answers(2)
    assert all((a.T_odom_frame == b.T_odom_frame).all() for a, b in zip(once, again, strict=True))
    assert not np.allclose(once[0].T_odom_frame, other[0].T_odom_frame)


def test_a_frame_without_truth_is_lost():
    with NoisyTruth(Trajectory(T_NS, WORLD)) as oracle:
        oracle.start(None, PARAMS, 0)
        answer = oracle.process(Frame(0, N + 5))
        assert (answer.result.status, answer.result.reason) == (Status.LOST, "no truth")
        assert (answer.wall_ms, answer.cpu_ms, oracle.finish()) == (0.0, 0.0, {})


@pytest.mark.parametrize("name", list(PARAMS))
@pytest.mark.parametrize("value", [0.0, -1.0])
def test_a_level_that_is_not_positive_is_refused(name, value):
    with pytest.raises(EstimatorFailure, match="refused: position_m, rotation_rad and stated should be more than 0"):
        NoisyTruth(Trajectory(T_NS, WORLD)).start(None, {**PARAMS, name: value}, 0)
