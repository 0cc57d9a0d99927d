"""What people see: tables on standard output, progress on standard error."""

import json as json_module
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

import typer

from vobench.errors import printable, require_known
from vobench.runner.progress import RunProgress

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn
    from rich.table import Table

    from vobench.runner.executor import Event
    from vobench.runner.task import Task
    from vobench.suite.catalog import Entry

Item = TypeVar("Item")
# Options and arguments that many verbs have.
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
SuiteName = Annotated[str, typer.Argument(metavar="SUITE", help="A suite's name, or a path to its YAML.")]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder, or runs/<suite> for its latest.")]


def _trust(is_given: bool) -> bool:
    if is_given:
        from vobench.trust import trust_new

        trust_new()
    return is_given


Trust = Annotated[
    bool,
    typer.Option("--trust", help="Run makers of scenes from elsewhere, now and as long as they stay.", callback=_trust),
]
LEFT_ALIGNED = {
    *("estimator", "status", "name", "case", "kind", "summary", "path", "origin", "check", "result"),
    *("sequence", "metric", "headline", "is", "with", "trajectory", "condition", "without", "instead", "tried"),
    *("is worse than others by", "statistic", "unit", "moved by"),
}


def known(kind: str, name: str, names: Iterable[str]) -> str:
    """The name, where it is known. Raises UnknownNameError where it is not."""
    require_known(kind, name, names)
    return name


def print_json(content: Any) -> None:
    """One JSON object on standard output."""
    print(json_module.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))


def warn(sentence: str) -> None:
    """A line on standard error."""
    print(printable(f"vobench: {sentence}"), file=sys.stderr)


def say_hidden(found: "Iterable[Entry]") -> None:
    """A line on standard error for each estimator that hides one of the same name that vobench brings along."""
    from vobench.suite.catalog import builtin_root

    for entry in found:
        ours = builtin_root() / "estimators" / entry.name
        if (
            entry.kind == "estimator"
            and entry.origin != "path"
            and ours.is_dir()
            and entry.path.resolve() != ours.resolve()
        ):
            print(printable(f"vobench: {entry.name} is {entry.path}, not vobench's own"), file=sys.stderr)


def console() -> "Console":
    """Standard output; lines are as long as they are where nobody watches."""
    from rich.console import Console

    plain = Console(markup=False, highlight=False)
    return plain if plain.is_terminal else Console(markup=False, highlight=False, width=200)


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> "Table":
    """A table with a bold title; words to the left, numbers to the right."""
    from rich import box
    from rich.table import Table

    made = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE, pad_edge=False)
    for heading in headings:
        made.add_column(heading, justify="left" if heading in LEFT_ALIGNED else "right", overflow="fold")
    for row in rows:
        made.add_row(*map(printable, row))
    return made


class Bars:
    """Progress on standard error: bars, or one line for each stage where that is no terminal."""

    def __init__(self) -> None:
        from rich.console import Console

        self._console = Console(stderr=True, markup=False)

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """The same items, counted on a bar that goes when they are through."""
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with self._progress(f"{what}: {total} frames", *columns) as progress:
            yield from progress.track(items, total=total, description=what)

    @contextmanager
    def step(self, what: str) -> Iterator[Callable[[float], object]]:
        """A spinner around work of unknown length, and a percentage where it tells its share."""
        from rich.progress import SpinnerColumn, TaskProgressColumn, TextColumn

        with self._progress(what, SpinnerColumn(), TextColumn(what), TaskProgressColumn()) as progress:
            task = progress.add_task(what, total=None)
            yield lambda share: progress.update(task, total=1.0, completed=share)

    def say(self, sentence: str) -> None:
        """A line of its own."""
        print(f"vobench: {sentence}", file=sys.stderr, flush=True)

    def _progress(self, line: str, *columns: "ProgressColumn") -> "Progress":
        from rich.progress import Progress

        if not self._console.is_terminal:
            print(line, file=sys.stderr, flush=True)
        return Progress(*columns, console=self._console, transient=True, disable=not self._console.is_terminal)


class TerminalDisplay:
    """A run on standard error, and a log of its events.

    On a terminal: one bar with the share that is done and the time left, and a line for each running task. Elsewhere,
    or with `is_verbose`, a line for each finished task. With `is_quiet`, failures alone.
    """

    def __init__(
        self, events: Path | None = None, *, is_serial: bool = False, is_quiet: bool = False, is_verbose: bool = False
    ) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        console = Console(stderr=True, markup=False)
        # One job draws bars of its own, within each task.
        self._draws = console.is_terminal and not is_serial and not is_quiet
        self._says_finished = is_verbose or not (self._draws or is_serial or is_quiet)
        self._is_quiet = is_quiet
        self._log = None if events is None else events.open("w", encoding="utf-8")
        columns = (
            TextColumn("{task.description}"),
            BarColumn(bar_width=BAR_WIDTH),
            TextColumn("{task.fields[told]}"),
            TimeElapsedColumn(),
        )
        self._bars = Progress(*columns, console=console, transient=True, disable=not self._draws)
        self._lines: dict[str, Any] = {}
        self._overall: Any = None
        self._progress = RunProgress()
        self._began_s = time.monotonic()

    def begin(self, tasks: "Sequence[Task]", seconds: "Mapping[str, float]") -> None:
        """Take the tasks that are to be performed, and what a task of each stage takes."""
        self._progress = RunProgress(tasks, seconds)
        self._began_s = time.monotonic()
        if tasks:
            self._overall = self._bars.add_task("all", total=1.0, told=self._progress.describe(0.0))

    def hear(self, event: "Event") -> None:
        """Draw and log one event."""
        if self._log:
            print(json_module.dumps(_logged(event), ensure_ascii=False), file=self._log, flush=True)
        if event.what == "told":
            self.say(event.told)
            return
        self._progress.count(event)
        if self._overall is not None:
            left = self._progress.describe(time.monotonic() - self._began_s)
            self._bars.update(self._overall, completed=self._progress.share, told=left)

        name = f"{event.task.stage} {event.task.name}"
        if event.what == "started":
            if self._draws:
                self._lines[event.task.key] = self._bars.add_task(name, total=None, told="")
            return
        if event.what in ("done", "failed") and event.task.key in self._lines:
            self._bars.remove_task(self._lines.pop(event.task.key))
        if event.what == "failed":
            self._print(f"{name}: failed: {event.reason}")
        elif event.what == "done" and self._says_finished:
            position = f"[{self._progress.finished}/{self._progress.planned}] " if self._progress.planned else ""
            self._print(f"{position}{name}: {event.wall_s:.1f} s")

    def say(self, sentence: str) -> None:
        """A line of its own, above all others."""
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


BAR_WIDTH = 24


def _logged(event: "Event") -> dict[str, Any]:
    """An event as a line of the log has it."""
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
