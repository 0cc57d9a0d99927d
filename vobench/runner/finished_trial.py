"""Reads a trial of a finished run, and runs the same estimator on variants of its case."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import ValidationError

from vobench.errors import InputError, UnknownNameError, require_known
from vobench.runner.folder import (
    CASE,
    ESTIMATORS,
    NO_SEQUENCE,
    SCORE,
    SUITE,
    RunFolder,
    TrialScore,
    open_run,
    read_score,
)
from vobench.runner.key import folder_digest
from vobench.runner.motion import body_motions
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.store import SILENT, Progress
from vobench.suite import catalog
from vobench.suite.case import Case
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.manifest import read_manifest
from vobench.suite.plan import Plan
from vobench.suite.suite_spec import Suite
from vobench.suite.yaml_file import checked
from vobench.suite.yaml_source import Mistakes, YamlFile

# The number of levels from the folder of a trial, RUN/cases/CASE/estimates/ESTIMATOR/REPEAT, to that of its run.
LEVELS_TO_RUN = 5


@dataclass(frozen=True, slots=True)
class FinishedTrial:
    """A trial of a run, with everything needed to repeat it: its case, its estimator and the suite of the run."""

    folder: RunFolder
    score: TrialScore
    case: Case
    estimator_entry: EstimatorEntry
    suite: Suite

    @property
    def path(self) -> Path:
        """The folder with the files of this trial."""
        return self.folder.estimate(self.score.case, self.score.estimator, self.score.repeat)


def read_finished_trial(path: Path, *, estimator: Path | None = None, progress: Progress = SILENT) -> FinishedTrial:
    """Read the trial RUN/CASE/ESTIMATOR or RUN/CASE/ESTIMATOR/REPEAT, or the trial in a folder of the run.

    `estimator` is the folder of the estimator, if it cannot be found by its name. `progress` gets a note if the
    estimator has changed since the run.

    Raises InputError and UnknownNameError if there is no such trial, if the case is a recording, which cannot be
    changed, or if another version of vobench wrote the run.
    """
    folder, score = _find(path)
    if score.status == NO_SEQUENCE:
        raise InputError(f"'{score.case}' has no sequence, as it could not be made: {score.reason}")
    case = read_simulated_case(folder, score.case)
    estimator_entry = _read_estimator_entry(folder, score.estimator, estimator, progress)
    return FinishedTrial(folder, score, case, estimator_entry, _read_suite(folder))


def _find(path: Path) -> tuple[RunFolder, TrialScore]:
    """The run and the score of the trial at a path: the folder of a trial, or RUN/CASE/ESTIMATOR[/REPEAT]."""
    if (path / SCORE).is_file() and len(path.parts) > LEVELS_TO_RUN:
        return RunFolder(path.parents[LEVELS_TO_RUN - 1]), read_score(path / SCORE)

    repeat = int(path.name) if path.name.isdigit() else None
    named = path if repeat is None else path.parent
    if len(named.parts) < 2:
        raise InputError(f"a trial is named as RUN/CASE/ESTIMATOR, got {path}")
    *run, case, estimator = named.parts

    folder = open_run(Path(*run))
    scores = folder.scores()
    _require_in_run("case", case, {score.case for score in scores}, folder)
    _require_in_run("estimator", estimator, {score.estimator for score in scores}, folder)
    trials = [score for score in scores if (score.case, score.estimator) == (case, estimator)]
    for score in sorted(trials, key=lambda score: score.repeat):
        if repeat in (None, score.repeat):
            return folder, score
    number = "trial" if repeat is None else f"repeat {repeat}"
    raise InputError(f"there is no {number} of {estimator} on {case} in the run {folder.path}")


def _require_in_run(kind: str, name: str, known: set[str], folder: RunFolder) -> None:
    """Raise UnknownNameError with the run unless the name of a case or an estimator is known in it."""
    try:
        require_known(kind, name, sorted(known))
    except UnknownNameError as error:
        raise UnknownNameError(f"{error} in the run {folder.path}") from None


def read_simulated_case(folder: RunFolder, name: str) -> Case:
    """Read a simulated case of a run. Raises InputError for a recording, or if another version wrote the file."""
    path = folder.case(name) / CASE
    content = json.loads(path.read_bytes())
    if "source" in content:
        raise InputError(f"'{name}' is a recording, so it cannot be simulated with changes: {path}")
    try:
        return checked(Case, content)
    except ValidationError as error:
        key = ".".join(map(str, error.errors()[0]["loc"]))
        raise InputError(f"of another vobench, whose cases this one cannot read ({key}): {path}") from None


def _read_suite(folder: RunFolder) -> Suite:
    path = folder.path / SUITE
    try:
        return checked(Suite, json.loads(path.read_bytes()))
    except ValidationError:
        raise InputError(f"of another vobench, whose suites this one cannot read: {path}") from None


def _read_estimator_entry(folder: RunFolder, label: str, path: Path | None, progress: Progress) -> EstimatorEntry:
    """The estimator with the parameters, limits and mode of the run. Raises UnknownNameError if it is not found."""
    listed = json.loads((folder.path / ESTIMATORS).read_bytes())
    facts = next(entry for entry in listed if entry["label"] == label)
    place = path or catalog.find("estimator", facts["name"]).path
    manifest = read_manifest(place)
    if folder_digest(place) != facts["code"]:
        progress.say(f"{place} has changed since the run, whose {label} this is")
    limits = replace(manifest.limits, **facts["limits"])
    return EstimatorEntry(label, place, manifest, facts["params"], limits, facts["mode"])


def run_variants(trial: FinishedTrial, cases: Mapping[str, Case], *, name: str, run_plan: PlanRunner) -> RunFolder:
    """Run the estimator of a trial once on each of the given cases, which are renamed to their keys.

    `name` is the name of the suite of the new run. Raises SuiteError if one of the cases cannot be simulated.
    """
    named = tuple(replace(case, name=key, repeat=0, repeat_of=None) for key, case in cases.items())
    suite = replace(trial.suite, name=name, repeats=1)
    source = YamlFile(trial.folder.path / SUITE, {})
    plan = Plan(suite, named, (), (trial.estimator_entry,), (), source)

    mistakes = Mistakes(source)
    with mistakes.at():
        body_motions(plan)
    mistakes.require_none()
    return run_plan(plan)
