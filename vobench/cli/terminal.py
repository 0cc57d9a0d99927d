"""What people see: tables on standard output, progress on standard error."""

import json as json_module
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from rich import box
from rich.console import Console
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

Item = TypeVar("Item")
LEFT_ALIGNED = {
    *("estimator", "status", "name", "case", "kind", "summary", "path", "origin", "check", "result"),
    *("sequence", "metric", "headline", "is", "with", "trajectory"),
}


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
