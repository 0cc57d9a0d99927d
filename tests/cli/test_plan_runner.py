"""How the plans of explain, shrink and twin show their progress."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from vobench.cli.plan_runner import plan_runner
from vobench.cli.progress import Bars
from vobench.runner import launch


@pytest.mark.parametrize(
    ("jobs", "has_short_tasks", "counts_tasks"),
    [(1, False, False), (1, True, True), (2, False, True), (2, True, True)],
)
def test_short_or_parallel_tasks_are_counted_and_single_long_ones_show_their_own_progress(
    *,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    jobs: int,
    has_short_tasks: bool,
    counts_tasks: bool,
) -> None:
    given: dict[str, Any] = {}
    monkeypatch.setattr(launch, "plan_runner", given.update)
    plan_runner(out=tmp_path, jobs=jobs, has_short_tasks=has_short_tasks)
    assert isinstance(given["task_progress"], Bars) is not counts_tasks

    task = SimpleNamespace(stage="estimate", name="mine on a", key="a", needs=())
    other = SimpleNamespace(stage="estimate", name="mine on b", key="b", needs=())
    display = given["make_display"]()
    display.begin([task, other], {})
    display.hear(SimpleNamespace(what="done", task=task, wall_s=1.2, slot=0, told="", reason=""))
    assert ("[1/2] estimate mine on a: 1.2 s" in capsys.readouterr().err) is counts_tasks
