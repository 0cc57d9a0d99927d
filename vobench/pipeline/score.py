"""Estimate to score: one run's numbers and its status."""

from pathlib import Path

import numpy as np

from vobench.metric.score import Score, score
from vobench.metric.settings import ScoreSettings
from vobench.results import estimate_file
from vobench.results.run_folder import RunScore, RunStatus
from vobench.suite.expand import Run
from vobench.trajectory.trajectory import Trajectory

# The truth that a run is scored against has one pose for each frame.
SETTINGS = ScoreSettings(coverage_of="frames")


def score_run(run: Run, estimate: Path, gt: Trajectory) -> RunScore:
    """Score a run's estimate against the left camera's true path."""
    scored = score_estimate(estimate, gt)
    status, reason = _status(estimate_file.read_outcome(estimate), scored, gt)
    return RunScore(
        case=run.case.name,
        variant=run.case.variant,
        estimator=run.entrant.label,
        repeat=run.repeat,
        status=status,
        reason=reason,
        coverage=scored.coverage.ratio if scored else 0.0,
        frames=len(gt),
        path_m=float(gt.distances_m()[-1]),
        score=scored.as_dict() if scored else None,
    )


def score_estimate(estimate: Path, gt: Trajectory) -> Score | None:
    """The score of an estimate's folder, None where it holds no pose of a frame whose truth is known."""
    est = estimate_file.read_tum(estimate / estimate_file.ESTIMATE)
    return score(gt, est, settings=SETTINGS) if np.isin(est.t_ns, gt.t_ns).any() else None


def _status(outcome: estimate_file.Outcome, scored: Score | None, gt: Trajectory) -> tuple[RunStatus, str]:
    """How the run ended, the gravest first; a run that died is not saved by what it had answered before."""
    if outcome.kind != estimate_file.FINISHED:
        return outcome.kind, outcome.reason  # type: ignore[return-value]  # EstimatorFailure's kinds are statuses
    if scored is None or not scored.failure.survived:
        covered = scored.coverage.ratio if scored else 0.0
        at_the_end = " and none at the end" if covered and scored and scored.coverage.ends_lost else ""
        return "lost", f"a pose for {covered:.0%} of the frames{at_the_end}"
    ate, path_m = scored.metric("ate_trans"), float(gt.distances_m()[-1])
    if ate is not None and ate.statistics.rmse > max(path_m, 1e-3):
        return "diverged", f"ATE {ate.statistics.rmse:.3g} m on a path of {path_m:.3g} m"
    if scored.coverage.ratio < 1:
        without = scored.association.gt_poses - scored.association.pairs
        return "partial", f"no pose for {without} of {len(gt)} frames; the first is {scored.coverage.first_lost_frame}"
    return "ok", ""
