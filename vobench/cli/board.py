"""Prints a leaderboard on a terminal, with as many columns as fit."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from vobench.cli import terminal
from vobench.errors import printable
from vobench.report.board_metric import METRICS
from vobench.report.board_table import (
    DEFAULT_METRIC,
    SHORT_LEGEND,
    ShownCell,
    board_notes,
    matrix,
    origin,
    totals,
)
from vobench.report.leaderboard import Board
from vobench.runner.folder import PAGE

# Columns of the totals that a narrow terminal omits, in this order; written reports have all of them.
LEAST_FIRST = ("MiB", "CPU ms/frame", "score", "decided", "lost", "ATE %", "× best")

UNLIMITED_WIDTH = 10_000  # columns
HEADING_WIDTH = 12  # of an estimator's name above a column
MOST_CASES = 60  # rows on a terminal
MOST_NOTES = 3  # lines on a terminal
ADVICE = "use a wider terminal, or --format csv"


@dataclass(frozen=True, slots=True)
class _FittedTable:
    """A table that fits the terminal, and the headings of the columns that it omits."""

    table: Table
    omitted: Sequence[str]


def print_board(board: Board, metric: str = DEFAULT_METRIC) -> None:
    """Print the matrix of a metric, the totals, and what limits their meaning."""
    console = terminal.console()
    _print_matrix(board, metric, console)
    for group, (headings, *rows) in totals(board):
        fitted = _fit_totals(f"totals over {group}", headings, rows, console)
        _print_fitted(fitted, console)
    notes = board_notes(board)
    for note in notes[:MOST_NOTES]:
        console.print(f"  {printable(note)}")
    if len(notes) > MOST_NOTES:
        console.print(f"  {len(notes) - MOST_NOTES} more notes: see {PAGE}, or --format md", style="dim")
    console.print(SHORT_LEGEND, style="dim")
    for line in (board.visible, origin(board)):
        if line:
            console.print(printable(line), style="dim")


def _print_matrix(board: Board, metric: str, console: Console) -> None:
    """Print the errors of each case and estimator."""
    rows = [[case, *map(_cell_text, cells)] for case, cells in matrix(board, metric)]
    fitted = _fit_matrix(METRICS[metric].heading, board.estimators, rows[:MOST_CASES], console)
    _print_fitted(fitted, console)
    if len(rows) > MOST_CASES:
        console.print(f"{len(rows) - MOST_CASES} more cases: see --format csv", style="yellow")


def _cell_text(cell: ShownCell) -> str:
    text = f"{cell.text}{cell.mark}"
    return f"{text}\n{cell.range}" if cell.range else text


def _fit_matrix(title: str, names: Sequence[str], rows: Sequence[Sequence[str]], console: Console) -> _FittedTable:
    """The matrix without the last estimators, if not all of them fit. At least one remains."""
    shown_count = len(names)
    while True:
        headings = ["case", *(_folded(name) for name in names[:shown_count])]
        table = terminal.table(title, headings, [row[: shown_count + 1] for row in rows])
        if shown_count <= 1 or _fits(table, console):
            return _FittedTable(table, names[shown_count:])
        shown_count -= 1


def _fit_totals(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]], console: Console) -> _FittedTable:
    """The totals without the least important columns, if not all fit."""
    omitted_count = 0
    while True:
        omitted = LEAST_FIRST[:omitted_count]
        table = _table_without(omitted, title, headings, rows)
        if omitted_count == len(LEAST_FIRST) or _fits(table, console):
            return _FittedTable(table, [heading for heading in headings if heading in omitted])
        omitted_count += 1


def _table_without(omitted: Sequence[str], title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    columns = [column for column, heading in enumerate(headings) if heading not in omitted]
    shown_rows = list[list[str]]()
    for row in rows:
        shown_rows.append([row[column] for column in columns])
    return terminal.table(title, [headings[column] for column in columns], shown_rows)


def _print_fitted(fitted: _FittedTable, console: Console) -> None:
    console.print(fitted.table)
    if fitted.omitted:
        console.print(f"no room for {', '.join(fitted.omitted)}: {ADVICE}", style="yellow")


def _fits(table: Table, console: Console) -> bool:
    unlimited = console.options.update(max_width=UNLIMITED_WIDTH)
    return bool(Measurement.get(console, unlimited, table).maximum <= console.width)


def _folded(name: str) -> str:
    """A name broken into narrow lines after underscores."""
    lines = [""]
    for part in name.replace("_", "_\n").split("\n"):
        if len(lines[-1] + part) > HEADING_WIDTH and lines[-1]:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)
