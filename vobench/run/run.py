"""A suite, run: simulate, estimate, score, and put it all in one folder."""

import platform
import sys
from collections.abc import Callable
from pathlib import Path
from shutil import copyfile
from typing import Any

from vobench import __version__, stop
from vobench.run import estimate as estimate_file
from vobench.run.estimate import estimate
from vobench.run.folder import (
    CASE,
    ENVIRONMENT,
    ESTIMATORS,
    GROUND_TRUTH,
    SCORE,
    SEQUENCE,
    SUITE,
    RunFolder,
    TrialScore,
    make_run,
    write_hashes,
    write_json,
)
from vobench.run.import_recording import import_case
from vobench.run.score import left_truth, score_trial
from vobench.run.simulate import LIBRARIES, simulate
from vobench.run.store import Context, digest, folder_digest, library_versions
from vobench.sequence import read_import_notes
from vobench.suite.source import RecordedCase
from vobench.suite.suite import Case, Entrant, Plan
from vobench.suite.yaml_file import plain
from vobench.trajectory.formats import format_tum

Finish = Callable[[RunFolder, list[TrialScore]], None]
ESTIMATE_FILES = (estimate_file.ESTIMATE, estimate_file.FRAMES, estimate_file.TRACKS, estimate_file.LOG)


def run_suite(plan: Plan, *, root: Path, shop: Context, finish: Finish) -> RunFolder:
    """Run every case, estimator and repeat; what the store holds already is not made again.

    `finish` adds reports to the folder before it gets its final name under `root`.
    """
    suite = plain(plan.suite)
    entrants = [_entrant_facts(entrant) for entrant in plan.entrants]

    def fill(folder: RunFolder) -> None:
        write_json(folder.path / SUITE, suite)
        write_json(folder.path / ESTIMATORS, entrants)
        write_json(folder.path / ENVIRONMENT, _environment())
        finish(folder, [score for case in plan.cases for score in _run_case(plan, case, folder, shop)])
        write_hashes(folder)

    return make_run(root, plan.suite.name, digest({"suite": suite, "estimators": entrants}), fill)


def _sequence_of(case: Case | RecordedCase, shop: Context) -> Path:
    """The folder of the case's sequence: simulated, or imported from what somebody recorded."""
    return simulate(case, shop) if isinstance(case, Case) else import_case(case, shop)


def _run_case(plan: Plan, case: Case | RecordedCase, folder: RunFolder, shop: Context) -> list[TrialScore]:
    sequence = _sequence_of(case, shop)
    target = folder.case(case.name)
    target.mkdir(parents=True)
    write_json(target / CASE, {**plain(case), **_assumed(case, sequence)})
    (target / GROUND_TRUTH).write_text(format_tum(left_truth(sequence)), encoding="utf-8")
    gt = estimate_file.read_tum(target / GROUND_TRUTH)  # what is scored is what anybody can score again
    (target / SEQUENCE).symlink_to(sequence.resolve())
    scores = []
    for run in plan.runs(case):
        estimated = estimate(run, sequence, shop)
        stop.check()
        scores.append(score_trial(run, estimated, gt))
        _keep(estimated, scores[-1], folder.estimate(case.name, run.entrant.label, run.repeat))
    return scores


def _assumed(case: Case | RecordedCase, sequence: Path) -> dict[str, dict[str, str]]:
    """Of a recording: all that its import assumed, converted or dropped."""
    return {"import": read_import_notes(sequence)} if isinstance(case, RecordedCase) else {}


def _keep(estimated: Path, score: TrialScore, target: Path) -> None:
    """Copy an estimate out of the store, and put its score beside it."""
    target.mkdir(parents=True)
    for name in ESTIMATE_FILES:
        copyfile(estimated / name, target / name)
    write_json(target / SCORE, score.model_dump(mode="json"))


def _entrant_facts(entrant: Entrant) -> dict[str, Any]:
    manifest = entrant.manifest
    return {
        "label": entrant.label,
        "name": manifest.name,
        "version": manifest.version,
        "params": entrant.params,
        "code": folder_digest(entrant.folder),
    }


def _environment() -> dict[str, object]:
    return {
        "vobench": __version__,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "libraries": library_versions(*LIBRARIES, "pandas", "rerun-sdk"),
    }
