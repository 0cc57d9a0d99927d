"""Runs a suite: performs its tasks, and writes the results to one folder."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZipFile

from vobench import stop
from vobench.errors import NoSequenceError
from vobench.estimator.program import sandbox_works
from vobench.estimator.readable_folders import note_on_unopened
from vobench.portable import require_held
from vobench.runner.consistency import COVARIANCE
from vobench.runner.entry import copy_files
from vobench.runner.environment import environment, joined, read_origin
from vobench.runner.estimate import ESTIMATE, LOG, REVISED, TRACKS
from vobench.runner.executor import Executor, TaskEvent, TaskOutcome, perform_all
from vobench.runner.folder import (
    CASE,
    ENVIRONMENT,
    ESTIMATORS,
    NO_SEQUENCE,
    SCORE,
    SEQUENCE,
    SUITE,
    RunFolder,
    TrialScore,
    TrialStatus,
    UnavailableCases,
    make_run,
    read_score,
    write_hashes,
)
from vobench.runner.frames import COLUMNS, FRAMES, GROUND_TRUTH, TIME_COLUMNS, TIMES, new_table
from vobench.runner.ground_truth import scored_truth
from vobench.runner.key import digest, folder_digest
from vobench.runner.store import Store, Tell, write_json
from vobench.runner.task import Task, missing, plan
from vobench.sequence import read_import_notes
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.plan import AnyCase, Plan
from vobench.suite.source import RecordedCase
from vobench.suite.yaml_file import plain

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording

Finish = Callable[[RunFolder, list[TrialScore]], None]
ESTIMATE_FILES = (ESTIMATE, TRACKS, LOG, TIMES)
SCORE_FILES = (SCORE, FRAMES)
OPTIONAL_FILES = (COVARIANCE, REVISED)  # files that only some estimates have
# The remedies for sequences that could not be created. A refusal contains its own remedy.
REMEDIES: dict[str, str] = {
    "crashed": " (`vobench doctor` checks what this machine lacks)",
    "out_of_memory": " (run fewer tasks at once, as with --jobs 1)",
}
# How the costs of estimators were measured.
ALONE = "with nothing beside it"
BESIDE = "beside other tasks"


def run_suite(
    suite: Plan,
    recordings: "Mapping[str, Recording]",
    *,
    root: Path,
    store: Path,
    finish: Finish,
    executor: Executor,
    shares_time: bool = False,
    is_fresh: bool = False,
    begin: Callable[[Sequence[Task]], object] = lambda _: None,
    require_all: bool = False,
    on_event: Callable[[TaskEvent], object] = lambda _: None,
    tell: Tell = lambda _: None,
) -> RunFolder:
    """Run all cases, estimators and repeats. Results in the store are reused.

    A trial that fails has a row with the reason. A case that could not be simulated or imported is in `unmade()` of the
    folder. Its trials have the status `no_sequence`, and count for no estimator.

    `recordings` are the recordings of the recorded cases.
    `root` is the folder in which the folder of the run is created.
    `store` is the folder of the store.
    `finish` adds reports to the folder before it gets its final name below `root`.
    `executor` performs the tasks.
    `shares_time` is whether other tasks may run beside an estimator. The suite can also set it.
    `is_fresh` is whether results in the store are ignored.
    `begin` is called with the tasks that will be performed.
    `require_all` is whether one case that could not be simulated or imported is enough for a NoSequenceError.
    `on_event` is called with each event of a task.
    `tell` is called with sentences about the store, for example about a damaged result, and about folders that the
    sandbox does not open.

    Raises NoSequenceError if no case could be simulated or imported. No folder is created then.
    Raises MissingDependencyError if a library is missing.
    Raises InputError if the disk is full.
    """
    require_held()
    if unopened := note_on_unopened():
        tell(unopened)
    tasks = plan(_with_hidden_truth(suite, root), recordings)
    scores = [task for task in tasks if task.stage == "score"]
    results = Store(store)
    with results.in_use(tell):
        if is_fresh:
            results.require_writable()
            results.forget(task.key for task in tasks)
        pending = missing(tasks, store)
        if pending:
            results.require_writable()
            results.set_aside_damaged((task.key for task in pending), tell)
        shares_time = shares_time or suite.suite.share_time
        begin(pending)
        failures = perform_all(pending, store, executor, shares_time=shares_time, on_event=on_event)
        gathering = _Gathering(suite, store, scores, failures)
        gathering.require_sequences(require_all=require_all)

        def fill(folder: RunFolder) -> None:
            trials = gathering.write(folder, timed=BESIDE if shares_time else ALONE)
            finish(folder, trials)
            write_hashes(folder)

        return make_run(root, suite.suite.name, digest(gathering.identity), fill)


def _with_hidden_truth(suite: Plan, root: Path) -> Plan:
    """The plan, in which the runs below `root` and all recordings of the suite are hidden, as they contain truth."""
    hidden = [root.resolve()]
    for case in suite.recorded:
        if case.source.path:
            hidden.append(Path(case.source.path).resolve())
        if case.source.truth:
            hidden.append(Path(case.source.truth).resolve())
    return replace(suite, hidden=(*suite.hidden, *hidden))


class _Gathering:
    """Copies the results of a run from the store to its folder."""

    def __init__(self, suite: Plan, store: Path, scores: Sequence[Task], failures: Mapping[str, TaskOutcome]) -> None:
        self._store = store
        self._scores = scores
        self._failures = failures
        self._cases = {case.name: case for case in suite.cases}
        self._failed_cases = _failed_cases(scores, failures)
        estimators = [_estimator_facts(entry) for entry in suite.estimator_entries]
        self.identity = {"suite": plain(suite.suite), "estimators": estimators}

    def require_sequences(self, *, require_all: bool) -> None:
        """Raise NoSequenceError if no case has a sequence. With `require_all`, one missing sequence is enough."""
        cases = {task.inputs["case"] for task in self._scores}
        _require_sequences(self._failed_cases, cases, require_all=require_all)

    def write(self, folder: RunFolder, *, timed: str) -> list[TrialScore]:
        """Write the files of the run, its cases and its trials, and return the scores of the trials."""
        origin = joined(read_origin(self._store / task.key) for task in self._scores)
        write_json(folder.path / SUITE, self.identity["suite"])
        write_json(folder.path / ESTIMATORS, self.identity["estimators"])
        write_json(folder.path / ENVIRONMENT, environment(origin, timed=timed, sandboxed=sandbox_works()))
        return [_gather(task, self._cases, self._store, folder, self._failure(task)) for task in self._scores]

    def _failure(self, task: Task) -> "_Failure | None":
        """The failure of a trial without a score; None if it has one."""
        failed_case = self._failed_cases.get(task.inputs["case"])
        if failed_case:
            return failed_case
        outcome = self._failures.get(task.key)
        if outcome is None:
            return None
        return _Failure(outcome.failure or "crashed", outcome.reason, outcome.stack)


@dataclass(frozen=True, slots=True)
class _Failure:
    """The status and the reason of a trial without a score, and the stack of a process that ended by a fault."""

    status: TrialStatus
    reason: str
    stack: str = ""


def _failed_cases(scores: Iterable[Task], failures: Mapping[str, TaskOutcome]) -> dict[str, _Failure]:
    """The failures of cases without a sequence, by name."""
    failed_cases = dict[str, _Failure]()
    for task in scores:
        sequence, _ = task.needs
        if sequence in failures:
            outcome = failures[sequence]
            remedy = REMEDIES.get(outcome.failure or "crashed", "")
            reason = f"{outcome.reason}{remedy}"
            failed_cases[task.inputs["case"]] = _Failure(NO_SEQUENCE, reason, outcome.stack)
    return failed_cases


def _require_sequences(failed_cases: Mapping[str, _Failure], cases: Collection[str], *, require_all: bool) -> None:
    """Raise NoSequenceError if no case has a sequence. With `require_all`, one missing sequence is enough."""
    if not failed_cases:
        return
    all_failed = len(failed_cases) == len(cases)
    if not all_failed and not require_all:
        return
    cases_by_cause = dict[str, list[str]]()
    for case, failure in failed_cases.items():
        cases_by_cause.setdefault(failure.reason, []).append(case)
    causes = [f"{UnavailableCases(cause, tuple(names)).names}: {cause}" for cause, names in cases_by_cause.items()]
    count = "no case" if all_failed else f"{len(failed_cases)} of {len(cases)} cases"
    negation = "" if all_failed else " not"
    raise NoSequenceError(
        f"{count} could{negation} be simulated or imported, so nothing was scored: {'; '.join(causes)}"
    )


def _gather(
    task: Task, cases: Mapping[str, AnyCase], store: Path, folder: RunFolder, failure: _Failure | None
) -> TrialScore:
    """Copy the files of a trial from the store, and before the first trial of a case, those of the case."""
    stop.check()
    sequence_key, estimate_key = task.needs
    sequence = store / sequence_key
    estimate = store / estimate_key
    case = task.inputs["case"]
    if not folder.case(case).is_dir():
        _gather_case(cases[case], sequence, folder.case(case))
    if failure:
        return _write_failed(task, failure, folder)
    score = read_score(store / task.key / SCORE)
    target = folder.estimate(score.case, score.estimator, score.repeat)
    target.mkdir(parents=True)
    optional_files = [name for name in OPTIONAL_FILES if (estimate / name).is_file()]
    copy_files(estimate, [*ESTIMATE_FILES, *optional_files], target)
    copy_files(store / task.key, SCORE_FILES, target)
    return score


def _write_failed(task: Task, failure: _Failure, folder: RunFolder) -> TrialScore:
    """Write the files of a trial without a score."""
    score = TrialScore(
        case=task.inputs["case"],
        variant=task.inputs["variant"],
        estimator=task.inputs["estimator"],
        repeat=task.inputs["repeat"],
        status=failure.status,
        reason=failure.reason,
        coverage=0.0,
        frames=0,
        path_m=0.0,
        score=None,
        claims=task.inputs["claims"],
        sensors=task.inputs["sensors"],
    )
    target = folder.estimate(score.case, score.estimator, score.repeat)
    target.mkdir(parents=True)
    write_json(target / SCORE, score.model_dump(mode="json"))
    (target / ESTIMATE).touch()
    (target / LOG).write_text(f"{failure.reason}\n{failure.stack}", encoding="utf-8")
    for table, columns in ((FRAMES, COLUMNS), (TIMES, TIME_COLUMNS)):
        with new_table(target / table, columns):
            pass  # no rows
    with ZipFile(target / TRACKS, "w"):
        pass  # no tracks
    return score


def _gather_case(case: AnyCase, sequence: Path, target: Path) -> None:
    """Write the files of a case to the folder `target`, with a link to the folder `sequence` if it exists."""
    target.mkdir(parents=True)
    has_sequence = sequence.is_dir()
    settings = plain(case)
    if has_sequence and isinstance(case, RecordedCase):
        settings["import"] = read_import_notes(sequence)  # what the import assumed, converted or dropped
    write_json(target / CASE, settings)
    if not has_sequence:
        return
    copy_files(sequence, [GROUND_TRUTH], target)
    ground_truth = target / GROUND_TRUTH
    exact = ground_truth.read_text(encoding="utf-8")
    ground_truth.write_text(scored_truth(exact, case), encoding="utf-8")
    (target / SEQUENCE).symlink_to(sequence.resolve())


def _estimator_facts(estimator_entry: EstimatorEntry) -> dict[str, Any]:
    manifest = estimator_entry.manifest
    return {
        "label": estimator_entry.label,
        "name": manifest.name,
        "version": manifest.version,
        "params": estimator_entry.params,
        "limits": asdict(estimator_entry.limits),
        "mode": estimator_entry.mode,
        "code": folder_digest(estimator_entry.folder),
    }
