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

# The columns of the totals that are omitted on a narrow terminal, in this order. Written reports have all columns.
COLUMNS_TO_DROP = ("MiB", "CPU ms/frame", "score", "decided", "lost", "ATE %", "× best")

UNLIMITED_WIDTH = 10_000  # the width, in characters, at which a table is measured
HEADING_WIDTH = 12  # the largest width, in characters, of a line of an estimator's name above a column
MOST_CASES = 60  # the largest number of cases that are printed
MOST_NOTES = 3  # the largest number of notes that are printed
ADVICE = "use a wider terminal, or --format csv"


@dataclass(frozen=True, slots=True)
class _FittedTable:
    """A table that fits the terminal.

    `table` is the table without the omitted columns.
    `omitted` are the headings of the omitted columns.
    """

    table: Table
    omitted: Sequence[str]


def print_board(board: Board, metric: str = DEFAULT_METRIC) -> None:
    """Print the table of a metric by case and estimator, the totals, and notes on their validity."""
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
    for text in (board.visible, origin(board)):
        if text:
            console.print(printable(text), style="dim")


def _print_matrix(board: Board, metric: str, console: Console) -> None:
    """Print the value of a metric for each case and estimator."""
    rows = list[list[str]]()
    for case, cells in matrix(board, metric):
        texts = [_cell_text(cell) for cell in cells]
        rows.append([case, *texts])
    title = METRICS[metric].heading
    fitted = _fit_matrix(title, board.estimators, rows[:MOST_CASES], console)
    _print_fitted(fitted, console)
    if len(rows) > MOST_CASES:
        console.print(f"{len(rows) - MOST_CASES} more cases: see --format csv", style="yellow")


def _cell_text(cell: ShownCell) -> str:
    """A value with its mark, and the range of the value, if it has one, on a second line."""
    text = f"{cell.text}{cell.mark}"
    return f"{text}\n{cell.range}" if cell.range else text


def _fit_matrix(title: str, names: Sequence[str], rows: Sequence[Sequence[str]], console: Console) -> _FittedTable:
    """The table by case and estimator, without the last estimators if not all of them fit. At least one remains.

    `names` (E,) are the estimators. `rows` have the name of the case and the texts of E cells.
    """
    shown_count = len(names)
    while True:
        shown_names = [_folded(name) for name in names[:shown_count]]
        shown_rows = [row[: shown_count + 1] for row in rows]
        table = terminal.table(title, ["case", *shown_names], shown_rows)
        if shown_count <= 1 or _fits(table, console):
            return _FittedTable(table, names[shown_count:])
        shown_count -= 1


def _fit_totals(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]], console: Console) -> _FittedTable:
    """The table of the totals, without the least important columns if not all of them fit."""
    omitted_count = 0
    while True:
        omitted = COLUMNS_TO_DROP[:omitted_count]
        table = _table_without(omitted, title, headings, rows)
        can_omit_more = omitted_count < len(COLUMNS_TO_DROP)
        if _fits(table, console) or not can_omit_more:
            omitted_headings = [heading for heading in headings if heading in omitted]
            return _FittedTable(table, omitted_headings)
        omitted_count += 1


def _table_without(omitted: Sequence[str], title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """A table without the columns that have the omitted headings."""
    columns = [column for column, heading in enumerate(headings) if heading not in omitted]
    shown_headings = [headings[column] for column in columns]
    shown_rows = list[list[str]]()
    for row in rows:
        shown_rows.append([row[column] for column in columns])
    return terminal.table(title, shown_headings, shown_rows)


def _print_fitted(fitted: _FittedTable, console: Console) -> None:
    """Print a table and the headings of the columns that it omits."""
    console.print(fitted.table)
    if fitted.omitted:
        console.print(f"no room for {', '.join(fitted.omitted)}: {ADVICE}", style="yellow")


def _fits(table: Table, console: Console) -> bool:
    """Whether a table fits the width of the terminal."""
    unlimited = console.options.update(max_width=UNLIMITED_WIDTH)
    measurement = Measurement.get(console, unlimited, table)
    return bool(measurement.maximum <= console.width)


def _folded(name: str) -> str:
    """A name that is broken into lines of at most HEADING_WIDTH characters, if possible.

    Lines end at underscores, and before the name of a run that follows the name of an estimator.
    """
    lines = [""]
    for part in name.replace("_", "_\n").replace(" of ", "\nof ").split("\n"):
        is_too_wide = len(lines[-1] + part) > HEADING_WIDTH
        if is_too_wide and lines[-1]:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)
