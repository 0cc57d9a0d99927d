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


# By name: the text of a board whose matrix shows a metric. JSON and CSV hold all metrics.
FORMATS: dict[str, Callable[[Board, str], str]] = {
    "md": markdown,
    "json": _json,
    "csv": _csv,
    "latex": latex,
}
