"""A dry run: what a run would make, why each result is not in the store, and about how long that takes."""

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

COMPARED = 300  # of each kind, the results used last
MOST_CHANGES = 3  # between a task's inputs and a result's that its reason compares them with
VALUE_LETTERS = 24


@dataclass(frozen=True, slots=True)
class ToDo:
    """One stage: how many tasks it has, how many are to be done and why, and seconds by what others took, if known."""

    stage: str
    tasks: int
    reasons: Mapping[str, int]
    seconds: float | None

    @property
    def to_do(self) -> int:
        """How many tasks are to be done."""
        return sum(self.reasons.values())


def to_do(tasks: Sequence[Task], root: Path) -> list[ToDo]:
    """What is to be done, stage by stage in order."""
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
    """Why a task is to be done."""
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
    """The differences from the most similar of the results used last; "new" if none is similar."""
    fewest: set[str] | None = None
    nearest: dict[str, str] = {}
    for other in _stored(kind):
        names = {name for name in inputs.keys() | other.keys() if inputs.get(name) != other.get(name)}
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
    """The inputs of a kind's results, of those used last."""
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
