"""Scores the estimate of a trial, and determines the status of the trial."""

from collections.abc import Sequence
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

# The truth against which a trial is scored has one pose for each frame.
SETTINGS = ScoreSettings(coverage_of="frames")
NO_SCALE = "Sim(3)"
NO_POSE_RIGHT = 0.5  # the lost-aware score of an estimate that survives with every pose wrong
# Metrics of an estimate without a scale: those of every score, and how its scale drifts.
OF_NO_SCALE = tuple(metric for metric in DEFINITIONS.values() if not metric.full or metric.id == "scale_drift")
NO_SCALE_SETTINGS = replace(SETTINGS, alignment="sim3", full=True)
# The jitter of trackers at rest. These are limits of extents, because path lengths add up the jitter.
STILL_M = 2e-3
STILL_RAD = np.deg2rad(0.2)
LEAST_DIVERGED_M = 1e-3
MOTION_SENSORS = ("encoders", "imu")
EXACT_TICK = 3.5  # in floors; with 1 - (1 - 1 / 3.5)² = 0.49 of the steps within the floor


def score_trial(trial: "Trial", sequence: Path, estimate: Path, folder: Path) -> None:
    """Score the estimate of a trial against the truth of its sequence, and write the score and the table of frames."""
    exact = (sequence / GROUND_TRUTH).read_text(encoding="utf-8")
    # The truth is read from the text in the run, so that everybody can reproduce the score.
    gt = parse_tum(scored_truth(exact, trial.case), name=GROUND_TRUTH)
    claims = trial.estimator_entry.claims
    est = read_tum(estimate / ESTIMATE)
    scored = score_estimate(est, gt, claims)
    stamps = {row["frame"]: int(row["t_ns"]) for row in read_table(sequence / EXPOSURES)}
    dropped = [stamps[row["frame"]] for row in read_table(estimate / ANSWERS) if row["status"] == DROPPED]
    outcome = read_outcome(estimate)
    status, reason = status_of(outcome, scored, gt)
    if dropped and outcome.kind == FINISHED:
        status, reason = status_of_handed(est, gt, claims, dropped)
    is_exactly_sensed = senses_exactly(trial.case, trial.estimator_entry.manifest.needs)
    score = TrialScore(
        case=trial.case.name,
        variant=trial.case.variant,
        estimator=trial.estimator_entry.label,
        repeat=trial.repeat,
        status=status,
        reason=reason,
        coverage=scored.coverage.ratio if scored else 0.0,
        frames=len(gt),
        path_m=float(gt.distances_m()[-1]),
        score=scored.as_dict() if scored else None,
        drift_m=drift_m(est, gt, scored),
        claims=judged_claims(claims, est, gt, is_exactly_sensed=is_exactly_sensed),
        sensors=trial.estimator_entry.manifest.needs,
        consistency=trial_consistency(estimate, gt, est, start_ns=min(stamps.values()), scale=scale_of(scored)),
        revised=_revised_score(estimate, gt, claims),
        sandbox=outcome.sandbox,
    )
    write_json(folder / SCORE, score.model_dump(mode="json"))
    write_frames(sequence, estimate, scored, folder)


def senses_exactly(case: "AnyCase | None", sensors: Sequence[str]) -> bool:
    """Whether sensors other than cameras measure the motion of a case so well that it can be integrated to rounding.

    That is so for an IMU without noise, and for wheels with ticks so short that half of the steps, whose errors are
    differences of two roundings, are within the floor of a truth copy. It is False for recordings.
    """
    if not isinstance(case, Case) or not set(sensors) & set(MOTION_SENSORS):
        return False
    imu = case.rig.imu
    wheels = case.build_rig().wheels
    has_exact_imu = imu is not None and imu.gyro.noise == 0 and imu.accel.noise == 0
    has_exact_wheels = False
    if wheels is not None:
        tick_m = 2 * np.pi * wheels.radius_m / wheels.ticks_per_revolution
        has_exact_wheels = tick_m < EXACT_TICK * FLOOR_M
    return ("imu" in sensors and has_exact_imu) or ("encoders" in sensors and has_exact_wheels)


