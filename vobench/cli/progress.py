"""Progress of a command on standard error."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

Item = TypeVar("Item")


class Bars:
    """Progress bars on a terminal, or one line for each stage if standard error is not a terminal."""

    def __init__(self) -> None:
        from rich.console import Console

        self._console = Console(stderr=True, markup=False)

    def track(self, items: Iterable[Item], description: str, *, total: int) -> Iterator[Item]:
        """Iterate over items, and count them on a bar that disappears at the end."""
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with self._progress(f"{description}: {total} frames", *columns) as progress:
            yield from progress.track(items, total=total, description=description)

    @contextmanager
    def step(self, description: str) -> Iterator[Callable[[float], object]]:
        """A spinner around work of unknown length. It yields a function that shows the finished share."""
        from rich.progress import SpinnerColumn, TaskProgressColumn, TextColumn

        with self._progress(description, SpinnerColumn(), TextColumn(description), TaskProgressColumn()) as progress:
            task = progress.add_task(description, total=None)
            yield lambda share: progress.update(task, total=1.0, completed=share)

    def say(self, sentence: str) -> None:
        """Print a sentence as a separate line on standard error."""
        print(f"vobench: {sentence}", file=sys.stderr, flush=True)

    def _progress(self, line: str, *columns: "ProgressColumn") -> "Progress":
        """A progress bar with the given columns. If standard error is not a terminal, only `line` is printed."""
        from rich.progress import Progress

        is_terminal = self._console.is_terminal
        if not is_terminal:
            print(line, file=sys.stderr, flush=True)
        return Progress(*columns, console=self._console, transient=True, disable=not is_terminal)
