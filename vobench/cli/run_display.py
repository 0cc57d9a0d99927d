"""Display of a run on standard error: progress bars, finished tasks and failures; and a log of its events."""

import json as json_module
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from vobench.errors import printable
from vobench.runner.progress import RunProgress

if TYPE_CHECKING:
    from vobench.runner.executor import TaskEvent
    from vobench.runner.task import Task

BAR_WIDTH = 24


class TerminalDisplay:
    """Shows a run on standard error, and logs its events to the file `events`, if any.

    On a terminal, one bar shows the completed share and the remaining time, and each running task has a line below it.
    Elsewhere, or with `is_verbose`, each finished task is printed as a line. With `is_quiet`, only failures are
    printed. A serial run has no bars here, because its tasks draw their own.
    """

    def __init__(
        self, events: Path | None = None, *, is_serial: bool = False, is_quiet: bool = False, is_verbose: bool = False
    ) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        console = Console(stderr=True, markup=False)
        self._draws_bars = console.is_terminal and not is_serial and not is_quiet
        shows_progress = self._draws_bars or is_serial  # by a bar, here or in the task
        self._prints_finished = is_verbose or not (shows_progress or is_quiet)
        self._log = None if events is None else events.open("w", encoding="utf-8")

        columns = (
            TextColumn("{task.description}"),
            BarColumn(bar_width=BAR_WIDTH),
            TextColumn("{task.fields[status]}"),
            TimeElapsedColumn(),
        )
        self._bars = Progress(*columns, console=console, transient=True, disable=not self._draws_bars)
        self._bar_by_task: dict[str, Any] = {}
        self._overall_bar: Any = None
        self._progress = RunProgress()
        self._start_s = time.monotonic()

    def begin(self, tasks: "Sequence[Task]", seconds: "Mapping[str, float]") -> None:
        """Begin the run: the tasks to perform, and the typical duration of a task of each stage."""
        self._progress = RunProgress(tasks, seconds)
        self._start_s = time.monotonic()
        if tasks:
            self._overall_bar = self._bars.add_task("all", total=1.0, status=self._progress.describe(0.0))

    def hear(self, event: "TaskEvent") -> None:
        """Log and show one event."""
        if self._log:
            line = json_module.dumps(_log_entry(event), ensure_ascii=False)
            print(line, file=self._log, flush=True)
        if event.what == "told":  # a message from a task, which does not change its state
            self.say(event.told)
            return

        self._progress.count(event)
        self._update_overall_bar()
        if event.what == "started":
            self._add_bar(event)
        elif event.what == "done":
            self._remove_bar(event)
            self._print_finished(event)
        elif event.what == "failed":
            self._remove_bar(event)
            self._print(f"{_task_name(event)}: failed: {event.reason}")

    def _update_overall_bar(self) -> None:
        """Show the completed share of the run and its remaining time."""
        if self._overall_bar is None:
            return
        status = self._progress.describe(time.monotonic() - self._start_s)
        self._bars.update(self._overall_bar, completed=self._progress.share, status=status)

    def _add_bar(self, event: "TaskEvent") -> None:
        """Add a bar for a task that has started."""
        if self._draws_bars:
            self._bar_by_task[event.task.key] = self._bars.add_task(_task_name(event), total=None, status="")

    def _remove_bar(self, event: "TaskEvent") -> None:
        """Remove the bar of a task, if it has one."""
        bar = self._bar_by_task.pop(event.task.key, None)
        if bar is not None:
            self._bars.remove_task(bar)

    def _print_finished(self, event: "TaskEvent") -> None:
        """Print the name and duration of a finished task, and how many of the planned tasks are finished."""
        if not self._prints_finished:
            return
        planned = self._progress.planned
        counter = f"[{self._progress.finished}/{planned}] " if planned else ""
        self._print(f"{counter}{_task_name(event)}: {event.wall_s:.1f} s")

    def say(self, sentence: str) -> None:
        """Print a sentence as one line above the bars."""
        self._print(f"vobench: {sentence}")

    def _print(self, line: str) -> None:
        self._bars.console.print(printable(line), highlight=False, soft_wrap=True)

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()
        if self._log:
            self._log.close()


def _task_name(event: "TaskEvent") -> str:
    return f"{event.task.stage} {event.task.name}"


def _log_entry(event: "TaskEvent") -> dict[str, Any]:
    """An event as a JSON object, which is one line of the log."""
    return {
        "t_s": round(time.time(), 3),
        "event": event.what,
        "stage": event.task.stage,
        "task": event.task.name,
        "key": event.task.key,
        "slot": event.slot,
        "wall_s": round(event.wall_s, 3),
        "reason": event.told or event.reason,
    }
