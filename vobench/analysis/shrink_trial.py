"""Finds the shortest part of a failed trial that still fails in the same way, and writes it as a suite."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from vobench.analysis.nuisance import nuisances_of
from vobench.analysis.segment_loss import segment_loss
from vobench.analysis.shrink import MIN_FRAMES, Failure, Shrunk, shrink
from vobench.analysis.trial_data import TrialPaths, read_paths
from vobench.errors import InputError
from vobench.runner.data_frame import data_frame
from vobench.runner.estimate import FINISHED, EstimatorOutcome
from vobench.runner.finished_trial import FinishedTrial, read_finished_trial, run_variants
from vobench.runner.folder import SURVIVED, RunFolder, TrialScore
from vobench.runner.frames import read_frames
from vobench.runner.motion import body_motion
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.score import score_estimate, status_of
from vobench.runner.store import SILENT, Progress
from vobench.suite.case import Case
from vobench.suite.case_file import write_case
from vobench.suite.suite_spec import Window
from vobench.trajectory.part import between

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame

MIN_SHRUNK_LOSS = 0.02  # the least error, relative to the path, of a trial that ended well and is shrunk
SHARE_OF_ERROR = 0.5  # of the whole trial, that a part must have
# The statuses, in the table of frames, of frames without a pose.
WITHOUT_POSE = ("", "lost")


@dataclass(frozen=True, slots=True)
class ShrunkTrial:
    """A failed trial, and the smallest case found on which its estimator fails in the same way.

    `summary` is how the trial failed, in one line. `suite` is the suite file of the smaller case.
    """

    score: TrialScore
    summary: str
    found: Shrunk
    suite: Path

    @property
    def frame_count(self) -> int:
        """The number of frames of the whole case."""
        first, end = self.found.whole
        return end - first

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench shrink --json` prints them."""
        return {
            "suite": str(self.suite),
            "frames": list(self.found.window),
            "of": self.frame_count,
            "removed": self.found.removed,
            "tried": self.found.tried,
        }

    def to_frame(self) -> "DataFrame":
        """A pandas table with one row per trial that was run: what it was, and whether it failed in the same way."""
        return data_frame({"tried": tried, "fails_alike": fails} for tried, fails in self.found.tried)


def shrink_trial(
    trial: Path,
    *,
    run_plan: PlanRunner,
    trials: int = 12,
    folder: Path | None = None,
    estimator: Path | None = None,
    progress: Progress = SILENT,
) -> ShrunkTrial:
    """Find the shortest part of a failed trial that still fails in the same way, and write it as a suite.

    Args:
        trial: the trial as RUN/CASE/ESTIMATOR, or its folder in the run.
        run_plan: runs the candidates.
        trials: how many candidates are run at most.
        folder: the folder for the suite of the smaller case; by default shrunk/CASE_ESTIMATOR.
        estimator: the folder of the estimator, if it cannot be found by its name.
        progress: shows a note if the estimator has changed since the run.

    Raises:
        InputError: there is no such trial, it is of a recording, or it neither fails nor has a large error.
        UnknownNameError: the run has no such case or estimator.
    """
    finished = read_finished_trial(trial, estimator=estimator, progress=progress)
    failure = failure_of(finished)
    shrunk = _search(finished, failure, run_plan, trials)
    score = finished.score
    suite = write_case(
        shrunk.case,
        [finished.estimator_entry],
        folder or Path("shrunk") / f"{score.case}_{score.estimator}",
        name=f"{score.case}_shrunk".replace("-", "_"),
        summary=failure.summary,
    )
    return ShrunkTrial(score, failure.summary, shrunk, suite)


class TrialFailure(Protocol):
    """In which way a trial failed, and whether another trial or a part of this one fails in the same way."""

    @property
    def summary(self) -> str:
        """How the trial failed, in one line."""

    def is_in(self, folder: RunFolder, score: TrialScore) -> bool:
        """Whether another trial of the estimator fails in the same way."""

    def is_in_part(self, trial: FinishedTrial, part: TrialPaths) -> bool:
        """Whether a part of the trial, judged by itself, fails in the same way."""


@dataclass(frozen=True, slots=True)
class StatusFailure:
    """A trial that did not end well: its status and reason must be the same, apart from numbers."""

    kind: Failure
    summary: str

    def is_in(self, folder: RunFolder, score: TrialScore) -> bool:
        """Whether another trial has the same status and reason."""
        del folder
        return Failure.of(score.status, score.reason) == self.kind

    def is_in_part(self, trial: FinishedTrial, part: TrialPaths) -> bool:
        """Whether the poses of a part would be scored with the same status and reason."""
        scored = score_estimate(part.est, part.gt, trial.score.claims)
        status, reason = status_of(EstimatorOutcome(kind=FINISHED, reason=""), scored, part.gt)
        return Failure.of(status, reason) == self.kind


