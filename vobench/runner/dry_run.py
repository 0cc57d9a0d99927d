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

COMPARED = 300  # the number of results of each kind, those used last, to which a task is compared
MOST_CHANGES = 3  # a result with more changed inputs is not similar to a task
VALUE_LETTERS = 24


@dataclass(frozen=True, slots=True)
class ToDo:
    """The tasks of one stage: how many must be performed and why, and the estimated seconds, if known."""

    stage: str
    tasks: int
    reasons: Mapping[str, int]
    seconds: float | None

    @property
    def to_do(self) -> int:
        """The number of tasks that must be performed."""
        return sum(self.reasons.values())


def to_do(tasks: Sequence[Task], root: Path) -> list[ToDo]:
    """The tasks that must be performed, by stage and in order."""
    wanted = {task.key: task for task in missing(tasks, root)}
    store = Store(root)
    stages = []
    for stage, count in Counter(task.stage for task in tasks).items():
        reasons = Counter(_reason(task, wanted, root) for task in wanted.values() if task.stage == stage)
        taken_s = store.seconds(stage)
        left_s = reasons.total() * median(taken_s) if taken_s else None
        stages.append(ToDo(stage, count, dict(reasons), left_s))
    return stages


def _reason(task: Task, wanted: Mapping[str, Task], root: Path) -> str:
    """The reason why a task must be performed."""
    for key in task.needs:
        if key in wanted:
            return f"its {wanted[key].stage} is to be made"
    folder = root / task.key
    if folder.is_dir():
        fault = Store(root).fault(task.key)
        if fault:
            return f"damaged: {fault}"
        if has_failed(task, folder):
            return f"failed before: {read_outcome(folder).reason}"
    inputs = json.loads(json.dumps(task.inputs))
    return _changes(dict(_flat(inputs)), root / KINDS[task.stage])


def _changes(inputs: dict[str, str], kind: Path) -> str:
    """The differences between inputs and those of the most similar recent result; "new" if none is similar."""
    fewest: set[str] | None = None
    nearest: dict[str, str] = {}
    for other in _stored(kind):
        all_names = inputs.keys() | other.keys()
        names = {name for name in all_names if inputs.get(name) != other.get(name)}
        limit = MOST_CHANGES + 1 if fewest is None else len(fewest)
        if len(names) < limit:
            fewest = names
            nearest = other
    changes = [_change(name, nearest.get(name), inputs.get(name)) for name in sorted(fewest or ())]
    return "; ".join(changes) or "new"


def _change(name: str, before: str | None, now: str | None) -> str:
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
    return text if len(text) <= VALUE_LETTERS else f"{text[: VALUE_LETTERS - 1]}…"


@cache
def _stored(kind: Path) -> list[dict[str, str]]:
    """The inputs of the recent results of a kind."""
    stored = []
    with suppress(OSError):
        paths = sorted(kind.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
        for path in paths[:COMPARED]:
            with suppress(OSError, ValueError):
                inputs = json.loads((path / INPUTS).read_text(encoding="utf-8"))
                stored.append(dict(_flat(inputs)))
    return stored


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(inner, f"{name}.{key}" if name else key)
    else:
        yield name, json.dumps(value, ensure_ascii=False, sort_keys=True)
