"""A dry run: the tasks that a run would perform, why each result is not in the store, and the estimated time."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

from vobench.runner.estimate import read_outcome
from vobench.runner.store import INPUTS, Store
from vobench.runner.task import KINDS, Task, has_failed, missing

MAX_COMPARED = 300  # the number of results that a task is compared to: those of its kind that were used last
MAX_CHANGES = 3  # a result that differs in more inputs is not similar to a task
MAX_VALUE_LENGTH = 24  # the largest number of characters of a value


@dataclass(frozen=True, slots=True)
class StageEstimate:
    """The tasks of one stage, those of them that must be performed, and the estimated time.

    `stage` is the name of the stage.
    `tasks` is the number of tasks, including those whose results are in the store.
    `reasons` maps each reason why tasks must be performed to the number of these tasks.
    `seconds` is the estimated time of the tasks that must be performed, or None if it is unknown.
    """

    stage: str
    tasks: int
    reasons: Mapping[str, int]
    seconds: float | None

    @property
    def pending(self) -> int:
        """The number of tasks that must be performed."""
        return sum(self.reasons.values())


def pending_tasks(tasks: Sequence[Task], root: Path) -> list[StageEstimate]:
    """The work that remains for tasks, by stage, given the folder `root` of the store."""
    pending = {task.key: task for task in missing(tasks, root)}
    store = Store(root)
    task_counts = Counter(task.stage for task in tasks)
    estimates = []
    for stage, task_count in task_counts.items():
        reasons = Counter(_reason(task, pending, root) for task in pending.values() if task.stage == stage)
        earlier_s = store.seconds(stage)
        remaining_s = None
        if earlier_s:
            remaining_s = reasons.total() * median(earlier_s)
        estimates.append(StageEstimate(stage, task_count, dict(reasons), remaining_s))
    return estimates


def _reason(task: Task, pending: Mapping[str, Task], root: Path) -> str:
    """The reason why a task must be performed. `pending` are all tasks that must be performed, by key."""
    for key in task.needs:
        if key in pending:
            return f"the {pending[key].stage} that it requires must be computed first"
    folder = root / task.key
    if folder.is_dir():
        fault = Store(root).fault(task.key)
        if fault:
            return f"damaged: {fault}"
        if has_failed(task, folder):
            return f"failed before: {read_outcome(folder).reason}"
    # Stored inputs have passed through JSON, which turns tuples into lists. The inputs of the task do so as well.
    as_stored = json.loads(json.dumps(task.inputs))
    values_by_name = dict(_flat(as_stored))
    return _changes(values_by_name, root / KINDS[task.stage])


def _changes(inputs: dict[str, str], kind_folder: Path) -> str:
    """The inputs that differ from those of the most similar recent result, or "new" if no result is similar.

    `inputs` are the inputs of the task, as text, by name.
    `kind_folder` is the folder of the results of the same kind.
    """
    most_similar: dict[str, str] = {}
    changed_names = set[str]()
    smallest_count = MAX_CHANGES + 1
    for other in _stored(kind_folder):
        all_names = inputs.keys() | other.keys()
        names = {name for name in all_names if inputs.get(name) != other.get(name)}
        if len(names) < smallest_count:
            smallest_count = len(names)
            changed_names = names
            most_similar = other
    changes = [_change(name, most_similar.get(name), inputs.get(name)) for name in sorted(changed_names)]
    return "; ".join(changes) or "new"


def _change(name: str, before: str | None, now: str | None) -> str:
    """The description of a changed input, with its values before and now. None stands for a missing input."""
    if name == "repeat":
        return "another repeat"
    if name == "code":
        return "its code in vobench changed"
    if name == "estimator":
        return "the estimator's files changed"
    return f"{name}: {_shortened(before)} → {_shortened(now)}"


def _shortened(text: str | None) -> str:
    if not text:
        return "nothing"
    if len(text) <= MAX_VALUE_LENGTH:
        return text
    return f"{text[: MAX_VALUE_LENGTH - 1]}…"


@cache
def _stored(kind_folder: Path) -> list[dict[str, str]]:
    """The inputs of the recent results in a folder, with nested keys joined by dots."""
    stored = []
    with suppress(OSError):
        paths = sorted(kind_folder.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
        for path in paths[:MAX_COMPARED]:
            with suppress(OSError, ValueError):
                inputs = json.loads((path / INPUTS).read_text(encoding="utf-8"))
                stored.append(dict(_flat(inputs)))
    return stored


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """The values of a nested dictionary as JSON, each with its keys joined by dots."""
    if isinstance(value, dict):
        for key, inner in value.items():
            inner_name = f"{name}.{key}" if name else key
            yield from _flat(inner, inner_name)
    else:
        yield name, json.dumps(value, ensure_ascii=False, sort_keys=True)
