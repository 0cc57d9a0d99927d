"""What vobench compare prints of changes."""

import pytest

from vobench.cli import compare as cli_compare
from vobench.report.compare import SAME, ScoreChange


def change(case="", *, verdict="worse", **facts):
    defaults = {"old": "1.0", "new": "2.0", "ratio": 2.0, "interval": None, "p": 0.0123}
    return ScoreChange(case=case, estimator="lk", verdict=verdict, **{**defaults, **facts})


@pytest.mark.parametrize(
    ("facts", "text"),
    [
        ({"ratio": None}, ""),
        ({"ratio": 1.2345}, "1.23"),
        ({"ratio": 1.2345, "interval": (0.9, 1.5678)}, "1.23 [0.9, 1.57]"),
    ],
)
def test_a_ratio_has_three_digits_and_its_interval(facts, text):
    assert cli_compare._format_ratio(change(**facts)) == text


def test_a_row_leaves_out_what_is_not_known():
    assert cli_compare._row(change()) == ["lk", "worse", "1.0", "2.0", "2", "0.012"]
    assert cli_compare._row(change(ratio=None, p=None)) == ["lk", "worse", "1.0", "2.0", "", ""]


def test_totals_and_changed_cells_are_tables_and_equal_cells_are_counted(capsys):
    cells = [change("dark"), change("light", verdict=SAME), change("dim", verdict=SAME)]
    cli_compare._print_changes([change(), *cells], ["CPU: a and b"])
    printed = capsys.readouterr().out
    assert "lost-aware score over all cases" in printed
    assert "dark" in printed
    assert "light" not in printed
    assert "2 of 3 cells are the same to the last digit" in printed
    assert "The runs differ in settings that can change scores: CPU: a and b" in printed


def test_without_changes_there_is_no_table(capsys):
    cli_compare._print_changes([change("light", verdict=SAME)], [])
    printed = capsys.readouterr().out
    assert "ATE" not in printed
    assert "lost-aware score over" not in printed
    assert "differ" not in printed
    assert "1 of 1 cells" in printed
