"""A board on a terminal leaves out what does not fit, and says what."""

import io

import pytest
from rich.console import Console
from rich.measure import Measurement

from vobench.cli import board as cli_board
from vobench.cli import terminal
from vobench.report.board_table import COST, HEADINGS, MEMORY
from vobench.report.leaderboard import make_board
from vobench.runner.folder import TrialScore


def trial(case, name):
    score = {"metrics": [{"name": "ate_trans", "rmse": 1.0}]}
    facts = {"variant": {}, "reason": "", "coverage": 1.0, "frames": 9, "path_m": 100.0, "score": score}
    return TrialScore(case=case, estimator=name, repeat=0, status="ok", **facts)


def printed(trials, width, monkeypatch):
    file = io.StringIO()
    console = Console(file=file, width=width, markup=False, highlight=False)
    monkeypatch.setattr(terminal, "console", lambda: console)
    cli_board.print_board(make_board(trials, {}))
    return file.getvalue()


@pytest.mark.parametrize(
    ("name", "folded"),
    [
        ("lk_epipolar", "lk_epipolar"),
        ("wheel_odometry", "wheel_\nodometry"),
        ("a_b_c", "a_b_c"),
        ("averyverylongname", "averyverylongname"),
        ("averyverylongname_b", "averyverylongname_\nb"),
        ("stereo_pnp_ii", "stereo_pnp_\nii"),
        ("exactly_12_x", "exactly_12_x"),
    ],
)
def test_a_name_is_broken_after_underscores_into_lines_of_twelve(name, folded):
    assert cli_board._folded(name) == folded
    assert folded.replace("\n", "") == name


def test_at_most_sixty_cases_are_shown_and_the_others_are_counted(monkeypatch):
    text = printed([trial(f"case_{number:02}", "a") for number in range(62)], 120, monkeypatch)
    assert "case_59" in text
    assert "case_60" not in text
    assert "2 more cases: see --format csv" in text
    assert "more cases" not in printed([trial(f"case_{number:02}", "a") for number in range(60)], 120, monkeypatch)


def test_estimators_that_do_not_fit_are_named_and_one_always_remains(monkeypatch):
    names = ["first_estimator", "second_estimator", "third_estimator"]
    trials = [trial("case", name) for name in names]
    assert "no room" not in printed(trials, 200, monkeypatch)
    text = printed(trials, 20, monkeypatch)
    gone = next(line for line in " ".join(text.split()).split("no room for ")[1:])
    assert gone.startswith("second_estimator, third_estimator: use a wider terminal, or --format csv")


def test_a_narrow_terminal_omits_the_least_important_columns_of_the_totals_first(monkeypatch):
    headings = ["estimator", "× best", "lost", "decided", "score"]
    rows = [["stand_still", "1.00", "0 of 9", "yes", "0.5"]]
    width_by_omitted = {}
    for width in range(80, 10, -1):
        console = Console(file=io.StringIO(), width=width)
        fitted = cli_board._fit_totals("totals", headings, rows, console)
        width_by_omitted.setdefault(tuple(fitted.omitted), width)
        columns = [str(column.header) for column in fitted.table.columns]
        assert columns == [heading for heading in headings if heading not in fitted.omitted]
    assert list(width_by_omitted) == [
        (),
        ("score",),
        ("decided", "score"),
        ("lost", "decided", "score"),
        ("× best", "lost", "decided", "score"),
    ]


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        (cli_board.ShownCell("1.2"), "1.2"),
        (cli_board.ShownCell("1.2", mark="*"), "1.2*"),
        (cli_board.ShownCell("1.2", range="1–2", mark="~"), "1.2~\n1–2"),
    ],
)
def test_a_cell_has_its_mark_behind_and_its_range_below(cell, text):
    assert cli_board._cell_text(cell) == text


NAMES = ("wheel_odometry", "an_estimator_of_a_long_name", "lk_epipolar", "stereo_pnp")


def drawn(width, monkeypatch):
    file = io.StringIO()
    out = Console(file=file, width=width, markup=False, highlight=False)
    monkeypatch.setattr(terminal, "console", lambda: out)
    cli_board.print_board(make_board([repeated(name, k) for name in NAMES for k in range(3)], {}))
    return file.getvalue()


def repeated(name, repeat):
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
    (header,) = (line for line in text.splitlines() if "× best" in line and "estimator" in line)
    assert "Nothing is tested" in text
    empty = {COST, MEMORY, "decided"}
    assert [heading for heading in HEADINGS if heading not in header] == [
        heading for heading in HEADINGS if heading in empty
    ]
    assert "no room" not in text


def test_the_columns_that_may_go_exist():
    assert set(cli_board.COLUMNS_TO_DROP) < set(HEADINGS)


def test_a_table_that_is_exactly_as_wide_as_the_terminal_fits():
    table = terminal.table("", ["name"], [["x" * 30]])
    width = Measurement.get(Console(width=200), Console(width=200).options, table).maximum
    assert cli_board._fits(table, Console(width=width))
    assert not cli_board._fits(table, Console(width=width - 1))


def test_a_terminal_has_three_notes_and_the_page_the_others(monkeypatch):
    trials = [trial(f"case_{k}", "first") for k in range(3)]
    trials = [each.model_copy(update={"status": "partial", "reason": f"reason {k}"}) for k, each in enumerate(trials)]
    text = printed([*trials, trial("case_0", "second")], 200, monkeypatch)
    assert sum(f"reason {k}" in text for k in range(3)) == 1  # after two remarks on what the totals cover
    assert "2 more notes: see leaderboard.html, or --format md" in text
