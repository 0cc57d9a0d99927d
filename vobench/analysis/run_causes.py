"""Finds the conditions on which the errors of a run depend, by a regression for each estimator."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.analysis.causes import Attribution, Cause, ErrorSeries, attribute, reason_for_no_answer
from vobench.analysis.conditions import CONDITIONS, SYMPTOMS
from vobench.analysis.trial_data import read_conditions, read_error_series, read_symptoms
from vobench.errors import require_known
from vobench.geometry.se3 import Array
from vobench.runner.data_frame import data_frame
from vobench.runner.finished_trial import read_simulated_case
from vobench.runner.folder import ORACLE, TRUTH_COPY, RunFolder, TrialScore, open_run, with_sequence
from vobench.runner.store import SILENT, Progress

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame

BASELINE = "baseline"  # the claim of estimators that are no competitors
# Why nothing is said about the errors of an estimator with one of these claims.
UNEXPLAINED_CLAIMS = {
    ORACLE: "it is given the ground truth, so its errors are drawn, not caused",
    BASELINE: "it is a baseline, which does not react to what it sees",
    TRUTH_COPY: "its estimate equals the ground truth, so it has no errors to explain",
}
WORST_SEGMENTS = 8  # the default number of segments that are listed


@dataclass(frozen=True, slots=True)
class EstimatorCauses:
    """One estimator of a run: the errors of its trials, and the conditions on which they depend.

    `statuses` are those of the trials in `courses`. `attribution` is None if nothing can be said, for the `reason`.
    `symptoms` are what the estimator itself reports, each with the factor by which it goes with the error.
    """

    estimator: str
    statuses: tuple[str, ...]
    courses: tuple[ErrorSeries, ...]
    attribution: Attribution | None
    reason: str = ""
    symptoms: tuple[Cause, ...] = ()

    @property
    def has_one_drive(self) -> bool:
        """Whether all cases share a drive, so that a cause on it cannot be told from the time since the start."""
        return len({course.drive or course.case for course in self.courses}) == 1

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
            return {**facts, "reason": self.reason}

        factors_of_cases = {}
        for case, factors in attribution.cases.items():
            factors_of_cases[case] = [[cause.conditions, factor] for cause, factor in factors]
        return {
            **facts,
            "explained": attribution.explained,
            "is_mostly_unexplained": attribution.is_mostly_unexplained,
            "named": [cause.conditions for cause in attribution.named],
            "causes": [asdict(cause) for cause in attribution.causes],
            "symptoms": [asdict(symptom) for symptom in self.symptoms],
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
        return {"run": str(self.run), "conditions": {**CONDITIONS, **SYMPTOMS}, "estimators": estimators}

    def to_frame(self) -> "DataFrame":
        """A pandas table with one row per estimator and cause, the strongest cause first.

        `factor` multiplies the error from low to high values of the condition; `low` and `high` are its 95 % interval,
        and `p` is corrected for the number of conditions.
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
    claims = {claim for score in trials for claim in score.claims}
    for claim, sentence in UNEXPLAINED_CLAIMS.items():
        if claim in claims:
            return EstimatorCauses(estimator, statuses, courses, None, sentence)

    reason = reason_for_no_answer(courses)
    if reason:
        return EstimatorCauses(estimator, statuses, courses, None, reason)
    symptoms = _symptoms(courses, [read_symptoms(folder, score) for score in trials])
    return EstimatorCauses(estimator, statuses, courses, attribute(courses), symptoms=symptoms)


def _symptoms(courses: Sequence[ErrorSeries], reported: Sequence[Mapping[str, Array]]) -> tuple[Cause, ...]:
    """How the error goes with what the estimator reports in all trials, besides the conditions.

    It is not among the conditions when their causes are sought: what hides the points also causes the error.
    """
    if not all(reported):
        return ()
    extended = []
    for course, symptoms in zip(courses, reported, strict=True):
        extended.append(replace(course, conditions={**course.conditions, **symptoms}))
    attribution = attribute(extended)
    causes = attribution.causes if attribution else ()
    return tuple(cause for cause in causes if set(cause.conditions) & set(SYMPTOMS))
