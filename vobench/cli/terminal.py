"""What people see: tables on standard output, progress on standard error."""

import json as json_module
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from vobench.report.leaderboard import Board
from vobench.report.table import HEADINGS, LEGEND, cells

Item = TypeVar("Item")
LEFT_ALIGNED = {"estimator", "status", "name", "case", "kind", "summary", "path", "origin", "metric", "check", "result"}

# A narrow terminal goes without these, in this order; every report has them all.
LEAST_FIRST = ("RPE °/frame", "RPE mm/frame", "CPU ms/frame", "segments %", "survived", "coverage", "#")
ENDLESS = 10_000


def print_json(content: Any) -> None:
    """One JSON object on standard output."""
    print(json_module.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))


def console() -> Console:
    """Standard output; lines are as long as they are where nobody watches."""
    plain = Console(markup=False, highlight=False)
    return plain if plain.is_terminal else Console(markup=False, highlight=False, width=200)


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """A table with a bold title; words to the left, numbers to the right."""
    made = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE, pad_edge=False)
    for heading in headings:
        made.add_column(heading, justify="left" if heading in LEFT_ALIGNED else "right", overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


def _fitting(board: Board, out: Console) -> Table:
    """A board without the columns that matter least, where the terminal is too narrow for all of them."""
    endless = out.options.update(max_width=ENDLESS)
    for left_out in range(len(LEAST_FIRST) + 1):
        kept = [i for i, heading in enumerate(HEADINGS) if heading not in LEAST_FIRST[:left_out]]
        rows = [[cells(row)[i] for i in kept] for row in board.rows]
        made = table(board.title, [HEADINGS[i] for i in kept], rows)
        if Measurement.get(out, endless, made).maximum <= out.width:
            break
    return made


def print_boards(boards: list[Board]) -> None:
    """The leaderboards, and what went wrong."""
    out = console()
    for board in boards:
        out.print(_fitting(board, out))
        for row in board.rows:
            if row.reason:
                out.print(f"  {row.estimator}: {row.status}: {row.reason}", style="red")
    out.print(LEGEND, style="dim")


class Bars:
    """Progress as bars on standard error; nothing where that is no terminal."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, markup=False)

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """The same items, counted on a bar that goes when they are through."""
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with self._progress(*columns) as progress:
            yield from progress.track(items, total=total, description=what)

    @contextmanager
    def step(self, what: str) -> Iterator[None]:
        """A spinner around work of unknown length."""
        with self._progress(SpinnerColumn(), TextColumn(what)) as progress:
            progress.add_task(what)
            yield

    def _progress(self, *columns: ProgressColumn) -> Progress:
        return Progress(*columns, console=self._console, transient=True, disable=not self._console.is_terminal)
