"""Tables fit the terminal, and lose no digit on the way."""

import io

import pytest
from rich.console import Console

from vobench.cli import report, terminal
from vobench.report.leaderboard import HEADINGS, Board, Row
from vobench.suite.catalog import Entry, find

ROW = Row(
    rank=1,
    estimator="wheel_odometry",
    status="invalid_output",
    survived=11,
    partial=0,
    runs=12,
    ate_mm=1234.567,
    segment_percent=12.345,
    rpe_mm=1.234,
    rpe_deg=0.1234,
    coverage=0.999,
    ms_per_frame=123.4,
    reason="",
    drift_mm=None,
    frame_reason="",
    frame_reason_count=0,
    frame_reason_first=None,
)


def drawn(width, monkeypatch):
    file = io.StringIO()
    out = Console(file=file, width=width, markup=False, highlight=False)
    monkeypatch.setattr(terminal, "console", lambda: out)
    report.print_boards([Board("short", (ROW,))])
    return file.getvalue()


@pytest.mark.parametrize("width", [60, 80, 100, 140])
def test_a_board_fits_with_every_cell_in_one_piece(width, monkeypatch):
    lines = drawn(width, monkeypatch).splitlines()
    assert max(map(len, lines)) <= width
    (row,) = (line for line in lines if "wheel_odometry" in line)
    assert "invalid_output" in row
    assert "1234.57" in row


def test_a_wide_terminal_shows_every_column(monkeypatch):
    assert all(heading in drawn(140, monkeypatch) for heading in HEADINGS)


def test_the_columns_that_may_go_exist():
    assert set(report.LEAST_FIRST) < set(HEADINGS)


def test_work_that_tells_its_share_shows_it_in_percent(monkeypatch):
    file, bars = io.StringIO(), terminal.Bars()
    monkeypatch.setattr(bars, "_console", Console(file=file, force_terminal=True, width=80))
    with bars.step("light of office") as tell:
        tell(0.42)
    assert " 42%" in file.getvalue()


def test_no_text_of_others_steers_the_terminal():
    out = io.StringIO()
    Console(file=out, width=80, markup=False).print(terminal.table("", ["name"], [["a\x1b[2J\0b\ud800"]]))
    assert not {"\x1b", "\0", "\ud800"} & set(out.getvalue())
    assert "a [2J b" in out.getvalue()


@pytest.mark.parametrize(
    ("origin", "name", "is_said"),
    [("./estimators", "stand_still", True), ("path", "stand_still", False), ("./estimators", "mine", False)],
)
def test_an_estimator_that_hides_a_built_in_one_is_said(tmp_path, capsys, origin, name, is_said):
    terminal.say_hidden([Entry("estimator", name, tmp_path / name, origin)])
    said = f"vobench: {name} is {tmp_path / name}, not vobench's own\n"
    assert capsys.readouterr() == ("", said if is_said else "")


def test_a_built_in_one_hides_none(capsys):
    terminal.say_hidden([find("estimator", "lk_epipolar")])
    assert capsys.readouterr().err == ""
