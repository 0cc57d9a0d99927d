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


def shown(headings, rows):
    out = io.StringIO()
    console = Console(file=out, width=terminal.console().width)
    console.print(terminal.table("", headings, rows))
    return out.getvalue().splitlines()


HEADINGS = ("trial", "first bad frame", "contributing conditions")
ROWS = [["unlike_eyes-0-car_park", "11", "gloss ×2"], ["low_light-0-room", "", "speed ×2, gloss ×3, turn ×2"]]


@pytest.mark.parametrize("width", range(48, 90))
def test_a_narrow_table_breaks_between_words_and_fits(monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    lines = shown(HEADINGS, ROWS)
    assert max(map(len, lines)) <= width
    words = [word for line in lines for word in line.split() if "─" not in word]
    expected = [word for row in (HEADINGS, *ROWS) for cell in row for word in cell.split()]
    assert sorted(words) == sorted(expected)


def test_headings_break_before_cells_do(monkeypatch):
    monkeypatch.setenv("COLUMNS", "64")
    assert any("gloss ×3, turn ×2" in line for line in shown(HEADINGS, ROWS))


def test_lines_of_a_heading_count_by_themselves(monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    lines = shown(("case", "wheel_\nodometry", "two words"), [["short", "1\n0.5 to 2", "3"]])
    assert any("two words" in line for line in lines)


def test_a_table_is_as_wide_as_its_cells_if_the_console_is_wider(monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    header = next(line for line in shown(HEADINGS, ROWS) if "trial" in line)
    assert header.split() == ["trial", "first", "bad", "frame", "contributing", "conditions"]


def test_redirected_lines_have_the_width_of_columns_if_it_is_set(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    assert terminal.console().width == terminal.REDIRECTED_WIDTH
    monkeypatch.setenv("COLUMNS", "72")
    assert terminal.console().width == 72
