"""No cell of a CSV file is a formula, and every text is read as it was written."""

import pytest

from vobench.spreadsheet import cell, value_in


@pytest.mark.parametrize("text", ["=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", "|calc", " =1+1", "\t=1+1"])
def test_a_formula_becomes_a_text(text):
    assert cell(text).startswith("'")


@pytest.mark.parametrize("value", ["too dark", "", "-1.5", "+2", "-1e-05", "-inf", "a=b", "'quoted'", -1.5, None, 3])
def test_other_values_are_not_changed(value):
    assert cell(value) == value


@pytest.mark.parametrize("text", ["=1+1", "-2+3", "-1.5", "it's", "'quoted'", "plain", ""])
def test_a_text_is_read_as_it_was_written(text):
    assert value_in(cell(text)) == text


def test_a_control_character_becomes_a_space():
    assert cell("a\x1b[2Jb") == "a [2Jb"
