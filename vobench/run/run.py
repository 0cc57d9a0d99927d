"""A run of a suite: its tasks are performed one after another, and what a person reads is gathered in one folder."""

import platform
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from shutil import copyfile
from typing import TYPE_CHECKING, Any

from vobench import __version__, stop
from vobench.run.consistency import COVARIANCE
from vobench.run.estimate import ESTIMATE, LOG, REVISED, TRACKS
from vobench.run.folder import (
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
from vobench.run.frames import FRAMES, TIMES
from vobench.run.ground_truth import GROUND_TRUTH
from vobench.run.key import digest, folder_digest, library_versions
from vobench.run.simulate import LIBRARIES
from vobench.run.store import Progress, write_json
from vobench.run.task import Task, missing, perform, plan
from vobench.sequence import read_import_notes
from vobench.suite.source import RecordedCase
from vobench.suite.suite import Case, Entrant, Plan
from vobench.suite.yaml_file import plain

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording

Finish = Callable[[RunFolder, list[TrialScore]], None]
OF_ESTIMATE, OF_SCORE = (ESTIMATE, TRACKS, LOG, TIMES, COVARIANCE, REVISED), (SCORE, FRAMES)
OPTIONAL = (COVARIANCE, REVISED)


def run_suite(
    suite: Plan, recordings: "Mapping[str, Recording]", *, root: Path, store: Path, progress: Progress, finish: Finish
) -> RunFolder:
    """Run every case, estimator and repeat; what the store holds already is not made again.

    `finish` adds reports to the folder before it gets its final name under `root`.
    """
    tasks = plan(suite, recordings)
    for task in missing(tasks, store):
        perform(task, store, progress=progress)
    cases = {case.name: case for case in suite.cases}
    stated = plain(suite.suite)
    entrants = [_entrant_facts(entrant) for entrant in suite.entrants]

    def fill(folder: RunFolder) -> None:
        write_json(folder.path / SUITE, stated)
        write_json(folder.path / ESTIMATORS, entrants)
        write_json(folder.path / ENVIRONMENT, _environment())
        finish(folder, [_gather(task, cases, store, folder) for task in tasks if task.stage == "score"])
        write_hashes(folder)

    return make_run(root, suite.suite.name, digest({"suite": stated, "estimators": entrants}), fill)


def _gather(task: Task, cases: Mapping[str, Case | RecordedCase], store: Path, folder: RunFolder) -> TrialScore:
    """Copy a trial's files out of the store, and its case's before the first of them."""
    stop.check()
    sequence, estimate = (store / key for key in task.needs)
    score = read_score(store / task.key / SCORE)
    target = folder.estimate(score.case, score.estimator, score.repeat)
    if not folder.case(score.case).is_dir():
        _gather_case(cases[score.case], sequence, folder.case(score.case))
    target.mkdir(parents=True)
    for place, names in ((estimate, OF_ESTIMATE), (store / task.key, OF_SCORE)):
        for name in names:
            if name not in OPTIONAL or (place / name).is_file():
                copyfile(place / name, target / name)
    return score


def _gather_case(case: Case | RecordedCase, sequence: Path, target: Path) -> None:
    target.mkdir(parents=True)
    # Of a recording: all that its import assumed, converted or dropped.
    assumed = {"import": read_import_notes(sequence)} if isinstance(case, RecordedCase) else {}
    write_json(target / CASE, {**plain(case), **assumed})
    copyfile(sequence / GROUND_TRUTH, target / GROUND_TRUTH)
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
