"""The formats of a board as text."""

from collections.abc import Callable

from vobench.report.board_latex import latex
from vobench.report.board_markdown import markdown
from vobench.report.board_records import as_csv, as_json
from vobench.report.leaderboard import Board


def _json(board: Board, _: str) -> str:
    return as_json(board)


def _csv(board: Board, _: str) -> str:
    return as_csv(board)


# The function of each format, which returns a board as text. Its second argument is the name of a metric: Markdown and
# LaTeX show the matrix of this metric. JSON and CSV contain all metrics.
FORMATS: dict[str, Callable[[Board, str], str]] = {
    "md": markdown,
    "json": _json,
    "csv": _csv,
    "latex": latex,
}
