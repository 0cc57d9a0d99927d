"""Explains why a trial fails by running its case again without each of its nuisances."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.analysis.explain import Change, Explanation, Outcome, explain, is_sufficient
from vobench.analysis.nuisance import NUISANCES, Nuisance, nuisances_of
from vobench.analysis.trial_data import read_conditions, read_outcome
from vobench.errors import InputError
from vobench.runner.data_frame import data_frame
from vobench.runner.finished_trial import FinishedTrial, read_finished_trial, run_variants
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.store import SILENT, Progress
from vobench.suite.case import Case

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame


@dataclass(frozen=True, slots=True)
class TrialExplanation:
    """Why an estimator fails on a case."""

    case: str
    estimator: str
    explanation: Explanation

    @property
    def named(self) -> tuple[str, ...]:
        """The nuisances that explain the failure; empty if none does."""
        return self.explanation.named

    def verdict(self, change: Change) -> str:
        """The effect of removing these nuisances: "mends it", "helps", "harms" or "no difference"."""
        if is_sufficient(change, self.explanation.everything):
            return "mends it"
        if change.is_sure:
            return "helps"
        if change.high < 0:
            return "harms"
        return "no difference"

    def rows(self) -> list[dict[str, Any]]:
        """One row per variant of the case: single nuisances removed, then pairs, then all of them.

        `loss` is the error without them; `mended`, `low` and `high` are the share of the error that went, with its
        95 % interval; `survived` of `repeats` trials ended well.
        """
        explanation = self.explanation
        changes = [*explanation.singles, *explanation.pairs]
        if len(explanation.everything.removed) > 1:
            changes.append(explanation.everything)
        return [self._row(change) for change in changes]

    def _row(self, change: Change) -> dict[str, Any]:
        instead = ""
        if len(change.removed) == 1:
            instead = _nuisance(change.removed[0]).instead
        return {**asdict(change), "instead": instead, "verdict": self.verdict(change)}

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench explain --json` prints them."""
        return {**asdict(self.explanation), "named": self.named}

    def to_frame(self) -> "DataFrame":
        """A pandas table of `rows`, with the names of the removed nuisances joined by " and "."""
        return data_frame({**row, "removed": " and ".join(row["removed"])} for row in self.rows())


def explain_trial(
    trial: Path,
    *,
    run_plan: PlanRunner,
    repeats: int = 3,
    estimator: Path | None = None,
    progress: Progress = SILENT,
) -> TrialExplanation:
    """Run a trial again without each nuisance of its case, and find which of them its error depends on.

    Args:
        trial: the trial as RUN/CASE/ESTIMATOR, or its folder in the run.
        run_plan: runs the variants of the case.
        repeats: how many seeds each variant is run with; short cases get more.
        estimator: the folder of the estimator, if it cannot be found by its name.
        progress: shows a note if the estimator has changed since the run.

    Raises:
        InputError: there is no such trial, it is of a recording, or its case has no nuisance.
        UnknownNameError: the run has no such case or estimator.
        SuiteError: a variant cannot be simulated.
    """
    finished = read_finished_trial(trial, estimator=estimator, progress=progress)
    nuisances = _present_nuisances(finished)
    suite_name = f"explain_{finished.score.case.replace('-', '_')}_{finished.score.estimator}"

    def measure(cases: Mapping[str, Case]) -> dict[str, list[Outcome]]:
        folder = run_variants(finished, cases, name=suite_name, run_plan=run_plan)
        return {score.case: [read_outcome(folder, score)] for score in folder.scores()}

    explanation = explain(finished.case, nuisances, measure, repeats=repeats)
    return TrialExplanation(finished.score.case, finished.score.estimator, explanation)


def _present_nuisances(trial: FinishedTrial) -> tuple[Nuisance, ...]:
    """The nuisances that the frames of a trial show. Raises InputError if there are none."""
    frame_conditions = read_conditions(trial.folder, trial.case)
    largest = {name: float(values.max()) for name, values in frame_conditions.items()}
    nuisances = nuisances_of(trial.case, largest)
    if not nuisances:
        known = ", ".join(nuisance.name for nuisance in NUISANCES)
        raise InputError(f"'{trial.case.name}' has nothing that can be removed. Known: {known}")
    return nuisances


def _nuisance(name: str) -> Nuisance:
    return next(nuisance for nuisance in NUISANCES if nuisance.name == name)