def judged_claims(
    claims: Sequence[str], est: Trajectory, gt: Trajectory, *, is_exactly_sensed: bool
) -> tuple[str, ...]:
    """The claims of a manifest, and TRUTH_COPY if the estimate is the truth and nothing has measured it so well.

    Oracles, which use the truth openly, have a claim of their own.
    """
    manifest_claims = tuple(claim for claim in claims if claim != TRUTH_COPY)
    if ORACLE in claims or is_exactly_sensed:
        return manifest_claims
    if not is_truth_copy(gt, est, has_scale=NO_SCALE not in claims):
        return manifest_claims
    return (*manifest_claims, TRUTH_COPY)


def _revised_score(estimate: Path, gt: Trajectory, claims: Sequence[str]) -> dict[str, Any] | None:
    """The score of the poses that an estimator revised at the end; None if there are none."""
    revised = score_revised(estimate, gt, claims)
    return revised.as_dict() if revised else None


def score_revised(folder: Path, gt: Trajectory, claims: Sequence[str]) -> Score | None:
    """The score of the revised poses in a trial's folder; None if there are none."""
    path = folder / REVISED
    if not path.is_file():
        return None
    return score_estimate(read_tum(path), gt, claims)


def scale_of(scored: Score | None) -> float:
    """The scale that an estimate was aligned with; 1 without a score."""
    return scored.alignment.scale if scored else 1.0


def drift_m(est: Trajectory, gt: Trajectory, scored: Score | None) -> float | None:
    """The largest distance of a scored estimate from its start if the truth is stationary; None otherwise."""
    if scored is None or not stands_still(gt):
        return None
    return extent_m(est)


def stands_still(gt: Trajectory) -> bool:
    """Whether the truth stays within 2 mm and 0.2° of its first pose, so that relative errors are meaningless."""
    R_world_frame = gt.T_world_frame[:, :3, :3]
    R_first_world = se3.inverse(gt.T_world_frame[:1])[:, :3, :3]
    turned_rad = se3.rotation_angle(R_first_world @ R_world_frame)
    return bool(extent_m(gt) <= STILL_M and np.max(turned_rad) <= STILL_RAD)


def extent_m(trajectory: Trajectory) -> float:
    """The largest distance from the first position."""
    offsets_m = trajectory.positions_m - trajectory.positions_m[:1]
    return float(np.linalg.norm(offsets_m, axis=1).max())


def score_estimate(est: Trajectory, gt: Trajectory, claims: Sequence[str]) -> Score | None:
    """The score of an estimate; None if it has no pose at a frame whose truth is known.

    An estimate with the claim Sim(3), which has no scale, is aligned with a scale, and the drift of it is measured.
    """
    if not np.isin(est.t_ns, gt.t_ns).any():
        return None
    if NO_SCALE not in claims:
        return score(gt, est, settings=SETTINGS)
    return score(gt, est, settings=NO_SCALE_SETTINGS, metrics=OF_NO_SCALE)


def status_of(outcome: EstimatorOutcome, scored: Score | None, gt: Trajectory) -> tuple[TrialStatus, str]:
    """The status of a trial and its reason. The worst status that applies is used, first of all a failed process."""
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
    """Why an estimate counts as diverged: its error exceeds the path, or no pose is right; empty if it does not."""
    if stands_still(gt):
        return ""
    ate = scored.metric("ate_trans")
    path_m = float(gt.distances_m()[-1])
    if ate is not None and ate.statistics.rmse > max(path_m, LEAST_DIVERGED_M):
        return f"ATE {ate.statistics.rmse:.3g} m on a path of {path_m:.3g} m"
    if scored.failure.lost_aware == NO_POSE_RIGHT:
        return f"every pose is off by more than {scored.failure.fail_m:.3g} m"
    return ""


def status_of_handed(
    est: Trajectory, gt: Trajectory, claims: Sequence[str], dropped: Sequence[int]
) -> tuple[TrialStatus, str]:
    """The status of a trial in real time and its reason, from the frames that were not dropped."""
    is_sent = ~np.isin(gt.t_ns, dropped)
    sent = Trajectory(gt.t_ns[is_sent], gt.T_world_frame[is_sent])
    scored = score_estimate(est, sent, claims)
    status, reason = status_of(EstimatorOutcome(kind=FINISHED, reason=""), scored, sent)
    if status not in SURVIVED:
        return status, reason
    late = f"it was too late for {len(dropped)} of {len(gt)} frames"
    return "partial", f"{late}; {reason}" if reason else late
