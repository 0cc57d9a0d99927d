"""Estimate to score: the status of a trial follows from its estimate, by limits that are checked from both sides."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.metric.definitions import DEFINITIONS
from vobench.motion.motor import MotorConstants
from vobench.motion.wheeled import Wheeled
from vobench.runner.estimate import FINISHED, REVISED, EstimatorOutcome
from vobench.runner.folder import ORACLE, TRUTH_COPY
from vobench.runner.score import (
    LEAST_DIVERGED_M,
    NO_SCALE,
    NO_SCALE_METRICS,
    STILL_M,
    STILL_RAD,
    drift_m,
    extent_m,
    judged_claims,
    scale_of,
    score_estimate,
    score_revised,
    senses_exactly,
    stands_still,
    status_of,
    status_with_dropped_frames,
)
from vobench.sensor.imu import IMUS
from vobench.suite.suite import read_plan
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

POSES = 41
T_NS = np.arange(POSES, dtype=np.int64) * 50_000_000
DONE = EstimatorOutcome(kind=FINISHED, reason="")


def path(positions_m, angles_rad=None) -> Trajectory:
    """A trajectory through positions (N, 3), turned about z by angles (N,)."""
    angles_rad = np.zeros(len(positions_m)) if angles_rad is None else angles_rad
    T = np.stack([se3.transform(se3.rotation_z(angle), p) for angle, p in zip(angles_rad, positions_m, strict=True)])
    return Trajectory(T_NS[: len(T)], T)


def straight(length_m: float, *, scale: float = 1.0, turn_rad: float = 0.0) -> Trajectory:
    x_m = np.linspace(0, length_m, POSES) * scale
    positions_m = np.stack([x_m, np.zeros(POSES), np.zeros(POSES)], -1)
    return path(positions_m, np.linspace(0, turn_rad, POSES))


def scale_for_ate(ate_in_paths: float) -> float:
    """The scale of a straight estimate whose ATE is so many lengths of the path: its error is linear in x."""
    x = np.linspace(0, 1, POSES)
    return 1 + ate_in_paths / float(np.std(x))


@pytest.mark.parametrize(("ate_in_paths", "status"), [(0.97, "ok"), (1.03, "diverged"), (1.5, "diverged")])
def test_an_estimate_diverges_if_its_ate_is_larger_than_the_path_is_long(ate_in_paths, status):
    gt = straight(2.0)
    est = straight(2.0, scale=scale_for_ate(ate_in_paths))
    scored = score_estimate(est, gt, ())
    assert scored.metric("ate_trans").statistics.rmse == pytest.approx(2.0 * ate_in_paths, rel=1e-6)
    assert status_of(DONE, scored, gt)[0] == status


def test_the_reason_of_a_divergence_has_the_error_and_the_path():
    gt = straight(2.0)
    scored = score_estimate(straight(2.0, scale=scale_for_ate(1.5)), gt, ())
    assert status_of(DONE, scored, gt) == ("diverged", "ATE 3 m on a path of 2 m")


@pytest.mark.parametrize(("offset_m", "status"), [(0.19, "ok"), (0.3, "diverged")])
def test_an_estimate_diverges_if_none_of_its_poses_is_within_a_tenth_of_the_path(offset_m, status):
    gt = straight(2.0)
    aside_m = offset_m * np.resize([1.0, -1.0], POSES)
    est = path(gt.positions_m + np.stack([np.zeros(POSES), aside_m, np.zeros(POSES)], -1))
    found = status_of(DONE, score_estimate(est, gt, ()), gt)
    assert found == (status, "" if status == "ok" else "every pose is off by more than 0.2 m")


@pytest.mark.parametrize(("ate_m", "status"), [(0.9 * LEAST_DIVERGED_M, "ok"), (1.1 * LEAST_DIVERGED_M, "diverged")])
def test_on_a_path_of_less_than_a_millimetre_an_error_of_a_millimetre_is_a_divergence(ate_m, status):
    """The body turns by 90°, so that it does not stand still."""
    gt = straight(1e-4, turn_rad=np.pi / 2)
    est = straight(1e-4, scale=scale_for_ate(ate_m / 1e-4), turn_rad=np.pi / 2)
    assert status_of(DONE, score_estimate(est, gt, ()), gt)[0] == status


def test_nothing_diverges_from_a_truth_that_stands_still():
    gt = straight(0.9 * STILL_M)
    est = straight(1.0)
    assert status_of(DONE, score_estimate(est, gt, ()), gt)[0] == "ok"


@pytest.mark.parametrize(
    ("extent", "turn_rad", "is_still"),
    [
        (0.99 * STILL_M, 0.0, True),
        (1.01 * STILL_M, 0.0, False),
        (0.0, 0.99 * STILL_RAD, True),
        (0.0, 1.01 * STILL_RAD, False),
        (0.99 * STILL_M, -0.99 * STILL_RAD, True),
        (0.99 * STILL_M, 1.01 * STILL_RAD, False),
    ],
)
def test_a_truth_stands_still_within_2_mm_and_a_fifth_of_a_degree_of_its_first_pose(extent, turn_rad, is_still):
    assert stands_still(straight(extent, turn_rad=turn_rad)) is is_still


def test_standing_still_does_not_depend_on_the_world():
    T = se3.transform(se3.rotation_z(2.0), [5.0, -7.0, 1.0])
    still = straight(0.9 * STILL_M, turn_rad=0.9 * STILL_RAD)
    assert stands_still(Trajectory(still.t_ns, T @ still.T_world_frame))


def test_the_extent_is_the_largest_distance_from_the_start_and_not_the_path_or_the_end():
    out_and_back = np.zeros((POSES, 3))
    out_and_back[10] = [0, 3, 4]
    out_and_back[20] = [0, 0, -2]
    assert extent_m(path(out_and_back + 1.0)) == pytest.approx(5.0)


def test_the_drift_is_the_extent_of_a_scored_estimate_where_the_truth_stands_still():
    gt = straight(0.0)
    est = straight(0.5)
    scored = score_estimate(est, gt, ())
    assert drift_m(est, gt, scored) == pytest.approx(0.5)
    assert drift_m(est, gt, None) is None
    assert drift_m(est, straight(1.0), scored) is None


def test_a_process_that_failed_counts_before_its_answers():
    gt = straight(1.0)
    failed = EstimatorOutcome(kind="crashed", reason="signal SIGSEGV")
    assert status_of(failed, score_estimate(gt, gt, ()), gt) == ("crashed", "signal SIGSEGV")


def test_without_a_pose_the_estimate_has_no_score_and_is_lost():
    gt = straight(1.0)
    other = Trajectory(T_NS + 1, gt.T_world_frame)
    assert score_estimate(other, gt, ()) is None
    assert status_of(DONE, None, gt) == ("lost", "a pose for 0% of the frames")
    assert scale_of(None) == 1.0


def kept(trajectory: Trajectory, rows) -> Trajectory:
    return Trajectory(trajectory.t_ns[rows], trajectory.T_world_frame[rows])


def test_missing_poses_in_the_middle_make_a_trial_partial_and_are_counted():
    gt = straight(1.0)
    rows = np.delete(np.arange(POSES), [20, 21])
    status, reason = status_of(DONE, score_estimate(kept(gt, rows), gt, ()), gt)
    assert (status, reason) == ("partial", f"no pose for 2 of {POSES} frames; the first is 20")


def test_no_pose_at_the_end_makes_a_trial_lost_and_is_said():
    gt = straight(1.0)
    scored = score_estimate(kept(gt, slice(0, POSES // 2)), gt, ())
    status, reason = status_of(DONE, scored, gt)
    assert status == "lost"
    assert reason == f"a pose for {POSES // 2 / POSES:.0%} of the frames and none at the end"


def test_a_perfect_estimate_is_ok_without_a_reason():
    gt = straight(1.0)
    assert status_of(DONE, score_estimate(gt, gt, ()), gt) == ("ok", "")


def test_an_estimate_without_a_scale_is_aligned_with_one_and_its_drift_is_measured():
    s = np.linspace(0, 4, POSES)
    gt = path(np.stack([s, np.sin(s), np.zeros(POSES)], -1))
    half = path(np.stack([s, np.sin(s), np.zeros(POSES)], -1) / 2)
    with_scale = score_estimate(half, gt, ("Sim(3)",))
    assert scale_of(with_scale) == pytest.approx(2.0)
    assert with_scale.metric("ate_trans").statistics.rmse < 1e-9
    assert with_scale.metric("scale_drift") is not None
    assert score_estimate(half, gt, ()).metric("scale_drift") is None
    assert scale_of(score_estimate(half, gt, ())) == 1.0


def test_metrics_of_an_estimate_without_a_scale_are_those_of_every_score_and_the_drift_of_the_scale():
    ids = {metric.id for metric in NO_SCALE_METRICS}
    assert "scale_drift" in ids
    assert ids - {"scale_drift"} == {metric.id for metric in DEFINITIONS.values() if not metric.full}


def test_dropped_frames_do_not_count_as_lost_and_are_counted_in_the_reason():
    gt = straight(1.0)
    dropped = T_NS[-5:].tolist()
    est = kept(gt, slice(0, POSES - 5))
    assert status_of(DONE, score_estimate(est, gt, ()), gt)[0] != "ok"
    assert status_with_dropped_frames(est, gt, (), dropped) == ("partial", f"it was too late for 5 of {POSES} frames")


def test_a_frame_that_was_sent_and_has_no_pose_is_said_beside_the_dropped_ones():
    gt = straight(1.0)
    rows = np.delete(np.arange(POSES - 5), [7])
    status, reason = status_with_dropped_frames(kept(gt, rows), gt, (), T_NS[-5:].tolist())
    assert status == "partial"
    assert reason == f"it was too late for 5 of {POSES} frames; no pose for 1 of {POSES - 5} frames; the first is 7"


def test_a_divergence_in_real_time_is_one():
    gt = straight(1.0)
    est = straight(1.0, scale=scale_for_ate(2.0))
    assert status_with_dropped_frames(est, gt, (), T_NS[:1].tolist())[0] == "diverged"


def test_revised_poses_are_scored_where_there_are_some(tmp_path):
    gt = straight(1.0)
    assert score_revised(tmp_path, gt, ()) is None
    (tmp_path / REVISED).write_text(format_tum(gt))
    assert score_revised(tmp_path, gt, ()).metric("ate_trans").statistics.rmse < 1e-9


def case_with(*, imu=None, motors=None):
    """A case with an IMU, and with motors on wheels of a size of their own."""
    case = next(case for case in read_plan("quickstart").simulated if isinstance(case.trajectory, Wheeled))
    trajectory = replace(case.trajectory, motors=motors)
    return replace(case, rig=replace(case.rig, imu=imu), trajectory=trajectory)


TINY_WHEELS = MotorConstants(r_m=0.03)  # a tick is 2.5 µm


@pytest.mark.parametrize(
    ("case", "sensors", "is_exact"),
    [
        (case_with(), ("stereo", "encoders"), False),
        (case_with(motors=TINY_WHEELS), ("stereo", "encoders"), True),
        (case_with(motors=TINY_WHEELS), ("stereo",), False),
        (case_with(imu=IMUS["exact"]), ("stereo", "imu"), True),
        (case_with(imu=IMUS["exact"]), ("stereo",), False),
        (case_with(imu=IMUS["adis16448"]), ("imu",), False),
        (None, ("imu", "encoders"), False),
    ],
)
def test_only_ideal_sensors_measure_a_motion_exactly(case, sensors, is_exact):
    assert senses_exactly(case, sensors) == is_exact


def test_a_copy_of_the_truth_is_claimed_unless_its_sensors_are_exact_or_it_is_an_oracle():
    gt = straight(2.0)
    assert judged_claims((), gt, gt, is_exactly_sensed=False) == (TRUTH_COPY,)
    assert judged_claims((TRUTH_COPY,), gt, gt, is_exactly_sensed=True) == ()
    assert judged_claims((ORACLE,), gt, gt, is_exactly_sensed=False) == (ORACLE,)
    assert judged_claims((TRUTH_COPY,), straight(2.1), gt, is_exactly_sensed=False) == ()
    scaled = straight(2.0, scale=3.0)
    assert judged_claims((NO_SCALE,), scaled, gt, is_exactly_sensed=False) == (NO_SCALE, TRUTH_COPY)
