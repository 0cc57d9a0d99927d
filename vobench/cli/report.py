"""vobench report and verify, and leaderboards on a terminal, as many columns as fit."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from vobench.cli import terminal
from vobench.errors import UnknownNameError
from vobench.report import page
from vobench.report.leaderboard import FORMATS, LEGEND, Board, lines_of, notes
from vobench.report.verify import verify_run
from vobench.run.folder import open_run

# A narrow terminal goes without these, in this order; every report has them all.
LEAST_FIRST = ("MiB", "RPE °/frame", "RPE mm/frame", "CPU ms/frame", "segments %", "survived", "coverage", "#")
ENDLESS = 10_000
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
    return terminal.known("format", form, FORMS if out else (TERMINAL, *FORMS))


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


def print_boards(boards: list[Board]) -> None:
    """The leaderboards, and what their numbers don't say."""
    out = terminal.console()
    for board in boards:
        out.print(_fitting(board, out))
        for row in board.rows:
            for note in notes(row):
                out.print(f"  {note}", style="red" if row.reason and note == notes(row)[0] else None)
    out.print(LEGEND, style="dim")


def _fitting(board: Board, out: Console) -> Table:
    """A board without the columns that matter least, where the terminal is too narrow for all of them."""
    endless, lines = out.options.update(max_width=ENDLESS), lines_of(board)
    for left_out in range(len(LEAST_FIRST) + 1):
        kept = [i for i, heading in enumerate(lines[0]) if heading not in LEAST_FIRST[:left_out]]
        headings, *rows = [[cells[i] for i in kept] for cells in lines]
        made = terminal.table(board.title, headings, rows)
        if Measurement.get(out, endless, made).maximum <= out.width:
            break
    return made
