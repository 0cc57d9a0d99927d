"""Tables fit the terminal, and lose no digit on the way."""

import io

import pytest
from rich.console import Console

from vobench.cli import board as cli_board
from vobench.cli import terminal
from vobench.cli.progress import Bars
from vobench.report.board_table import COST, HEADINGS, MEMORY
from vobench.report.leaderboard import board
from vobench.runner.folder import TrialScore
from vobench.suite.catalog import Entry, find

NAMES = ("wheel_odometry", "an_estimator_of_a_long_name", "lk_epipolar", "stereo_pnp")


def drawn(width, monkeypatch):
    file = io.StringIO()
    out = Console(file=file, width=width, markup=False, highlight=False)
    monkeypatch.setattr(terminal, "console", lambda: out)
    cli_board.print_board(board([trial(name, k) for name in NAMES for k in range(3)], {}))
    return file.getvalue()


def trial(name, repeat):
    score = {"metrics": [{"name": "ate_trans", "rmse": 1.2345 + repeat}]}
    facts = {"variant": {}, "reason": "", "coverage": 1.0, "frames": 9, "path_m": 100.0, "score": score}
    return TrialScore(case="down-short", estimator=name, repeat=repeat, status="ok", **facts)


@pytest.mark.parametrize("width", [60, 80, 100, 140])
def test_a_board_fits_with_every_cell_in_one_piece_and_what_has_no_room_is_said(width, monkeypatch):
    lines = drawn(width, monkeypatch).splitlines()
    assert max(map(len, lines)) <= width
    assert any("2.23" in line for line in lines)
    assert any("1.23–3.23" in line for line in lines)
    folded = ("wheel_", "estimator_", "lk_epipolar", "stereo_pnp")
    gone = " ".join(lines).split("no room for ", 1)[1].split(":")[0] if width < 80 else ""
    assert all(
        any(part in line for line in lines[:6]) or name in gone for name, part in zip(NAMES, folded, strict=True)
    )


def test_a_wide_terminal_shows_every_column_that_has_anything(monkeypatch):
    text = drawn(160, monkeypatch)
    assert all(heading in text for heading in HEADINGS if heading not in (COST, MEMORY))
    assert "no room" not in text


def test_the_columns_that_may_go_exist():
    assert set(cli_board.LEAST_FIRST) < set(HEADINGS)


def test_work_that_tells_its_share_shows_it_in_percent(monkeypatch):
    file, bars = io.StringIO(), Bars()
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
    terminal.warn_about_hidden([Entry("estimator", name, tmp_path / name, origin)])
    said = f"vobench: {name} is {tmp_path / name}, not the estimator included with vobench\n"
    assert capsys.readouterr() == ("", said if is_said else "")


def test_a_built_in_one_hides_none(capsys):
    terminal.warn_about_hidden([find("estimator", "lk_epipolar")])
    assert capsys.readouterr().err == ""
