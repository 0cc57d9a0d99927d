"""vobench run and check."""

import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vobench.cli import terminal
from vobench.errors import InputError
from vobench.run.motion import BodyMotion, body_motions
from vobench.run.store import default_store
from vobench.run.task import is_done, sequence_tasks
from vobench.suite.source import RecordedCase
from vobench.suite.suite import Case, Plan, read_plan

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording


def run(suite: str, estimators: tuple[str, ...], *, out: Path, as_json: bool) -> None:
    """Run a suite and print its leaderboard and where everything lies."""
    from vobench.cli.boards import print_boards
    from vobench.report import page
    from vobench.report.leaderboard import as_json as boards_as_json
    from vobench.run.run import run_suite

    planned = read_plan(suite, only_estimators=estimators)
    _, recordings = _preflight(planned)
    store = default_store().root
    _require_writable("--out", out)
    _require_writable("VOBENCH_CACHE", store)
    finish, progress = page.write_reports, terminal.Bars()
    folder = run_suite(planned, recordings, root=out, store=store, progress=progress, finish=finish)
    boards = page.boards_of(folder, folder.scores())
    if as_json:
        print(boards_as_json(boards), end="")
        return
    print_boards(boards)
    terminal.console().print(f"Everything is in {folder.path}\nLook into it: {_command()} view {folder.path}")


def _command() -> str:
    """What to type for vobench: our own path where the environment is not activated."""
    return "vobench" if shutil.which("vobench") else sys.argv[0]


def _require_writable(what: str, folder: Path) -> None:
    """Said before hours of work. Raises InputError."""
    from vobench.run.store import why_unwritable

    if cause := why_unwritable(folder):
        raise InputError(f"{what} should be a folder that can be written ({cause}): {folder}")


def _preflight(planned: Plan) -> "tuple[dict[str, BodyMotion], dict[str, Recording]]":
    """Where bodies go and what recordings hold. Raises SuiteError with all that cannot be."""
    travels, wrong = dict[str, BodyMotion](), planned.mistakes()
    recordings: dict[str, Recording] = {}
    with wrong.at():
        travels = body_motions(planned)
    with wrong.at():
        recordings = _read_recordings(planned)
    wrong.require_none()
    return travels, recordings


def check(suite: str, estimators: tuple[str, ...], *, as_json: bool) -> None:
    """Validate a suite and print what it comes to."""
    planned = read_plan(suite, only_estimators=estimators)
    travels, recordings = _preflight(planned)
    cases = [_case_facts(case, travels) for case in planned.simulated]
    cases += [_recorded_facts(case, recordings[case.name]) for case in planned.recorded]
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


def _read_recordings(planned: Plan) -> "dict[str, Recording]":
    """The plan's recordings by their cases' names; what reads them is imported where there are any."""
    if not planned.recorded:
        return {}
    from vobench.run.import_recording import read_all

    return read_all(planned)


def _case_facts(case: Case, travels: Mapping[str, BodyMotion]) -> dict[str, Any]:
    """What is known of a case before it is made."""
    t_ns, is_there = travels[case.variant["trajectory"]].t_ns, _is_made(case, {})
    return {
        "case": case.name,
        "frames": len(t_ns),
        "duration_s": float(t_ns[-1] - t_ns[0]) / 1e9,
        "simulated": is_there,
        "sequence": "in the cache" if is_there else "to simulate",
    }


def _recorded_facts(case: RecordedCase, recording: "Recording") -> dict[str, Any]:
    """The same of a recording; its pictures are not read yet."""
    is_there = _is_made(case, {case.name: recording})
    return {
        "case": case.name,
        "frames": recording.frame_count,
        "duration_s": float(recording.t_ns[-1] - recording.t_ns[0]) / 1e9,
        "simulated": False,
        "sequence": "in the cache" if is_there else f"to import from {case.source.path}",
        "notes": list(recording.notes),
    }


def _is_made(case: Case | RecordedCase, recordings: "Mapping[str, Recording]") -> bool:
    """Whether the store holds the case's sequence."""
    return is_done(sequence_tasks(case, recordings)[-1], default_store().root)


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
        check(suite, names, as_json=json)
    else:
        run(suite, names, out=out, as_json=json)


def check_command(suite: terminal.SuiteName, *, json: terminal.Json = False) -> None:
    """Validate a suite and print its plan; nothing is rendered."""
    check(suite, (), as_json=json)
