"""The progress of a run: a bar in Jupyter, or lines on standard error in a Python program."""

import html
import sys
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

from vobench.errors import printable
from vobench.runner.progress import RunDisplay, RunProgress

if TYPE_CHECKING:
    from vobench.runner.executor import TaskEvent
    from vobench.runner.task import Task

REDRAW_S = 0.2  # a notebook gets at most five updates of the bar per second


def in_notebook() -> bool:
    """Whether this process is a Jupyter kernel, which shows HTML."""
    if "IPython" not in sys.modules:
        return False
    from IPython import get_ipython

    shell = get_ipython()
    return shell is not None and shell.has_trait("kernel")


def choose_display(*, is_quiet: bool) -> RunDisplay:
    """The display for the program that runs this code."""
    if is_quiet:
        return QuietDisplay()
    return NotebookDisplay() if in_notebook() else LineDisplay()


class QuietDisplay:
    """Shows only failed tasks, and messages to the user."""

    def __init__(self) -> None:
        self._progress = RunProgress()
        self._began_s = time.monotonic()

    def begin(self, tasks: "Sequence[Task]", seconds: Mapping[str, float]) -> None:
        """Start with the tasks to perform."""
        self._progress = RunProgress(tasks, seconds)
        self._began_s = time.monotonic()

    def hear(self, event: "TaskEvent") -> None:
        """Count a finished task, and print a failure."""
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
    """Prints a line on standard error for each finished task."""

    def hear(self, event: "TaskEvent") -> None:
        """Print a finished task, and how much is left."""
        super().hear(event)
        if event.what == "done":
            left = self._progress.describe(time.monotonic() - self._began_s)
            self.say(f"{event.task.stage} {event.task.name}: {event.wall_s:.1f} s ({left})")


class NotebookDisplay(QuietDisplay):
    """Draws a bar in the output of a cell, and replaces it by one line at the end."""

    def __init__(self) -> None:
        super().__init__()
        self._running: dict[str, str] = {}
        self._handle: Any = None
        self._drawn_s = 0.0

    def begin(self, tasks: "Sequence[Task]", seconds: Mapping[str, float]) -> None:
        """Start with the tasks to perform, and draw an empty bar if there are any."""
        super().begin(tasks, seconds)
        if tasks:
            from IPython.display import HTML, display

            self._handle = display(HTML(self._html()), display_id=True)

    def hear(self, event: "TaskEvent") -> None:
        """Update the bar."""
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
        """Replace the bar by the number of tasks and the time that they took."""
        if self._handle is None:
            return
        from IPython.display import HTML

        progress = self._progress
        elapsed_s = time.monotonic() - self._began_s
        self._handle.update(HTML(f"<small>{progress.finished} of {progress.planned} tasks, {elapsed_s:.0f} s</small>"))
