"""vobench report and verify."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.boards import print_boards
from vobench.errors import UnknownNameError, unknown
from vobench.report import leaderboard as table
from vobench.report import page
from vobench.report import page as files
from vobench.report.leaderboard import Board
from vobench.run.folder import RunFolder, TrialScore, open_run
from vobench.run.verify import Finding, verify_run

TERMINAL = "terminal"
FORMS = (*table.FORMATS, "html")
ENDINGS = {".tex": "latex", ".htm": "html", **{f".{form}": form for form in FORMS}}


def show_report(run: Path, *, form: str | None, out: Path | None, as_json: bool) -> None:
    """Print or write a run's leaderboard; `as_json` prints it as JSON, or where it was written to."""
    chosen = _chosen(form, out, as_json=as_json)
    folder = open_run(run)
    scores = folder.scores()
    boards = files.boards_of(folder, scores)
    if out is not None:
        out.write_text(_text(chosen, folder, scores, boards), encoding="utf-8")
        if as_json:
            terminal.print_json({"path": str(out), "format": chosen})
    elif chosen == TERMINAL:
        print_boards(boards)
    else:
        print(_text(chosen, folder, scores, boards), end="")


def _chosen(form: str | None, out: Path | None, *, as_json: bool) -> str:
    """The form asked for: --json's, --format's, or that of the file's ending. Raises UnknownNameError."""
    if as_json and out is None:
        return "json"
    if form is None and out is not None and out.suffix.lower() not in ENDINGS:
        raise UnknownNameError(f"no format goes with '{out.name}'; name one with --format: {', '.join(FORMS)}")
    if form is None:
        form = ENDINGS[out.suffix.lower()] if out else TERMINAL
    known = FORMS if out else (TERMINAL, *FORMS)
    if form not in known:
        raise UnknownNameError(unknown("format", form, list(known)))
    return form


def _text(form: str, folder: RunFolder, scores: list[TrialScore], boards: list[Board]) -> str:
    return page.html(folder, scores, boards) if form == "html" else table.FORMATS[form](boards)


def show_verification(run: Path, *, as_json: bool) -> None:
    """Print what of a run is no longer what it was; exit code 1 where anything is."""
    findings = list(verify_run(open_run(run)))
    wrong = [finding for finding in findings if finding.wrong]
    if as_json:
        rows = [{"kind": f.kind, "what": f.what, "wrong": f.wrong} for f in findings]
        terminal.print_json({"run": str(run), "checked": len(findings), "wrong": len(wrong), "findings": rows})
    else:
        _print_verified(findings, wrong)
    if wrong:
        raise SystemExit(1)


def _print_verified(findings: list[Finding], wrong: list[Finding]) -> None:
    out = terminal.console()
    for f in wrong:
        out.print(f"{f.kind}: {f.what}: {f.wrong}")
    for kind in dict.fromkeys(f.kind for f in findings):
        of_kind = [f for f in findings if f.kind == kind]
        out.print(f"{kind}: {sum(not f.wrong for f in of_kind)} of {len(of_kind)} as they were")


def report_command(
    run: terminal.RunPath,
    *,
    form: Annotated[
        str | None, typer.Option("--format", help="terminal, md, csv, json, latex or html; --out's ending says it too.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write to this file instead of the terminal.")] = None,
    json: terminal.Json = False,
) -> None:
    """Print a run's leaderboard, in any form."""
    show_report(run, form=form, out=out, as_json=json)


def verify_command(
    run: terminal.RunPath,
    *,
    json: terminal.Json = False,
) -> None:
    """Recompute all hashes and scores of a run from its files; exit code 1 where anything differs."""
    show_verification(run, as_json=json)
