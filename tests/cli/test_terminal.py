"""Tables fit the terminal, and lose no digit on the way."""

import io

import pytest
from rich.console import Console

from vobench.cli import terminal
from vobench.suite.catalog import CatalogEntry, find


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
    terminal.warn_about_hidden([CatalogEntry("estimator", name, tmp_path / name, origin)])
    said = f"vobench: {name} is {tmp_path / name}, not the estimator included with vobench\n"
    assert capsys.readouterr() == ("", said if is_said else "")


def test_a_built_in_one_hides_none(capsys):
    terminal.warn_about_hidden([find("estimator", "lk_epipolar")])
    assert capsys.readouterr().err == ""
