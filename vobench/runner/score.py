"""The score of a trial's estimate, and the status of the trial."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vobench.geometry import se3
from vobench.metric.definitions import DEFINITIONS
from vobench.metric.score import Score, score
from vobench.metric.settings import ScoreSettings
from vobench.metric.truth_copy import FLOOR_M, is_truth_copy
from vobench.runner.consistency import trial_consistency
from vobench.runner.estimate import DROPPED, ESTIMATE, FINISHED, REVISED, EstimatorOutcome, read_outcome
from vobench.runner.folder import ORACLE, SCORE, SURVIVED, TRUTH_COPY, TrialScore, TrialStatus, read_tum
from vobench.runner.frames import ANSWERS, EXPOSURES, GROUND_TRUTH, read_table, write_frames
from vobench.runner.ground_truth import scored_truth
from vobench.runner.store import write_json
from vobench.suite.case import Case
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import parse_tum

if TYPE_CHECKING:
    from vobench.suite.plan import AnyCase, Trial

# The ground truth of a trial has one pose for each frame.
SETTINGS = ScoreSettings(coverage_of="frames")

# Estimators with this claim estimate no scale. Their estimates are aligned with a scale, and the scale drift is scored.
NO_SCALE = "Sim(3)"
NO_SCALE_SETTINGS = replace(SETTINGS, alignment="sim3", full=True)
NO_SCALE_METRICS = tuple(metric for metric in DEFINITIONS.values() if not metric.full or metric.id == "scale_drift")

# A camera is stationary if its distance and rotation from its first pose stay within these limits, which allow for the
# jitter of a tracker and for vibration: the standing drone of EuRoC's V1_01 comes to 2.3 mm and 0.20°. The length of
# the path is no criterion, because it sums the jitter.
STILL_M = 5e-3
STILL_RAD = np.deg2rad(0.5)

LEAST_DIVERGED_M = 1e-3  # a smaller ATE is never a divergence, however short the path is
NO_POSE_RIGHT = 0.5  # the lost-aware score of an estimate with full coverage and no correct pose

# Encoders are exact if at least about half of their steps are within FLOOR_M of the true ones, because then the
# integrated motion looks like a copy of the truth. The error of a step is the difference of two rounding errors. Each
# is uniform over one tick, so the share of steps within FLOOR_M is 1 - (1 - FLOOR_M / tick)². It is 49 % for this tick.
MAX_EXACT_TICK_M = 3.5 * FLOOR_M


def score_trial(trial: "Trial", sequence: Path, estimate: Path, folder: Path) -> None:
    """Score an estimate against the truth of its sequence. The score and the table of frames are written to `folder`.

    `sequence` and `estimate` are the folders with the results of the earlier tasks.
    """
    case = trial.case
    claims = trial.estimator_entry.claims
    sensors = trial.estimator_entry.manifest.needs

    # The scored truth goes through the text that the run contains, so that anyone can reproduce the score.
    exact_tum = (sequence / GROUND_TRUTH).read_text(encoding="utf-8")
    gt = parse_tum(scored_truth(exact_tum, case), name=GROUND_TRUTH)
    est = read_tum(estimate / ESTIMATE)
    scored = score_estimate(est, gt, claims)

    frame_stamps = {row["frame"]: int(row["t_ns"]) for row in read_table(sequence / EXPOSURES)}
    dropped = _dropped_stamps(estimate, frame_stamps)
    outcome = read_outcome(estimate)
    if dropped and outcome.kind == FINISHED:
        status, reason = status_with_dropped_frames(est, gt, claims, dropped)
    else:
        status, reason = status_of(outcome, scored, gt)

    trial_score = TrialScore(
        case=case.name,
        variant=case.variant,
        estimator=trial.estimator_entry.label,
        repeat=trial.repeat,
        status=status,
        reason=reason,
        coverage=scored.coverage.ratio if scored else 0.0,
        frames=len(gt),
        path_m=float(gt.distances_m()[-1]),
        score=scored.as_dict() if scored else None,
        drift_m=drift_m(est, gt, scored),
        claims=judged_claims(claims, est, gt, is_exactly_sensed=senses_exactly(case, sensors)),
        sensors=sensors,
        consistency=trial_consistency(estimate, gt, est, start_ns=min(frame_stamps.values()), scale=scale_of(scored)),
        revised=_revised_score(estimate, gt, claims),
        sandbox=outcome.sandbox,
    )
    write_json(folder / SCORE, trial_score.model_dump(mode="json"))
    write_frames(sequence, estimate, scored, folder)


def _dropped_stamps(estimate: Path, frame_stamps: Mapping[str, int]) -> list[int]:
    """The stamps (ns) of the frames that were dropped because the estimator was too slow for real time."""
    frames = [answer["frame"] for answer in read_table(estimate / ANSWERS) if answer["status"] == DROPPED]
    return [frame_stamps[frame] for frame in frames]


def senses_exactly(case: "AnyCase | None", sensors: Sequence[str]) -> bool:
    """Whether an estimator can integrate the exact motion of a case from its IMU or its encoders, without cameras.

    `sensors` are the sensors that the estimator uses. False for recordings, whose sensors always have errors.
    """
    if not isinstance(case, Case):
        return False
    if "imu" in sensors and _has_exact_imu(case):
        return True
    return "encoders" in sensors and _has_exact_encoders(case)


def _has_exact_imu(case: Case) -> bool:
    """Whether a case has an IMU without noise."""
    imu = case.rig.imu
    return imu is not None and imu.gyro.noise == 0 and imu.accel.noise == 0


def _has_exact_encoders(case: Case) -> bool:
    """Whether a case has wheel encoders whose ticks are shorter than MAX_EXACT_TICK_M."""
    wheels = case.build_rig().wheels
    if wheels is None:
        return False
    tick_m = 2 * np.pi * wheels.radius_m / wheels.ticks_per_revolution
    return tick_m < MAX_EXACT_TICK_M


def judged_claims(
    claims: Sequence[str], est: Trajectory, gt: Trajectory, *, is_exactly_sensed: bool
) -> tuple[str, ...]:
    """The claims of a manifest, and TRUTH_COPY if the estimate equals the truth without a legitimate reason.

    Legitimate reasons are that the estimator is an oracle, or that the sensors are exact.
    """
    manifest_claims = tuple(claim for claim in claims if claim != TRUTH_COPY)
    if ORACLE in claims or is_exactly_sensed:
        return manifest_claims
    if not is_truth_copy(gt, est, has_scale=NO_SCALE not in claims):
        return manifest_claims
    return (*manifest_claims, TRUTH_COPY)


def _revised_score(estimate: Path, gt: Trajectory, claims: Sequence[str]) -> dict[str, Any] | None:
    """The score of the revised poses as plain values; None if there are none."""
    revised = score_revised(estimate, gt, claims)
    return revised.as_dict() if revised else None


def score_revised(folder: Path, gt: Trajectory, claims: Sequence[str]) -> Score | None:
    """The score of the poses that an estimator revised after the last frame; None if there are none.

    `folder` is the folder of the trial's estimate.
    """
    path = folder / REVISED
    if not path.is_file():
        return None
    return score_estimate(read_tum(path), gt, claims)


def scale_of(scored: Score | None) -> float:
    """The scale that an estimate was aligned with; 1 without a score."""
    return scored.alignment.scale if scored else 1.0


def drift_m(est: Trajectory, gt: Trajectory, scored: Score | None) -> float | None:
    """The drift of an estimate while the camera is stationary: its largest distance from its start.

    None if the camera moves, or if the estimate has no score.
    """
    if scored is None or not stands_still(gt):
        return None
    return extent_m(est)


def stands_still(gt: Trajectory) -> bool:
    """Whether the true camera is stationary, so that errors relative to the path are meaningless."""
    R_world_frame = gt.T_world_frame[:, :3, :3]
    R_first_world = se3.inverse(gt.T_world_frame[:1])[:, :3, :3]
    angles_rad = se3.rotation_angle(R_first_world @ R_world_frame)
    return bool(extent_m(gt) <= STILL_M and np.max(angles_rad) <= STILL_RAD)


def extent_m(trajectory: Trajectory) -> float:
    """The largest distance from the first position."""
    offsets_m = trajectory.positions_m - trajectory.positions_m[:1]
    return float(np.linalg.norm(offsets_m, axis=1).max())


def score_estimate(est: Trajectory, gt: Trajectory, claims: Sequence[str]) -> Score | None:
    """The score of an estimate; None if it has no pose at a frame whose truth is known.

    With the claim NO_SCALE, the estimate is aligned with a scale, and the scale drift is one of the metrics.
    """
    if not np.isin(est.t_ns, gt.t_ns).any():
        return None
    if NO_SCALE not in claims:
        return score(gt, est, settings=SETTINGS)
    return score(gt, est, settings=NO_SCALE_SETTINGS, metrics=NO_SCALE_METRICS)


def status_of(outcome: EstimatorOutcome, scored: Score | None, gt: Trajectory) -> tuple[TrialStatus, str]:
    """The status of a trial and its reason.

    A failed process comes first. Otherwise the worst status that applies is returned.
    """
    if outcome.kind != FINISHED:
        return outcome.kind, outcome.reason  # type: ignore[return-value]  # EstimatorFailure's kinds are statuses
    if scored is None:
        return "lost", "a pose for 0% of the frames"
    coverage = scored.coverage
    if not scored.failure.survived:
        at_the_end = " and none at the end" if coverage.ratio and coverage.ends_lost else ""
        return "lost", f"a pose for {coverage.ratio:.0%} of the frames{at_the_end}"

    divergence = _divergence(scored, gt)
    if divergence:
        return "diverged", divergence
    if coverage.ratio < 1:
        missing = scored.association.gt_poses - scored.association.pairs
        return "partial", f"no pose for {missing} of {len(gt)} frames; the first is {coverage.first_lost_frame}"
    return "ok", ""


def _divergence(scored: Score, gt: Trajectory) -> str:
    """Why an estimate is diverged, or an empty string if it is not.

    It is diverged if its error exceeds the length of the path, or if no pose is correct.
    """
    if stands_still(gt):
        return ""
    ate = scored.metric("ate_trans")
    path_m = float(gt.distances_m()[-1])
    if ate is not None and ate.statistics.rmse > max(path_m, LEAST_DIVERGED_M):
        return f"ATE {ate.statistics.rmse:.3g} m on a path of {path_m:.3g} m"
    if scored.failure.lost_aware == NO_POSE_RIGHT:
        return f"every pose is off by more than {scored.failure.fail_m:.3g} m"
    return ""


def status_with_dropped_frames(
    est: Trajectory, gt: Trajectory, claims: Sequence[str], dropped: Sequence[int]
) -> tuple[TrialStatus, str]:
    """The status of a trial in real time and its reason. It is judged by the frames that the estimator received.

    `dropped` are the stamps (ns) of the other frames. A trial that survives is partial because of them.
    """
    is_received = ~np.isin(gt.t_ns, dropped)
    received_gt = Trajectory(gt.t_ns[is_received], gt.T_world_frame[is_received])
    scored = score_estimate(est, received_gt, claims)
    status, reason = status_of(EstimatorOutcome(kind=FINISHED, reason=""), scored, received_gt)
    if status not in SURVIVED:
        return status, reason

    too_late = f"it was too late for {len(dropped)} of {len(gt)} frames"
    if reason:
        return "partial", f"{too_late}; {reason}"
    return "partial", too_late
