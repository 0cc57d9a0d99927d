"""A run of a suite: its tasks are performed, and what a person reads is gathered in one folder."""

import platform
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZipFile

from vobench import __version__, stop
from vobench.estimator.program import sandbox_works
from vobench.runner.consistency import COVARIANCE
from vobench.runner.entry import copy_files
from vobench.runner.estimate import ESTIMATE, LOG, REVISED, TRACKS
from vobench.runner.executor import Done, Event, Executor, perform_all
from vobench.runner.folder import (
    CASE,
    ENVIRONMENT,
    ESTIMATORS,
    SCORE,
    SEQUENCE,
    SUITE,
    RunFolder,
    TrialScore,
    make_run,
    read_score,
    write_hashes,
)
from vobench.runner.frames import COLUMNS, FRAMES, GROUND_TRUTH, TIME_COLUMNS, TIMES, new_table
from vobench.runner.ground_truth import scored_truth
from vobench.runner.key import digest, folder_digest, library_versions
from vobench.runner.simulate import LIBRARIES
from vobench.runner.store import Store, Tell, write_json
from vobench.runner.task import Task, missing, plan
from vobench.sequence import read_import_notes
from vobench.suite.source import RecordedCase
from vobench.suite.suite import Case, Entrant, Plan
from vobench.suite.yaml_file import plain

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording

Finish = Callable[[RunFolder, list[TrialScore]], None]
OF_ESTIMATE, OF_SCORE = (ESTIMATE, TRACKS, LOG, TIMES, COVARIANCE, REVISED), (SCORE, FRAMES)
OPTIONAL = (COVARIANCE, REVISED)
# How the cost of estimators was taken that were run this time.
ALONE, BESIDE = "with nothing beside it", "beside other tasks"


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
    heard: Callable[[Event], object] = lambda _: None,
    tell: Tell = lambda _: None,
) -> RunFolder:
    """Run every case, estimator and repeat; what the store holds already is not made again.

    `finish` adds reports to the folder before it gets its final name under `root`. A cell whose task fails has a row
    that says why. `is_fresh` makes all of it anew. `executor`, `shares_time` (which the suite may ask for itself)
    and `heard` are those of `perform_all`; `tell` is given sentences on the store, say of a result that was damaged.
    """
    tasks = plan(suite, recordings)
    kept = Store(store)
    with kept.in_use(tell):
        if is_fresh:
            kept.require_writable()
            kept.forget(task.key for task in tasks)
        to_make = missing(tasks, store)
        if to_make:
            kept.require_writable()
            kept.set_aside_damaged((task.key for task in to_make), tell)
        shares_time = shares_time or suite.suite.share_time
        failures = perform_all(to_make, store, executor, shares_time=shares_time, heard=heard)
        cases = {case.name: case for case in suite.cases}
        stated = plain(suite.suite)
        entrants = [_entrant_facts(entrant) for entrant in suite.entrants]

        def fill(folder: RunFolder) -> None:
            write_json(folder.path / SUITE, stated)
            write_json(folder.path / ESTIMATORS, entrants)
            write_json(folder.path / ENVIRONMENT, {**_environment(), "timed": BESIDE if shares_time else ALONE,
                       "sandboxed": sandbox_works()})  # fmt: skip
            scores = [task for task in tasks if task.stage == "score"]
            finish(folder, [_gather(task, cases, store, folder, failures.get(task.key)) for task in scores])
            write_hashes(folder)

        return make_run(root, suite.suite.name, digest({"suite": stated, "estimators": entrants}), fill)


def _gather(
    task: Task, cases: Mapping[str, Case | RecordedCase], store: Path, folder: RunFolder, failure: Done | None
) -> TrialScore:
    """Copy a trial's files out of the store, and its case's before the first of them."""
    stop.check()
    sequence, estimate = (store / key for key in task.needs)
    case = task.inputs["case"]
    if not folder.case(case).is_dir():
        _gather_case(cases[case], sequence, folder.case(case))
    if failure:
        return _write_failed(task, failure, folder)
    score = read_score(store / task.key / SCORE)
    target = folder.estimate(score.case, score.estimator, score.repeat)
    target.mkdir(parents=True)
    for place, names in ((estimate, OF_ESTIMATE), (store / task.key, OF_SCORE)):
        copy_files(place, [name for name in names if name not in OPTIONAL or (place / name).is_file()], target)
    return score


def _write_failed(task: Task, failure: Done, folder: RunFolder) -> TrialScore:
    """The row of a cell that came to no score."""
    score = TrialScore(
        case=task.inputs["case"],
        variant=task.inputs["variant"],
        estimator=task.inputs["estimator"],
        repeat=task.inputs["repeat"],
        status=failure.failure or "crashed",
        reason=failure.reason,
        coverage=0.0,
        frames=0,
        path_m=0.0,
        score=None,
        claims=task.inputs["claims"],
    )
    target = folder.estimate(score.case, score.estimator, score.repeat)
    target.mkdir(parents=True)
    write_json(target / SCORE, score.model_dump(mode="json"))
    (target / ESTIMATE).touch()
    (target / LOG).write_text(f"{failure.reason}\n{failure.stack}", encoding="utf-8")
    with new_table(target / FRAMES, COLUMNS), new_table(target / TIMES, TIME_COLUMNS), ZipFile(target / TRACKS, "w"):
        return score


def _gather_case(case: Case | RecordedCase, sequence: Path, target: Path) -> None:
    target.mkdir(parents=True)
    # Of a recording: all that its import assumed, converted or dropped.
    is_made = sequence.is_dir()
    assumed = {"import": read_import_notes(sequence)} if is_made and isinstance(case, RecordedCase) else {}
    write_json(target / CASE, {**plain(case), **assumed})
    if not is_made:
        return
    copy_files(sequence, [GROUND_TRUTH], target)
    exact = (target / GROUND_TRUTH).read_text(encoding="utf-8")
    (target / GROUND_TRUTH).write_text(scored_truth(exact, case), encoding="utf-8")
    (target / SEQUENCE).symlink_to(sequence.resolve())


def _entrant_facts(entrant: Entrant) -> dict[str, Any]:
    manifest = entrant.manifest
    return {
        "label": entrant.label,
        "name": manifest.name,
        "version": manifest.version,
        "params": entrant.params,
        "limits": asdict(entrant.limits),
        "mode": entrant.mode,
        "code": folder_digest(entrant.folder),
    }


def _environment() -> dict[str, object]:
    return {
        "vobench": __version__,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "libraries": library_versions(*LIBRARIES, "pandas", "rerun-sdk"),
    }
