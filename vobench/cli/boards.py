"""Leaderboards on a terminal, as many columns as fit."""

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from vobench.cli import terminal
from vobench.report.leaderboard import LEGEND, Board, lines_of, notes

# A narrow terminal goes without these, in this order; every report has them all.
LEAST_FIRST = ("RPE °/frame", "RPE mm/frame", "CPU ms/frame", "segments %", "survived", "coverage", "#")
ENDLESS = 10_000


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
