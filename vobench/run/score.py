"""Estimate to score: one trial's numbers and its status."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.metric.score import Score, score
from vobench.metric.settings import ScoreSettings
from vobench.run import estimate as estimate_file
from vobench.run.folder import RunStatus, TrialScore
from vobench.sequence import Sequence, read_truth
from vobench.suite.suite import Trial
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

# Between two true poses further apart than this nobody knows where the camera was.
LONGEST_GAP_NS = 200_000_000


def left_truth(folder: Path) -> Trajectory:
    """The left camera's true poses at all pictures that have one; the truth is interpolated where it is not theirs.

    Pictures before, after or in a gap of the truth are left out, and so not scored.
    Raises SequenceError where that leaves none.
    """
    sequence, truth = Sequence.open(folder), read_truth(folder)
    if not len(truth):
        raise SequenceError(f"no ground truth, so nothing can be scored: {folder}")
    stamps = sequence.frame_stamps()
    if not np.array_equal(stamps, truth.t_ns):
        stamps = stamps[is_known(truth.t_ns, stamps)]
        if not len(stamps):
            raise SequenceError(f"the ground truth covers none of the pictures in time: {folder}")
        truth = Trajectory(stamps, poses_at(truth, stamps))
    return truth.of_mounted(sequence.rig.T_body_left)


def is_known(truth_ns: Stamps, stamps: Stamps) -> NDArray[np.bool_]:
    """Which stamps lie on a true pose, or between two that are near to each other in time."""
    after = np.searchsorted(truth_ns, stamps, side="left")
    before = np.searchsorted(truth_ns, stamps, side="right") - 1
    inside = (before >= 0) & (after < len(truth_ns))
    last = len(truth_ns) - 1
    gap_ns = truth_ns[np.minimum(after, last)] - truth_ns[np.maximum(before, 0)]
    return np.asarray(inside & (gap_ns <= LONGEST_GAP_NS))


# The truth that a run is scored against has one pose for each frame.
SETTINGS = ScoreSettings(coverage_of="frames")
# What trackers of resting things jitter by. Extents, not path lengths: jitter adds up along a path.
STILL_M, STILL_RAD = 2e-3, np.deg2rad(0.2)


def score_trial(run: Trial, estimate: Path, gt: Trajectory) -> TrialScore:
    """Score a run's estimate against the left camera's true path."""
    scored = score_estimate(estimate, gt)
    status, reason = _status(estimate_file.read_outcome(estimate), scored, gt)
    return TrialScore(
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
        drift_m=_drift_m(estimate) if scored and stands_still(gt) else None,
    )


def stands_still(gt: Trajectory) -> bool:
    """Whether the truth stays within 2 mm and 0.2° of its first pose: an error of its path would mean nothing."""
    turned_rad = se3.rotation_angle(se3.inverse(gt.T_world_frame[:1])[:, :3, :3] @ gt.T_world_frame[:, :3, :3])
    return bool(_extent_m(gt) <= STILL_M and np.max(turned_rad) <= STILL_RAD)


def _drift_m(estimate: Path) -> float:
    return _extent_m(estimate_file.read_tum(estimate / estimate_file.ESTIMATE))


def _extent_m(trajectory: Trajectory) -> float:
    """The largest distance from the first position."""
    return float(np.linalg.norm(trajectory.positions_m - trajectory.positions_m[:1], axis=1).max())


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
    if ate is not None and ate.statistics.rmse > max(path_m, 1e-3) and not stands_still(gt):
        return "diverged", f"ATE {ate.statistics.rmse:.3g} m on a path of {path_m:.3g} m"
    if scored.coverage.ratio < 1:
        without = scored.association.gt_poses - scored.association.pairs
        return "partial", f"no pose for {without} of {len(gt)} frames; the first is {scored.coverage.first_lost_frame}"
    return "ok", ""
