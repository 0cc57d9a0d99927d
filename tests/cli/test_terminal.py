"""Tables fit the terminal, and lose no digit on the way."""

import io

import pytest
from rich.console import Console

from vobench.cli import terminal


def test_no_text_of_others_steers_the_terminal():
    out = io.StringIO()
    Console(file=out, width=80, markup=False).print(terminal.table("", ["name"], [["a\x1b[2J\0b\ud800"]]))
    assert not {"\x1b", "\0", "\ud800"} & set(out.getvalue())
    assert "a [2J b" in out.getvalue()


@pytest.mark.parametrize(
    ("cells", "justify"),
    [
        (["1.5", "-3", "–"], "right"),
        (["≥ 2", "+3 %", "×1.3", "[0.9, 1.1]", ".7", ""], "right"),
        (["12 of 33", "4"], "right"),
        (["1.5", "lost"], "left"),
        (["stand_still"], "left"),
        (["-e", "-j"], "left"),
    ],
)
def test_columns_of_numbers_alone_are_aligned_to_the_right(cells, justify):
    column = terminal.table("", ["heading"], [[cell] for cell in cells]).columns[0]
    assert column.justify == justify


def test_redirected_lines_have_the_width_of_columns_if_it_is_set(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    assert terminal.console().width == terminal.REDIRECTED_WIDTH
    monkeypatch.setenv("COLUMNS", "72")
    assert terminal.console().width == 72
