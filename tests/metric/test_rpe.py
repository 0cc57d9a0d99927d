"""Relative pose errors of known motions, and those of TUM's script."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.metric import blockwise
from vobench.metric.motion_error import errors_between
from vobench.metric.pose_pairs import select_pairs
from vobench.metric.rpe import distance_errors, relative_matrix_errors, tum_errors
from vobench.metric.score import score
from vobench.metric.settings import ScoreSettings
from vobench.trajectory.trajectory import Trajectory


def straight(n, step_m=0.1):
    return se3.transform(np.eye(3), np.arange(n)[:, None] * [step_m, 0.0, 0.0])


def frames_apart(T, delta, *, all_pairs=True):
    return select_pairs(T, np.arange(len(T)) * 10**8, delta=delta, unit="f", all_pairs=all_pairs)


def test_an_error_made_while_lost_is_counted():
    T_gt = straight(20)
    frames = np.r_[0:5, 15:20]
    T_est = T_gt[frames].copy()
    T_est[5:, 0, 3] -= 1.0  # stood still for the ten lost frames
    errors = errors_between(T_gt[frames], T_est, *frames_apart(T_est, 1))
    np.testing.assert_allclose(errors.trans_m, [0, 0, 0, 0, 1.0, 0, 0, 0, 0], atol=1e-12)


@pytest.mark.parametrize("all_pairs", [False, True])
def test_a_drift_of_one_percent_is_one_percent_of_each_step(all_pairs):
    T_gt, T_est = straight(20), straight(20, step_m=0.101)
    for delta in (1, 5):
        pairs = frames_apart(T_gt, delta, all_pairs=all_pairs)
        assert len(pairs[0]) == (20 - delta if all_pairs else 19 // delta)
        errors = errors_between(T_gt, T_est, *pairs)
        np.testing.assert_allclose(errors.trans_m, 0.001 * delta, atol=1e-12)
        point_m, percent = distance_errors(T_gt, T_est, pairs)
        np.testing.assert_allclose(point_m, 0.001 * delta, atol=1e-12)
        np.testing.assert_allclose(percent, 1.0, rtol=1e-9)


def test_each_relative_metric_is_the_error_that_it_is_called_by():
    T_gt, T_est = straight(20), straight(20, step_m=0.101)
    T_est[:, :3, :3] = se3.rotation_z(0.3 * np.arange(20))
    t_ns = np.arange(20) * 10**8
    settings = ScoreSettings(full=True, alignment="none", rpe_delta=1.0, rpe_unit="f")
    scored = score(Trajectory(t_ns, T_gt), Trajectory(t_ns, T_est), settings=settings)
    pairs = frames_apart(T_gt, 1)
    errors, (point_m, percent) = errors_between(T_gt, T_est, *pairs), distance_errors(T_gt, T_est, pairs)
    matrix = relative_matrix_errors(T_gt, T_est, pairs)
    wanted = {
        "rpe_trans": errors.trans_m,
        "rpe_rot": np.rad2deg(errors.rot_rad),
        "rpe_rot_chordal": matrix.rotation,
        "rpe_full": matrix.full,
        "rpe_point": point_m,
        "rpe_point_percent": percent,
    }
    for name, values in wanted.items():
        assert scored.metric(name).statistics.rmse == pytest.approx(np.sqrt(np.mean(values**2)), rel=1e-9), name


def test_a_turn_is_the_same_by_its_angle_and_by_its_matrix():
    T_gt, T_est = straight(9), straight(9)
    T_est[:, :3, :3] = se3.rotation_z(0.3 * np.arange(9))
    pairs = frames_apart(T_gt, 1)
    matrix = relative_matrix_errors(T_gt, T_est, pairs)
    errors = errors_between(T_gt, T_est, *pairs)
    np.testing.assert_allclose(errors.rot_rad, 0.3, rtol=1e-12)
    np.testing.assert_allclose(matrix.rotation, 2 * np.sqrt(2) * np.sin(errors.rot_rad / 2), rtol=1e-12)
    np.testing.assert_allclose(matrix.full, np.hypot(matrix.rotation, errors.trans_m), rtol=1e-12)


def test_where_the_truth_stands_there_is_no_percentage():
    T_gt = straight(9, step_m=0.0)
    point_m, percent = distance_errors(T_gt, straight(9), frames_apart(T_gt, 1))
    assert len(percent) == 0
    np.testing.assert_allclose(point_m, 0.1)


def test_one_pose_has_no_relative_error():
    assert len(errors_between(straight(1), straight(1), *frames_apart(straight(1), 1))) == 0


@pytest.mark.parametrize("block", [1, 7, 1000])
def test_errors_do_not_depend_on_the_size_of_the_blocks(monkeypatch, block):
    rng = np.random.default_rng(3)
    T_gt, T_est = (
        straight(50),
        straight(50) @ se3.transform(se3.rotation_z(rng.normal(size=50)), rng.normal(size=(50, 3))),
    )
    pairs = frames_apart(T_gt, 3)
    expected = errors_between(T_gt, T_est, *pairs)
    monkeypatch.setattr(blockwise, "BLOCK", block)
    found = errors_between(T_gt, T_est, *pairs)
    np.testing.assert_array_equal(found.trans_m, expected.trans_m)
    np.testing.assert_array_equal(found.rot_rad, expected.rot_rad)


def drive(t_ns, speed_mps=1.0):
    t_s = np.asarray(t_ns) / 1e9
    return Trajectory(
        np.asarray(t_ns, np.int64), se3.transform(se3.rotation_z(0.1 * t_s), t_s[:, None] * [speed_mps, 0, 0])
    )


TRUTH = drive(np.arange(1001) * 10_000_000)
EVERY_50_MS = np.arange(201) * 50_000_000


def test_the_truth_has_no_error_and_the_last_pose_ends_no_pair():
    errors = tum_errors(TRUTH, drive(EVERY_50_MS), delta_s=1.0)
    assert len(errors) == 201 - 20 - 1
    assert max(errors.trans_m.max(), errors.rot_rad.max()) < 1e-7


def test_a_speed_wrong_by_a_tenth_is_a_tenth_of_a_metre_a_second_until_it_is_scaled():
    fast = drive(EVERY_50_MS, speed_mps=1.1)
    assert tum_errors(TRUTH, fast, delta_s=1.0).trans_m == pytest.approx(0.1)
    assert tum_errors(TRUTH, fast, delta_s=1.0, scale=1 / 1.1).trans_m.max() < 1e-7


def test_the_offset_of_the_clock_is_undone():
    late = Trajectory(EVERY_50_MS - 10**9, drive(EVERY_50_MS).T_world_frame)
    assert len(tum_errors(TRUTH, late, delta_s=1.0)) == 180 - 20  # a second of it lies before the truth
    assert len(tum_errors(TRUTH, late, delta_s=1.0, offset_ns=10**9)) == 180


def test_where_the_truth_has_a_hole_there_is_no_pair():
    kept = np.r_[0:300, 400:1001]
    holed = Trajectory(TRUTH.t_ns[kept], TRUTH.T_world_frame[kept])
    errors = tum_errors(holed, drive(EVERY_50_MS), delta_s=1.0)
    assert 180 - 2 * 20 <= len(errors) < 180
    # What is left lies at most two steps beside the hole, where the nearest truth is a little off.
    assert errors.trans_m.max() < 0.03


@pytest.mark.parametrize("n", [0, 1, 2])
def test_few_poses_have_no_pair(n):
    assert len(tum_errors(TRUTH, drive(EVERY_50_MS[:n]), delta_s=1.0)) == 0
