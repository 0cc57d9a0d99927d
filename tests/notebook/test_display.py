"""What a run shows in a program and in a notebook."""

from types import SimpleNamespace

import pytest

from vobench.notebook import display
from vobench.notebook.display import LineDisplay, NotebookDisplay, QuietDisplay, choose_display
from vobench.runner.executor import TaskEvent

TASK = SimpleNamespace(key="k", stage="bake", name="room & hall", needs=())


def test_a_line_for_each_task_that_ends_and_what_is_left(capsys):
    shown = LineDisplay()
    with shown:
        shown.begin([TASK], {"bake": 4.0})
        shown.hear(TaskEvent("started", TASK, slot=0))
        shown.hear(TaskEvent("done", TASK, slot=0, wall_s=3.21))
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "vobench: bake room & hall: 3.2 s (task 1 of 1 · 100 % · 0:00 left)\n")


def test_a_quiet_display_names_only_what_failed(capsys):
    with QuietDisplay() as shown:
        shown.begin([TASK], {})
        shown.hear(TaskEvent("told", TASK, slot=0, told="looked twice"))
        shown.hear(TaskEvent("failed", TASK, slot=0, reason="no light"))
    assert capsys.readouterr().err == "vobench: looked twice\nvobench: bake room & hall failed: no light\n"


def test_a_notebook_draws_one_bar_and_leaves_one_line(monkeypatch):
    ipython = pytest.importorskip("IPython.display")
    drawn = []
    handle = SimpleNamespace(update=lambda html: drawn.append(html.data))
    monkeypatch.setattr(ipython, "display", lambda html, display_id: drawn.append(html.data) or handle)
    monkeypatch.setattr(display, "REDRAW_S", 0.0)
    shown = NotebookDisplay()
    with shown:
        shown.begin([TASK], {"bake": 4.0})
        shown.hear(TaskEvent("started", TASK, slot=0))
        shown.hear(TaskEvent("done", TASK, slot=0, wall_s=3.0))
    assert "<progress" in drawn[0]
    assert "bake room &amp; hall" in drawn[1]
    assert drawn[-1].startswith("<small>1 of 1 tasks, ")


def test_outside_of_a_notebook_nothing_of_it_is_drawn():
    assert isinstance(choose_display(is_quiet=False), LineDisplay)
    assert type(choose_display(is_quiet=True)) is QuietDisplay
