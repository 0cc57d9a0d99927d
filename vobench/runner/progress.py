"""The progress of a run: the tasks by stage, the finished share, and the remaining time."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol, Self

if TYPE_CHECKING:
    from vobench.runner.executor import TaskEvent
    from vobench.runner.task import Task


LEAST_CONCURRENCY = 0.1  # the smallest number of tasks at once, so that a slow start does not predict hours


class RunDisplay(Protocol):
    """Shows a run to the user. It is entered before the first task and exited after the last one."""

    def __enter__(self) -> Self:
        """Start to show the run."""

    def __exit__(self, *exception: object) -> None:
        """Stop to show the run."""

    def begin(self, tasks: "Sequence[Task]", seconds: Mapping[str, float]) -> None:
        """Get the tasks that will be performed, and the typical seconds of a task of each stage, if known."""

    def hear(self, event: "TaskEvent") -> None:
        """Handle an event of a task."""

    def say(self, sentence: str) -> None:
        """Show a sentence."""


class RunProgress:
    """The progress of a run, from the events of its tasks.

    The duration of a task is the mean over finished tasks of its stage in this run, or the typical duration in earlier
    runs. If neither is known for a remaining stage, the remaining time is unknown.
    """

    def __init__(self, tasks: "Sequence[Task]" = (), typical_s: Mapping[str, float] = MappingProxyType({})) -> None:
        """Begin without finished tasks. `typical_s` has the durations of tasks of each stage in earlier runs."""
        self._stages = {task.key: task.stage for task in tasks}
        self._dependents: dict[str, list[str]] = defaultdict(list)
        for task in tasks:
            for needed in task.needs:
                self._dependents[needed].append(task.key)
        self._ended: set[str] = set()
        self._typical_s = typical_s
        self._taken_s: dict[str, list[float]] = defaultdict(list)

    def count(self, event: "TaskEvent") -> None:
        """Handle an event of a task. If a task fails, the tasks that need it end, too."""
        task = event.task
        if event.what == "done":
            self._ended.add(task.key)
            self._taken_s[task.stage].append(event.wall_s)
        elif event.what == "failed":
            self._end_with_dependents(task.key)

    def _end_with_dependents(self, key: str) -> None:
        self._ended.add(key)
        for dependent in self._dependents[key]:
            if dependent not in self._ended:
                self._end_with_dependents(dependent)

    @property
    def finished(self) -> int:
        """The number of tasks that have ended, successfully or not."""
        return len(self._ended)

    @property
    def planned(self) -> int:
        """The total number of tasks."""
        return len(self._stages)

    @property
    def share(self) -> float:
        """The share of the work that is done, from 0 to 1, by time if durations are known, and otherwise by tasks."""
        all_s = self._work_s(self._stages)
        done_s = self._work_s(self._ended)
        if all_s and done_s is not None:
            return min(done_s / all_s, 1.0)
        return self.finished / self.planned if self.planned else 1.0

    def left_s(self, elapsed_s: float) -> float | None:
        """The remaining seconds, `elapsed_s` after the start; None if they are unknown."""
        work_left_s = self._work_s(self._stages.keys() - self._ended)
        if work_left_s is None:
            return None
        done_s = sum(sum(taken) for taken in self._taken_s.values())
        # The mean number of tasks that have run at once.
        concurrency = done_s / elapsed_s if elapsed_s > 0 and done_s > 0 else 1.0
        return work_left_s / max(concurrency, LEAST_CONCURRENCY)

    def describe(self, elapsed_s: float) -> str:
        """One line, such as ``task 7 of 38 · 45 % · 0:40 left``."""
        current = min(self.finished + 1, self.planned)
        parts = [f"task {current} of {self.planned}", f"{100 * self.share:.0f} %"]
        left_s = self.left_s(elapsed_s)
        if left_s is not None:
            parts.append(f"{spell_time(left_s)} left")
        return " · ".join(parts)

    def _work_s(self, keys: Iterable[str]) -> float | None:
        """The total duration of tasks in s; None if it is unknown."""
        total_s = 0.0
        for stage, count in Counter(self._stages.get(key, "") for key in keys).items():
            each_s = self._task_s(stage)
            if each_s is None:
                return None
            total_s += count * each_s
        return total_s

    def _task_s(self, stage: str) -> float | None:
        taken = self._taken_s.get(stage)
        return fmean(taken) if taken else self._typical_s.get(stage)


def spell_time(seconds: float) -> str:
    """Seconds as minutes and seconds, with hours if necessary: ``0:40``, ``1:05:00``."""
    whole = round(seconds)
    minutes, rest = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
