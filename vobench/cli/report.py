"""vobench report and verify."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.boards import print_boards
from vobench.errors import UnknownNameError, unknown
from vobench.report import page
from vobench.report.leaderboard import FORMATS
from vobench.run.folder import open_run
from vobench.run.verify import verify_run

TERMINAL = "terminal"
FORMS = (*FORMATS, "html")
ENDINGS = {".tex": "latex", ".htm": "html", **{f".{form}": form for form in FORMS}}


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
    chosen = _chosen(form, out, as_json=json)
    folder = open_run(run)
    scores = folder.scores()
    boards = page.boards_of(folder, scores)
    if out is None and chosen == TERMINAL:
        print_boards(boards)
        return
    text = page.html(folder, scores, boards) if chosen == "html" else FORMATS[chosen](boards)
    if out is None:
        print(text, end="")
        return
    out.write_text(text, encoding="utf-8")
    if json:
        terminal.print_json({"path": str(out), "format": chosen})


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


def verify_command(run: terminal.RunPath, *, json: terminal.Json = False) -> None:
    """Recompute all hashes and scores of a run from its files; exit code 1 where anything differs."""
    findings = list(verify_run(open_run(run)))
    wrong = [finding for finding in findings if finding.wrong]
    if json:
        rows = [asdict(finding) for finding in findings]
        terminal.print_json({"run": str(run), "checked": len(findings), "wrong": len(wrong), "findings": rows})
        raise SystemExit(1 if wrong else 0)
    out = terminal.console()
    for f in wrong:
        out.print(f"{f.kind}: {f.what}: {f.wrong}")
    for kind in dict.fromkeys(f.kind for f in findings):
        of_kind = [f for f in findings if f.kind == kind]
        out.print(f"{kind}: {sum(not f.wrong for f in of_kind)} of {len(of_kind)} as they were")
    if wrong:
        raise SystemExit(1)
