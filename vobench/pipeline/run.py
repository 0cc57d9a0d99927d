"""A suite, run: simulate, estimate, score, and put it all in one folder."""

import platform
import sys
from collections.abc import Callable
from pathlib import Path
from shutil import copyfile
from typing import Any

from vobench import __version__, stop
from vobench.pipeline.estimate import estimate
from vobench.pipeline.recorded import import_case
from vobench.pipeline.score import score_run
from vobench.pipeline.simulate import LIBRARIES, simulate
from vobench.pipeline.truth_path import left_truth
from vobench.pipeline.workshop import Workshop
from vobench.results import estimate_file
from vobench.results.hashes import write_hashes
from vobench.results.run_folder import (
    CASE,
    ENVIRONMENT,
    ESTIMATORS,
    GROUND_TRUTH,
    SCORE,
    SEQUENCE,
    SUITE,
    RunFolder,
    RunScore,
    make_run,
    write_json,
)
from vobench.results.store import digest, folder_digest, library_versions
from vobench.sequence import read_import_notes
from vobench.suite.expand import Case, Entrant, Plan
from vobench.suite.source_spec import RecordedCase
from vobench.trajectory.text import format_tum

Finish = Callable[[RunFolder, list[RunScore]], None]
ESTIMATE_FILES = (estimate_file.ESTIMATE, estimate_file.FRAMES, estimate_file.TRACKS, estimate_file.LOG)


def run_suite(plan: Plan, *, root: Path, shop: Workshop, finish: Finish) -> RunFolder:
    """Run every case, estimator and repeat; what the store holds already is not made again.

    `finish` adds reports to the folder before it gets its final name under `root`.
    """
    suite = plan.suite.model_dump(mode="json")
    entrants = [_entrant_facts(entrant) for entrant in plan.entrants]

    def fill(folder: RunFolder) -> None:
        write_json(folder.path / SUITE, suite)
        write_json(folder.path / ESTIMATORS, entrants)
        write_json(folder.path / ENVIRONMENT, _environment())
        finish(folder, [score for case in plan.cases for score in _run_case(plan, case, folder, shop)])
        write_hashes(folder)

    return make_run(root, plan.suite.name, digest({"suite": suite, "estimators": entrants}), fill)


def _sequence_of(case: Case | RecordedCase, shop: Workshop) -> Path:
    """The folder of the case's sequence: simulated, or imported from what somebody recorded."""
    return simulate(case, shop) if isinstance(case, Case) else import_case(case, shop)


def _run_case(plan: Plan, case: Case | RecordedCase, folder: RunFolder, shop: Workshop) -> list[RunScore]:
    sequence = _sequence_of(case, shop)
    target = folder.case(case.name)
    target.mkdir(parents=True)
    write_json(target / CASE, {**case.model_dump(mode="json"), **_assumed(case, sequence)})
    (target / GROUND_TRUTH).write_text(format_tum(left_truth(sequence)), encoding="utf-8")
    gt = estimate_file.read_tum(target / GROUND_TRUTH)  # what is scored is what anybody can score again
    (target / SEQUENCE).symlink_to(sequence.resolve())
    scores = []
    for run in plan.runs(case):
        estimated = estimate(run, sequence, shop)
        stop.check()
        scores.append(score_run(run, estimated, gt))
        _keep(estimated, scores[-1], folder.estimate(case.name, run.entrant.label, run.repeat))
    return scores


def _assumed(case: Case | RecordedCase, sequence: Path) -> dict[str, dict[str, str]]:
    """Of a recording: all that its import assumed, converted or dropped."""
    return {"import": read_import_notes(sequence)} if isinstance(case, RecordedCase) else {}


def _keep(estimated: Path, score: RunScore, target: Path) -> None:
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
