"""A run on a display: which lines are printed, and what is logged."""

import io
import json
from types import SimpleNamespace

import pytest
from rich.console import Console

from vobench.cli.run_display import TerminalDisplay


def event(what, **facts):
    task = SimpleNamespace(stage="simulate", name="short", key="key1")
    defaults = {"told": "", "reason": "", "wall_s": 1.26, "slot": 0}
    return SimpleNamespace(what=what, task=task, **{**defaults, **facts})


@pytest.fixture
def display(monkeypatch):
    """A display on a console that is a terminal or not, and what it prints."""

    def show(*, is_terminal=False, events=None, **options):
        file = io.StringIO()
        console = Console(file=file, force_terminal=is_terminal, width=100, color_system=None)
        monkeypatch.setattr("rich.console.Console", lambda **_: console)
        return TerminalDisplay(events, **options), file

    return show


@pytest.mark.parametrize(
    ("options", "prints"),
    [
        ({}, True),
        ({"is_verbose": True}, True),
        ({"is_quiet": True}, False),
        ({"is_serial": True}, False),
        ({"is_serial": True, "is_verbose": True}, True),
        ({"is_terminal": True}, False),
        ({"is_terminal": True, "is_verbose": True}, True),
        ({"is_terminal": True, "is_quiet": True}, False),
    ],
)
def test_a_finished_task_is_a_line_unless_bars_show_it_or_quiet_was_asked_for(display, options, prints):
    shown, file = display(**options)
    shown.hear(event("done"))
    assert ("simulate short: 1.3 s" in file.getvalue()) is prints


@pytest.mark.parametrize("options", [{}, {"is_quiet": True}, {"is_serial": True}, {"is_terminal": True}])
def test_a_failure_is_always_a_line_with_its_reason(display, options):
    shown, file = display(**options)
    shown.hear(event("failed", reason="no light"))
    assert "simulate short: failed: no light" in file.getvalue()


def test_a_note_is_a_line_and_no_task(display):
    shown, file = display(is_quiet=True)
    shown.hear(event("told", told="be patient"))
    assert file.getvalue() == "vobench: be patient\n"


def test_a_start_prints_nothing_and_its_bar_goes_with_the_end(display):
    shown, file = display(is_terminal=True)
    shown.hear(event("started"))
    assert [bar.description for bar in shown._bars.tasks] == ["simulate short"]
    shown.hear(event("done"))
    assert shown._bars.tasks == []
    silent, file = display()
    silent.hear(event("started"))
    assert (silent._bars.tasks, file.getvalue()) == ([], "")


def test_every_event_is_logged_as_a_line(display, tmp_path):
    path = tmp_path / "events.jsonl"
    shown, _ = display(events=path, is_quiet=True)
    with shown:
        shown.hear(event("started"))
        shown.hear(event("failed", reason="no light", slot=2, wall_s=1.23456))
        shown.hear(event("told", told="be patient"))
    started, failed, told = [json.loads(line) for line in path.read_text().splitlines()]
    assert [each["event"] for each in (started, failed, told)] == ["started", "failed", "told"]
    assert {key: failed[key] for key in ("stage", "task", "key", "slot", "wall_s", "reason")} == {
        "stage": "simulate", "task": "short", "key": "key1", "slot": 2, "wall_s": 1.235, "reason": "no light",
    }  # fmt: skip
    assert told["reason"] == "be patient"
    assert started["t_s"] == pytest.approx(failed["t_s"], abs=60)


def test_a_task_that_was_planned_has_its_position_and_a_bar_for_all(display):
    shown, file = display(is_verbose=True)
    task = SimpleNamespace(stage="simulate", name="short", key="key1", needs=())
    shown.begin([task], {"simulate": 2.0})
    assert [bar.description for bar in shown._bars.tasks] == ["all"]
    shown.hear(event("done"))
    assert "[1/1] simulate short: 1.3 s" in file.getvalue()
    empty, _ = display()
    empty.begin([], {})
    assert empty._bars.tasks == []
