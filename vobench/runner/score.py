"""Estimate to score: one trial's numbers and its status."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vobench.geometry import se3
from vobench.metric.definitions import DEFINITIONS
from vobench.metric.score import Score, score
from vobench.metric.settings import ScoreSettings
from vobench.runner.consistency import trial_consistency
from vobench.runner.estimate import DROPPED, ESTIMATE, FINISHED, REVISED, Outcome, read_outcome
from vobench.runner.folder import SCORE, SURVIVED, TrialScore, TrialStatus, read_tum
from vobench.runner.frames import ANSWERS, EXPOSURES, GROUND_TRUTH, read_table, write_frames
from vobench.runner.ground_truth import scored_truth
from vobench.runner.store import write_json
from vobench.trajectory.formats import parse_tum
from vobench.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vobench.suite.suite import Trial

# The truth that a trial is scored against has one pose for each frame.
SETTINGS = ScoreSettings(coverage_of="frames")
NO_SCALE = "Sim(3)"
OF_NO_SCALE = tuple(metric for metric in DEFINITIONS.values() if not metric.full or metric.id == "scale_drift")
# What trackers of resting things jitter by. Extents, not path lengths: jitter adds up along a path.
STILL_M = 2e-3
STILL_RAD = np.deg2rad(0.2)


def score_trial(trial: "Trial", sequence: Path, estimate: Path, folder: Path) -> None:
    """Score a trial's estimate against its sequence's true path: the score and the table of frames, in a folder."""
    exact = (sequence / GROUND_TRUTH).read_text(encoding="utf-8")
    gt = parse_tum(scored_truth(exact, trial.case), name=GROUND_TRUTH)  # as a file has it that anybody can score again
    claims = trial.entrant.claims
    est = read_tum(estimate / ESTIMATE)
    revised = estimate / REVISED
    scored = score_estimate(est, gt, claims)
    later = score_estimate(read_tum(revised), gt, claims) if revised.is_file() else None
    stamps = {row["frame"]: int(row["t_ns"]) for row in read_table(sequence / EXPOSURES)}
    dropped = [stamps[row["frame"]] for row in read_table(estimate / ANSWERS) if row["status"] == DROPPED]
    outcome = read_outcome(estimate)
    scale = scored.alignment.scale if scored else 1.0
    status, reason = status_of(outcome, scored, gt)
    if dropped and outcome.kind == FINISHED:
        status, reason = status_of_handed(est, gt, claims, dropped)
    score = TrialScore(
        case=trial.case.name,
        variant=trial.case.variant,
        estimator=trial.entrant.label,
        repeat=trial.repeat,
        status=status,
        reason=reason,
        coverage=scored.coverage.ratio if scored else 0.0,
        frames=len(gt),
        path_m=float(gt.distances_m()[-1]),
        score=scored.as_dict() if scored else None,
        drift_m=extent_m(est) if scored and stands_still(gt) else None,
        claims=claims,
        consistency=trial_consistency(estimate, gt, est, start_ns=min(stamps.values()), scale=scale),
        revised=later.as_dict() if later else None,
        sandbox=outcome.sandbox,
    )
    write_json(folder / SCORE, score.model_dump(mode="json"))
    write_frames(sequence, estimate, scored, folder)


def stands_still(gt: Trajectory) -> bool:
    """Whether the truth stays within 2 mm and 0.2° of its first pose: an error of its path would mean nothing."""
    turned_rad = se3.rotation_angle(se3.inverse(gt.T_world_frame[:1])[:, :3, :3] @ gt.T_world_frame[:, :3, :3])
    return bool(extent_m(gt) <= STILL_M and np.max(turned_rad) <= STILL_RAD)


def extent_m(trajectory: Trajectory) -> float:
    """The largest distance from the first position."""
    return float(np.linalg.norm(trajectory.positions_m - trajectory.positions_m[:1], axis=1).max())


def score_estimate(est: Trajectory, gt: Trajectory, claims: Sequence[str]) -> Score | None:
    """The score of an estimate, None where it holds no pose of a frame whose truth is known.

    One that claims no more than Sim(3) is aligned with a scale, and how that drifts is told.
    """
    if not np.isin(est.t_ns, gt.t_ns).any():
        return None
    if NO_SCALE not in claims:
        return score(gt, est, settings=SETTINGS)
    return score(gt, est, settings=replace(SETTINGS, alignment="sim3", full=True), metrics=OF_NO_SCALE)


def status_of(outcome: Outcome, scored: Score | None, gt: Trajectory) -> tuple[TrialStatus, str]:
    """How the trial ended, the gravest first; an estimator that died is not saved by what it answered before."""
    if outcome.kind != FINISHED:
        return outcome.kind, outcome.reason  # type: ignore[return-value]  # EstimatorFailure's kinds are statuses
    if scored is None or not scored.failure.survived:
        covered = scored.coverage.ratio if scored else 0.0
        at_the_end = " and none at the end" if covered and scored and scored.coverage.ends_lost else ""
        return "lost", f"a pose for {covered:.0%} of the frames{at_the_end}"
    ate = scored.metric("ate_trans")
    path_m = float(gt.distances_m()[-1])
    if ate is not None and ate.statistics.rmse > max(path_m, 1e-3) and not stands_still(gt):
        return "diverged", f"ATE {ate.statistics.rmse:.3g} m on a path of {path_m:.3g} m"
    if scored.coverage.ratio < 1:
        without = scored.association.gt_poses - scored.association.pairs
        return "partial", f"no pose for {without} of {len(gt)} frames; the first is {scored.coverage.first_lost_frame}"
    return "ok", ""


def status_of_handed(
    est: Trajectory, gt: Trajectory, claims: Sequence[str], dropped: Sequence[int]
) -> tuple[TrialStatus, str]:
    """How a trial in real time ended, by the frames that came in time; those of these stamps did not."""
    in_time = ~np.isin(gt.t_ns, dropped)
    handed = Trajectory(gt.t_ns[in_time], gt.T_world_frame[in_time])
    status, reason = status_of(Outcome(kind=FINISHED, reason=""), score_estimate(est, handed, claims), handed)
    if status not in SURVIVED:
        return status, reason
    late = f"it was too late for {len(dropped)} of {len(gt)} frames"
    return "partial", f"{late}; {reason}" if reason else late
