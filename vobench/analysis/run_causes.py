"""Finds the conditions on which the errors of a run depend, by a regression for each estimator."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.analysis.causes import Attribution, ErrorSeries, attribute
from vobench.analysis.conditions import CONDITIONS
from vobench.analysis.trial_data import read_conditions, read_error_series
from vobench.errors import require_known
from vobench.geometry.se3 import Array
from vobench.runner.data_frame import data_frame
from vobench.runner.finished_trial import read_simulated_case
from vobench.runner.folder import RunFolder, TrialScore, open_run, with_sequence
from vobench.runner.store import SILENT, Progress

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame

WORST_SEGMENTS = 8  # the default number of segments that are listed


@dataclass(frozen=True, slots=True)
class EstimatorCauses:
    """One estimator of a run: the errors of its trials, and the conditions on which they depend.

    `statuses` are those of the trials in `courses`. `attribution` is None if there are too few frames for a
    regression, or if no condition varies.
    """

    estimator: str
    statuses: tuple[str, ...]
    courses: tuple[ErrorSeries, ...]
    attribution: Attribution | None

    def trials(self) -> list[dict[str, Any]]:
        """One row per trial: its case, repeat and status, and the frame at which it diverges."""
        rows = []
        for status, course in zip(self.statuses, self.courses, strict=True):
            row = {"case": course.case, "repeat": course.repeat, "status": status}
            rows.append({**row, "first_divergence_frame": course.first_divergence})
        return rows

    def as_dict(self, *, worst: int = WORST_SEGMENTS) -> dict[str, Any]:
        """Plain JSON values, with the `worst` segments of the largest error."""
        facts: dict[str, Any] = {"estimator": self.estimator, "trials": self.trials()}
        attribution = self.attribution
        if attribution is None:
            return facts

        factors_of_cases = {}
        for case, factors in attribution.cases.items():
            factors_of_cases[case] = [[cause.conditions, factor] for cause, factor in factors]
        return {
            **facts,
            "explained": attribution.explained,
            "causes": [asdict(cause) for cause in attribution.causes],
            "constant": attribution.constant,
            "cases": factors_of_cases,
            "worst": [asdict(segment) for segment in attribution.segments[:worst]],
        }


@dataclass(frozen=True, slots=True)
class RunCauses:
    """The conditions on which the errors of a run depend, by estimator."""

    run: Path
    estimators: tuple[EstimatorCauses, ...]

    def as_dict(self, *, worst: int = WORST_SEGMENTS) -> dict[str, Any]:
        """Plain JSON values, as `vobench causes --json` prints them."""
        estimators = [each.as_dict(worst=worst) for each in self.estimators]
        return {"run": str(self.run), "conditions": CONDITIONS, "estimators": estimators}

    def to_frame(self) -> "DataFrame":
        """A pandas table with one row per estimator and cause, the strongest cause first.

        `factor` multiplies the error from low to high values of the condition; `low` and `high` are its 95 % interval.
        """
        rows = []
        for each in self.estimators:
            for cause in each.attribution.causes if each.attribution else ():
                conditions = " + ".join(cause.conditions)
                rows.append({"estimator": each.estimator, **asdict(cause), "conditions": conditions})
        return data_frame(rows)


def find_causes(
    run: Path,
    *,
    estimator: str | None = None,
    progress: Progress = SILENT,
) -> RunCauses:
    """Find the conditions on which the errors of each estimator of a run depend, or those of one estimator.

    Raises:
        InputError: the folder is not of a run, a case is a recording, or its sequence is no longer in the cache.
        UnknownNameError: the run has no estimator of this name.
    """
    folder = open_run(run)
    scores = with_sequence(folder.scores())
    estimators = sorted({score.estimator for score in scores})
    if estimator is not None:
        require_known("estimator", estimator, estimators)
        estimators = [estimator]

    cases = sorted({score.case for score in scores})
    conditions_of_cases = {}
    for case in progress.track(cases, "look at", total=len(cases)):
        conditions_of_cases[case] = read_conditions(folder, read_simulated_case(folder, case))

    causes = []
    for name in estimators:
        trials = [score for score in scores if score.estimator == name and score.frames]
        causes.append(_causes_of(folder, name, trials, conditions_of_cases))
    return RunCauses(folder.path, tuple(causes))


def _causes_of(
    folder: RunFolder,
    estimator: str,
    trials: Sequence[TrialScore],
    conditions_of_cases: Mapping[str, Mapping[str, Array]],
) -> EstimatorCauses:
    """The causes of one estimator. `conditions_of_cases` are those of frames, by case."""
    courses = tuple(read_error_series(folder, score, conditions_of_cases[score.case]) for score in trials)
    statuses = tuple(score.status for score in trials)
    return EstimatorCauses(estimator, statuses, courses, attribute(courses))
