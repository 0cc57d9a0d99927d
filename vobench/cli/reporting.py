"""vobench report."""

from pathlib import Path

from vobench.cli import terminal
from vobench.errors import UnknownNameError
from vobench.report import files, page, table
from vobench.results.run_folder import open_run


def show(run: Path, *, form: str, out: Path | None) -> None:
    """Print or write a run's leaderboard."""
    folder = open_run(run)
    scores = folder.scores()
    boards = files.boards_of(folder, scores)
    if form == "terminal" and out is None:
        terminal.print_boards(boards)
        return
    if form not in (*table.FORMATS, "html"):
        known = ", ".join(["terminal", *table.FORMATS, "html"])
        raise UnknownNameError(
            f"no format '{form}' for a file. Known: {known}" if out else f"no format '{form}'. Known: {known}"
        )
    text = page.html(folder, scores, boards) if form == "html" else table.FORMATS[form](boards)
    if out is None:
        print(text, end="")
    else:
        out.write_text(text, encoding="utf-8")
