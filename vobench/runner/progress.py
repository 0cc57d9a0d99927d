"""What a person is shown of a run while it goes on: the tasks by stage, the share that is done, the time left."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol, Self

if TYPE_CHECKING:
    from vobench.runner.executor import TaskEvent
    from vobench.runner.task import Task


LEAST_CONCURRENCY = 0.1  # tasks at once, so that one slow start does not promise hours


class RunDisplay(Protocol):
    """Shows a run to whoever started it; entered before the first task and left after the last."""

    def __enter__(self) -> Self:
        """Start to show it."""

    def __exit__(self, *exception: object) -> None:
        """Stop to show it."""

    def begin(self, tasks: "Sequence[Task]", seconds: Mapping[str, float]) -> None:
        """Take the tasks that are to be performed, and the typical seconds of a task of each stage, where known."""

    def hear(self, event: "TaskEvent") -> None:
        """Take the news of one task."""

    def say(self, sentence: str) -> None:
        """Show a sentence of its own."""


class RunProgress:
    """How far a run has come, from the events of its tasks.

    The seconds that a task takes are the mean over finished tasks of its stage in this run, else the typical seconds
    of earlier runs. Without either for some stage that is still to do, the time left is not known.
    """

    def __init__(self, tasks: "Sequence[Task]" = (), typical_s: Mapping[str, float] = MappingProxyType({})) -> None:
        """No task is done yet. `typical_s` are the seconds of a task of each stage in earlier runs, where known."""
        self._stages = {task.key: task.stage for task in tasks}
        self._dependents: dict[str, list[str]] = defaultdict(list)
        for task in tasks:
            for needed in task.needs:
                self._dependents[needed].append(task.key)
        self._ended: set[str] = set()
        self._typical_s = typical_s
        self._taken_s: dict[str, list[float]] = defaultdict(list)

    def count(self, event: "TaskEvent") -> None:
        """Take the news of one task. A failed task takes those that need it with it."""
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
        """The number of tasks that have ended, well or not."""
        return len(self._ended)

    @property
    def planned(self) -> int:
        """The number of tasks in all."""
        return len(self._stages)

    @property
    def share(self) -> float:
        """The share of the work that is done, from 0 to 1: by seconds where they are known, else by tasks."""
        all_s = self._work_s(self._stages)
        done_s = self._work_s(self._ended)
        if all_s and done_s is not None:
            return min(done_s / all_s, 1.0)
        return self.finished / self.planned if self.planned else 1.0

    def left_s(self, elapsed_s: float) -> float | None:
        """The seconds left, `elapsed_s` after the start; None where too little is done to tell."""
        work_left_s = self._work_s(self._stages.keys() - self._ended)
        if work_left_s is None:
            return None
        done_s = sum(sum(taken) for taken in self._taken_s.values())
        # How many tasks have run at once, on the average.
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
        """The seconds that these tasks take, one after the other; None where that is not known."""
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
    """Seconds as minutes and seconds, or hours where there are some: ``0:40``, ``1:05:00``."""
    whole = round(seconds)
    minutes, rest = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
