"""Progress on a terminal, and where there is none."""

import io

from rich.console import Console

from vobench.cli.progress import Bars


def test_work_that_tells_its_share_shows_it_in_percent(monkeypatch):
    file, bars = io.StringIO(), Bars()
    monkeypatch.setattr(bars, "_console", Console(file=file, force_terminal=True, width=80))
    with bars.step("light of office") as tell:
        tell(0.42)
    assert " 42%" in file.getvalue()


def test_elsewhere_each_stage_is_one_line_and_items_pass_unchanged(capsys):
    bars = Bars()
    assert list(bars.track("abc", "short", total=3)) == ["a", "b", "c"]
    with bars.step("light of office") as tell:
        tell(0.5)
    bars.say("be patient")
    printed = capsys.readouterr()
    assert printed.err == "short: 3 frames\nlight of office\nvobench: be patient\n"
    assert printed.out == ""
