"""The estimates of several estimators on one case with their scores, from a run or from files, for figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from vobench.errors import InputError
from vobench.metric.comparison import DEFAULTS
from vobench.metric.score import Score
from vobench.metric.settings import ScoreSettings
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import NOT_APPLICABLE, RunFolder, TrialScore, read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.score import score_estimate
from vobench.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vobench.runner.trajectory_pair import TrajectorySource


@dataclass(frozen=True, slots=True)
class ScoredEstimate:
    """An estimate with its score. `score` is None if nothing could be scored; `status` is empty if it is unknown.

    `index` chooses the colour, so that an estimator has the same one in all figures.
    """

    estimator: str
    index: int
    score: Score | None
    status: str = ""

    @property
    def label(self) -> str:
        """The name of the estimator, followed by the status of a trial that did not succeed or has no score."""
        succeeded = self.status in ("", "ok") and self.score is not None
        if succeeded:
            return self.estimator
        return f"{self.estimator} ({self.status or 'no pose'})"


@dataclass(frozen=True, slots=True)
class ScoredCase:
    """The ground truth of a case, and the estimates of all estimators."""

    name: str
    truth: Trajectory
    estimates: tuple[ScoredEstimate, ...]

    @property
    def scores(self) -> list[tuple[ScoredEstimate, Score]]:
        """The estimates that have a score, with their scores."""
        return [(estimate, estimate.score) for estimate in self.estimates if estimate.score is not None]


def scored_case(folder: RunFolder, trials: Sequence[TrialScore], index_of: Mapping[str, int]) -> ScoredCase:
    """The trials of one case of a run. Of several repeats of an estimator, the one with the median error is chosen.

    Estimators that the case is not for, since it lacks a sensor that they need, are left out. `index_of` has the index
    of each estimator. Raises InputError if no trial is left.
    """
    applicable = [trial for trial in trials if trial.status != NOT_APPLICABLE]
    if not applicable:
        raise InputError("there is no trial to plot")
    case = applicable[0].case
    truth = read_tum(folder.case(case) / GROUND_TRUTH)
    estimates = []
    for estimator in sorted({trial.estimator for trial in applicable}, key=index_of.__getitem__):
        trial = _median_trial([trial for trial in applicable if trial.estimator == estimator])
        place = folder.estimate(case, estimator, trial.repeat)
        score = score_estimate(read_tum(place / ESTIMATE), truth, trial.claims)
        estimates.append(ScoredEstimate(estimator, index_of[estimator], score, trial.status))
    return ScoredCase(case, truth, tuple(estimates))


def _median_trial(trials: Sequence[TrialScore]) -> TrialScore:
    """The trial with the median position error; trials without an error count as the worst."""
    by_error = sorted(trials, key=_position_error_m)
    return by_error[(len(by_error) - 1) // 2]


def _position_error_m(trial: TrialScore) -> float:
    error_m = trial.value("ate_trans", "rmse")
    return inf if error_m is None else error_m


def scored_files(
    truth: "TrajectorySource",
    estimates: Sequence["TrajectorySource"],
    *,
    settings: ScoreSettings = DEFAULTS,
    times: Sequence[Path] = (),
) -> ScoredCase:
    """Files of estimates with one file of ground truth; the names of the files become those of the estimators.

    Raises:
        InputError: A file cannot be read, or does not fit the ground truth.
        AlignmentError: An estimate cannot be compared as asked.
    """
    from vobench.runner.score_files import FilePair, score_files
    from vobench.runner.trajectory_pair import read_pair

    if not estimates:
        raise InputError(f"there is no estimate to plot beside {truth.path}; name one or more files after it")
    labels = file_labels([estimate.path for estimate in estimates])
    scored = []
    for index, (label, estimate) in enumerate(zip(labels, estimates, strict=True)):
        files = score_files([FilePair(truth, estimate)], settings=settings, times=times)
        scored.append(ScoredEstimate(label, index, files.scores[0]))
    gt = read_pair(truth, estimates[0], times=times).gt.trajectory
    return ScoredCase(truth.path.stem, gt, tuple(scored))


def file_labels(paths: Sequence[Path]) -> list[str]:
    """The shortest ends of paths, without the suffix of the file, that are all different."""
    parts = [path.with_suffix("").parts for path in paths]
    for length in range(1, max(map(len, parts)) + 1):
        labels = ["/".join(part[-length:]) for part in parts]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{path.with_suffix('')} ({number})" for number, path in enumerate(paths, 1)]
