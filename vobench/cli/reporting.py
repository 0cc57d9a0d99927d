"""vobench report."""

from pathlib import Path

from vobench.catalog.catalog import unknown
from vobench.cli import terminal
from vobench.cli.boards import print_boards
from vobench.errors import UnknownNameError
from vobench.report import files, page, table
from vobench.report.leaderboard import Board
from vobench.results.run_folder import RunFolder, RunScore, open_run

TERMINAL = "terminal"
FORMS = (*table.FORMATS, "html")
ENDINGS = {".tex": "latex", ".htm": "html", **{f".{form}": form for form in FORMS}}


def show(run: Path, *, form: str | None, out: Path | None, as_json: bool) -> None:
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


def _text(form: str, folder: RunFolder, scores: list[RunScore], boards: list[Board]) -> str:
    return page.html(folder, scores, boards) if form == "html" else table.FORMATS[form](boards)
