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
MOST_CHANGES = 3  # between a result and one that it is told to be made anew for


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
    wanted = missing(tasks, root)
    keys = {task.key: task for task in wanted}
    reasons = {stage: Counter[str]() for stage in dict.fromkeys(task.stage for task in tasks)}
    for task in wanted:
        reasons[task.stage][_reason(task, keys, root)] += 1
    counts = Counter(task.stage for task in tasks)
    store = Store(root)
    found = []
    for stage, why in reasons.items():
        took = store.seconds(stage)
        found.append(ToDo(stage, counts[stage], dict(why), sum(why.values()) * median(took) if took else None))
    return found


def _reason(task: Task, wanted: Mapping[str, Task], root: Path) -> str:
    before = [wanted[key].stage for key in task.needs if key in wanted]
    if before:
        return f"its {before[0]} is to be made"
    folder = root / task.key
    if folder.is_dir():
        if fault := Store(root).fault(task.key):
            return f"damaged: {fault}"
        if has_failed(task, folder):
            return f"failed before: {read_outcome(folder).reason}"
    return _changes(dict(_flat(json.loads(json.dumps(task.inputs)))), root / KINDS[task.stage])


def _changes(inputs: dict[str, str], kind: Path) -> str:
    """What differs from the nearest of the results used last; "new" where none is near."""
    best: tuple[int, list[str]] = (MOST_CHANGES + 1, [])
    for other in _stored(kind):
        names = {name for name in inputs.keys() | other.keys() if inputs.get(name) != other.get(name)}
        if len(names) < best[0]:
            best = len(names), [_change(name, other.get(name), inputs.get(name)) for name in sorted(names)]
    return "; ".join(best[1]) or "new"


def _change(name: str, before: str | None, now: str | None) -> str:
    if name == "repeat":
        return "another repeat"
    if name == "code":
        return "its code in vobench changed"
    if name == "estimator":
        return "the estimator's files changed"
    short = [text if text is None or len(text) <= 24 else f"{text[:23]}…" for text in (before, now)]
    return f"{name}: {short[0] or 'nothing'} → {short[1] or 'nothing'}"


@cache
def _stored(kind: Path) -> list[dict[str, str]]:
    """The inputs of a kind's results, of those used last."""
    found = []
    with suppress(OSError):
        paths = sorted(kind.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
        for path in paths[:COMPARED]:
            with suppress(OSError, ValueError):
                found.append(dict(_flat(json.loads((path / INPUTS).read_text(encoding="utf-8")))))
    return found


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(inner, f"{name}.{key}" if name else key)
    else:
        yield name, json.dumps(value, ensure_ascii=False, sort_keys=True)
