"""vobench run and vobench check."""

import shutil
import sys
from pathlib import Path
from typing import Any

from vobench.cli import terminal
from vobench.cli.boards import print_boards
from vobench.errors import InputError
from vobench.pipeline.motion import drive_all
from vobench.pipeline.run import run_suite
from vobench.pipeline.simulate import is_simulated
from vobench.pipeline.workshop import Workshop
from vobench.report import files
from vobench.report.table import as_json as boards_as_json
from vobench.results.store import default_store
from vobench.results.unfinished import why_unwritable
from vobench.robot.drive import Drive
from vobench.suite.expand import Case, read_plan


def run(suite: str, estimators: tuple[str, ...], *, out: Path, as_json: bool) -> None:
    """Run a suite and print its leaderboard and where everything lies."""
    planned = read_plan(suite, only_estimators=estimators)
    drive_all(planned)
    _require_writable("--out", out)
    _require_writable("VOBENCH_CACHE", default_store().root)
    shop = Workshop(default_store(), terminal.Bars())
    folder = run_suite(planned, root=out, shop=shop, finish=files.write_reports)
    boards = files.boards_of(folder, folder.scores())
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
    if cause := why_unwritable(folder):
        raise InputError(f"{what} should be a folder that can be written ({cause}): {folder}")


def check(suite: str, estimators: tuple[str, ...], *, as_json: bool) -> None:
    """Validate a suite and print what it comes to."""
    planned = read_plan(suite, only_estimators=estimators)
    drives = drive_all(planned)
    cases = [_case_facts(case, drives[case.variant["trajectory"]]) for case in planned.cases]
    entrants = [
        {"estimator": e.label, "version": e.manifest.version, "needs": list(e.manifest.needs), "path": str(e.folder)}
        for e in planned.entrants
    ]
    runs = sum(len(planned.runs(case)) for case in planned.cases)
    if as_json:
        terminal.print_json({"suite": planned.suite.name, "cases": cases, "estimators": entrants, "runs": runs})
        return
    rows = [[f["case"], str(f["frames"]), f"{f['duration_s']:.1f}", _cached(f)] for f in cases]
    out = terminal.console()
    out.print(terminal.table(f"{planned.suite.name}: cases", ["case", "frames", "seconds", "sequence"], rows))
    lines = [
        [e.label, e.manifest.version, ", ".join(e.manifest.needs) or "nothing", str(e.folder)] for e in planned.entrants
    ]
    out.print(terminal.table("estimators", ["estimator", "version", "needs", "path"], lines))
    out.print(f"{len(cases)} cases, {len(entrants)} estimators, {runs} runs: the suite is valid")


def _case_facts(case: Case, motion: Drive) -> dict[str, Any]:
    return {
        "case": case.name,
        "frames": len(motion.t_ns),
        "duration_s": float(motion.t_ns[-1]) / 1e9,
        "simulated": is_simulated(case, default_store()),
    }


def _cached(facts: dict[str, Any]) -> str:
    return "in the cache" if facts["simulated"] else "to simulate"