@dataclass(frozen=True, slots=True)
class AccuracyFailure:
    """A trial that ended well, but with a large error: the mean error of segments must be half as large or more."""

    loss: float
    summary: str

    def is_in(self, folder: RunFolder, score: TrialScore) -> bool:
        """Whether another trial has at least half of the error; one without an estimate does not count."""
        if score.status not in SURVIVED:
            return False
        return self._is_large(read_paths(folder, score))

    def is_in_part(self, trial: FinishedTrial, part: TrialPaths) -> bool:
        """Whether a part has at least half of the error."""
        del trial
        return self._is_large(part)

    def _is_large(self, paths: TrialPaths) -> bool:
        loss = segment_loss(paths.gt, paths.est, scale=paths.scale).mean()
        return bool(loss >= SHARE_OF_ERROR * self.loss)


def failure_of(trial: FinishedTrial) -> TrialFailure:
    """In which way a trial failed. Raises InputError if its error is small."""
    score = trial.score
    if _fails(score):
        return StatusFailure(Failure.of(score.status, score.reason), _summary(score))
    paths = read_paths(trial.folder, score)
    loss = float(segment_loss(paths.gt, paths.est, scale=paths.scale).mean())
    if loss < MIN_SHRUNK_LOSS:
        raise InputError(
            f"{score.estimator} on {score.case} is {score.status}, with an error of {loss:.2%} of the path: nothing "
            f"fails (an error of {MIN_SHRUNK_LOSS:.0%} or more would)"
        )
    return AccuracyFailure(loss, f"{score.estimator}: {score.status}, but with an error of {loss:.1%} of the path")


def _summary(score: TrialScore) -> str:
    return f"{score.estimator}: {score.status}, {score.reason}"


def _fails(score: TrialScore) -> bool:
    """Whether a trial failed. A partial trial counts as failed if it has a reason."""
    if score.status == "partial":
        return bool(score.reason)
    return score.status != "ok"


def _search(trial: FinishedTrial, failure: TrialFailure, run_plan: PlanRunner, trials: int) -> Shrunk:
    """The smallest case on which the estimator fails as it did in the trial."""
    suite_name = f"shrink_{trial.score.case.replace('-', '_')}_{trial.score.estimator}"

    def fails_alike(case: Case) -> bool:
        folder = run_variants(trial, {trial.score.case: case}, name=suite_name, run_plan=run_plan)
        score, *_ = folder.scores()
        return failure.is_in(folder, score)

    first = trial.case.frames[0] if trial.case.frames else 0
    stamps_ns = body_motion(trial.case).t_ns.tolist()
    whole = (first, first + len(stamps_ns))
    is_likely = _likely_windows(trial, dict(enumerate(stamps_ns, first)), failure)
    nuisances = [nuisance for nuisance in nuisances_of(trial.case) if not nuisance.is_circumstance]
    return shrink(trial.case, whole, is_likely=is_likely, nuisances=nuisances, fails=fails_alike, trials=trials)


def _likely_windows(
    trial: FinishedTrial,
    stamps_ns: dict[int, int],
    failure: TrialFailure,
) -> Callable[[Window], bool]:
    """Return a test of whether the estimator is likely to fail in the same way on a window of frames.

    Nothing is run for it: the poses that the trial has in the window are scored by themselves. If those of the whole
    trial do not show the failure (for example after a crash), the window must contain the first frame without a pose
    instead. `stamps_ns` are the stamps of all frames of the trajectory, including dropped ones.
    """
    paths = read_paths(trial.folder, trial.score)

    def fails_alike_in(window: Window) -> bool:
        part = _part(paths, first_ns=stamps_ns[window[0]], last_ns=stamps_ns[window[1] - 1])
        if len(part.gt) < MIN_FRAMES:
            return False
        return failure.is_in_part(trial, part)

    whole = (min(stamps_ns), max(stamps_ns) + 1)
    if fails_alike_in(whole):
        return fails_alike_in

    failed_ns = _first_without_pose_ns(trial, paths)
    return lambda window: stamps_ns[window[0]] <= failed_ns <= stamps_ns[window[1] - 1]


def _first_without_pose_ns(trial: FinishedTrial, paths: TrialPaths) -> int:
    """The stamp of the first frame without a pose; of the first frame if all have one."""
    for row in read_frames(trial.path):
        if row.status in WITHOUT_POSE:
            return row.t_ns
    return int(paths.gt.t_ns[0])


def _part(paths: TrialPaths, *, first_ns: int, last_ns: int) -> TrialPaths:
    """The poses of both paths from one stamp to another, including both."""
    gt = between(paths.gt, first_ns, last_ns)
    est = between(paths.est, first_ns, last_ns)
    return TrialPaths(gt, est, paths.scale)
