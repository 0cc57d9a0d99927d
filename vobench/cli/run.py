"""vobench run, check and schema."""

import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vobench.cli import terminal
from vobench.errors import InputError
from vobench.estimator.manifest import Manifest
from vobench.run.key import cache_folder
from vobench.run.motion import BodyMotion, body_motions
from vobench.run.store import why_unwritable
from vobench.run.task import is_done, sequence_tasks
from vobench.suite.scene_spec import SceneFile
from vobench.suite.source import RecordedCase
from vobench.suite.suite import Case, Plan, Suite, read_plan
from vobench.suite.yaml_file import json_schema

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording


def run_command(
    suite: terminal.SuiteName,
    *,
    estimator: Annotated[
        list[str] | None, typer.Option("--estimator", "-e", help="Run only this one; may be given several times.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Where the folders of runs go.")] = Path("runs"),
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be run, and stop.")] = False,
    json: terminal.Json = False,
) -> None:
    """Run a suite: simulate, estimate, score, and print the leaderboard."""
    names = tuple(estimator or ())
    if dry_run:
        _check(suite, names, as_json=json)
        return
    from vobench.cli.report import print_boards
    from vobench.report import page
    from vobench.report.leaderboard import as_json as boards_as_json
    from vobench.run.run import run_suite

    planned = read_plan(suite, only_estimators=names)
    _, recordings = _preflight(planned)
    store = cache_folder()
    for what, place in (("--out", out), ("VOBENCH_CACHE", store)):
        if cause := why_unwritable(place):
            raise InputError(f"{what} should be a folder that can be written ({cause}): {place}")
    finish, progress = page.write_reports, terminal.Bars()
    folder = run_suite(planned, recordings, root=out, store=store, progress=progress, finish=finish)
    boards = page.boards_of(folder, folder.scores())
    if json:
        print(boards_as_json(boards), end="")
        return
    print_boards(boards)
    vobench = "vobench" if shutil.which("vobench") else sys.argv[0]  # where the environment is not activated
    terminal.console().print(f"Everything is in {folder.path}\nLook into it: {vobench} view {folder.path}")


def check_command(suite: terminal.SuiteName, *, json: terminal.Json = False) -> None:
    """Validate a suite and print its plan; nothing is rendered."""
    _check(suite, (), as_json=json)


def _preflight(planned: Plan) -> "tuple[dict[str, BodyMotion], dict[str, Recording]]":
    """Where bodies go and what recordings hold. Raises SuiteError with all that cannot be."""
    travels, wrong = dict[str, BodyMotion](), planned.mistakes()
    recordings: dict[str, Recording] = {}
    with wrong.at():
        travels = body_motions(planned)
    with wrong.at():
        if planned.recorded:
            from vobench.run.import_recording import read_all

            recordings = read_all(planned)
    wrong.require_none()
    return travels, recordings


def _check(suite: str, estimators: tuple[str, ...], *, as_json: bool) -> None:
    """Validate a suite and print what it comes to."""
    planned = read_plan(suite, only_estimators=estimators)
    travels, recordings = _preflight(planned)
    cases = [_facts(case, travels, recordings) for case in planned.cases]
    entrants = [
        {"estimator": e.label, "version": e.manifest.version, "needs": list(e.manifest.needs), "path": str(e.folder)}
        for e in planned.entrants
    ]
    found = [{"kind": e.kind, "name": e.name, "origin": e.origin, "path": str(e.path)} for e in planned.found]
    trials = sum(len(planned.trials(case)) for case in planned.cases)
    if as_json:
        said = {"suite": planned.suite.name, "cases": cases, "estimators": entrants, "trials": trials, "found": found}
        terminal.print_json(said)
        return
    rows = [[f["case"], str(f["frames"]), f"{f['duration_s']:.1f}", f["sequence"]] for f in cases]
    out = terminal.console()
    out.print(terminal.table(f"{planned.suite.name}: cases", ["case", "frames", "seconds", "sequence"], rows))
    lines = [[e.label, e.manifest.version, ", ".join(e.manifest.needs) or "nothing"] for e in planned.entrants]
    out.print(terminal.table("estimators", ["estimator", "version", "needs"], lines))
    out.print(terminal.table("found", ["kind", "name", "origin", "path"], [[*each.values()] for each in found]))
    for case in cases:
        for note in case.get("notes", []):
            out.print(f"{case['case']}: {note}")
    out.print(f"{len(cases)} cases, {len(entrants)} estimators, {trials} trials: the suite is valid")


def _facts(
    case: Case | RecordedCase, travels: Mapping[str, BodyMotion], recordings: "Mapping[str, Recording]"
) -> dict[str, Any]:
    """What is known of a case before it is made; a recording's pictures are not read yet."""
    is_there = is_done(sequence_tasks(case, recordings)[-1], cache_folder())
    notes = dict[str, list[str]]()
    if isinstance(case, RecordedCase):
        recording, to_make = recordings[case.name], f"to import from {case.source.path}"
        t_ns, notes = recording.t_ns, {"notes": list(recording.notes)}
    else:
        t_ns, to_make = travels[case.variant["trajectory"]].t_ns, "to simulate"
    return {
        "case": case.name,
        "frames": len(t_ns),
        "duration_s": float(t_ns[-1] - t_ns[0]) / 1e9,
        "simulated": is_there and not isinstance(case, RecordedCase),
        "sequence": "in the cache" if is_there else to_make,
        **notes,
    }


FILES = {"suite": Suite, "scene": SceneFile, "estimator": Manifest}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schema_command(
    kind: Annotated[str, typer.Argument(metavar="[suite|scene|estimator]", help="Of which kind of file.")] = "suite",
    *,
    json: Annotated[bool, typer.Option("--json", help="It is JSON in any case.")] = False,
) -> None:
    """Print the JSON Schema of a suite's, scene's or estimator's YAML, for editors and other programs."""
    del json
    terminal.print_json({"$schema": DIALECT, **json_schema(FILES[terminal.known("schema", kind, FILES)])})
