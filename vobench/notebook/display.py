"""The progress of a run in Jupyter, as a bar, or in a plain Python program, as lines on standard error."""

import html
import sys
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

from vobench.errors import printable
from vobench.runner.progress import RunDisplay, RunProgress

if TYPE_CHECKING:
    from vobench.runner.executor import Event
    from vobench.runner.task import Task

REDRAW_S = 0.2  # a notebook is sent no more than five pictures of a bar in a second


def in_notebook() -> bool:
    """Whether this is a Jupyter kernel, which shows HTML."""
    if "IPython" not in sys.modules:
        return False
    from IPython import get_ipython

    shell = get_ipython()
    return shell is not None and shell.has_trait("kernel")


def choose_display(*, is_quiet: bool) -> RunDisplay:
    """The display that suits where this code runs."""
    if is_quiet:
        return QuietDisplay()
    return NotebookDisplay() if in_notebook() else LineDisplay()


class QuietDisplay:
    """Shows only the tasks that fail, and what the user must know."""

    def __init__(self) -> None:
        self._progress = RunProgress()
        self._began_s = time.monotonic()

    def begin(self, tasks: "Sequence[Task]", seconds: Mapping[str, float]) -> None:
        """Take the tasks that are to be performed."""
        self._progress = RunProgress(tasks, seconds)
        self._began_s = time.monotonic()

    def hear(self, event: "Event") -> None:
        """Count a task, and name one that failed."""
        self._progress.count(event)
        if event.what == "told":
            self.say(event.told)
        elif event.what == "failed":
            self.say(f"{event.task.stage} {event.task.name} failed: {event.reason}")

    def say(self, sentence: str) -> None:
        """Print a sentence on standard error."""
        print(printable(f"vobench: {sentence}"), file=sys.stderr, flush=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open."""


class LineDisplay(QuietDisplay):
    """Prints a line on standard error for each task that ends."""

    def hear(self, event: "Event") -> None:
        """Name a task that ended, and how much is left."""
        super().hear(event)
        if event.what == "done":
            left = self._progress.describe(time.monotonic() - self._began_s)
            self.say(f"{event.task.stage} {event.task.name}: {event.wall_s:.1f} s ({left})")


class NotebookDisplay(QuietDisplay):
    """Draws one bar in the output of a cell, and removes it at the end."""

    def __init__(self) -> None:
        super().__init__()
        self._running: dict[str, str] = {}
        self._handle: Any = None
        self._drawn_s = 0.0

    def begin(self, tasks: "Sequence[Task]", seconds: Mapping[str, float]) -> None:
        """Take the tasks that are to be performed, and draw an empty bar where there are some."""
        super().begin(tasks, seconds)
        if tasks:
            from IPython.display import HTML, display

            self._handle = display(HTML(self._html()), display_id=True)

    def hear(self, event: "Event") -> None:
        """Move the bar."""
        super().hear(event)
        if event.what == "started":
            self._running[event.task.key] = f"{event.task.stage} {event.task.name}"
        elif event.what in ("done", "failed"):
            self._running.pop(event.task.key, None)
        self._draw()

    def _draw(self) -> None:
        now_s = time.monotonic()
        if self._handle is None or now_s - self._drawn_s < REDRAW_S:
            return
        from IPython.display import HTML

        self._drawn_s = now_s
        self._handle.update(HTML(self._html()))

    def _html(self) -> str:
        text = self._progress.describe(time.monotonic() - self._began_s)
        running = html.escape(", ".join(self._running.values()))
        bar = f'<progress value="{self._progress.share:.4f}" max="1" style="width: 20em"></progress>'
        return f"<div>{bar} {text}<br><small>{running}</small></div>"

    def __exit__(self, *_: object) -> None:
        """Leave one line with the number of tasks and the time that they took."""
        if self._handle is None:
            return
        from IPython.display import HTML

        progress = self._progress
        elapsed_s = time.monotonic() - self._began_s
        self._handle.update(HTML(f"<small>{progress.finished} of {progress.planned} tasks, {elapsed_s:.0f} s</small>"))
