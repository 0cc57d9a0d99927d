"""What holds for a board in every format."""

import csv
import html
import io
import re

import pytest

from vobench.report import page
from vobench.report.board_formats import FORMATS
from vobench.report.leaderboard import make_board
from vobench.runner.folder import TRUTH_COPY


@pytest.mark.parametrize("form", FORMATS)
def test_every_form_but_a_table_for_a_paper_says_which_cases_have_no_sequence(incomplete, form):
    text = FORMATS[form](make_board(incomplete, {}), "ate")
    assert ("no light" in text) == (form != "latex")
    assert "a" in text


@pytest.mark.parametrize("form", FORMATS)
def test_every_form_names_processor_driver_and_date(placed, form):
    text = FORMATS[form](placed, "ate")
    for part in ("CPU 9", "x86-64-v3", "pipe", "2026-11-24"):
        assert part in text


@pytest.mark.parametrize("form", [*FORMATS, "html"])
def test_every_form_names_an_estimator_that_equals_the_truth(tmp_path, scored, write_run, form):
    scores = [scored("copy", ate_m=1e-12, claims=(TRUTH_COPY,)), scored("fair")]
    folder = write_run(tmp_path / "suite" / "stamp", scores)
    made = page.run_board(folder, scores)
    text = page.board_page(folder, scores, made, tmp_path) if form == "html" else FORMATS[form](made, "ate")
    assert {"csv": "equals_truth"}.get(form, f"copy [{TRUTH_COPY}]") in plain(text) or form == "json"
    if form in ("md", "html", "json"):
        assert "copy is not ranked: on down, its motion equals the ground truth" in plain(text)
    if form == "csv":
        rows = csv.DictReader(io.StringIO(text))
        assert {row["estimator"]: row["equals_truth"] for row in rows if row["case"] == "down"} == {
            "copy": "True",
            "fair": "False",
        }


def plain(text):
    """A text without the escapes of HTML, LaTeX and Markdown."""
    return html.unescape(text).replace("\\", "")


HOSTILE = "<script>alert(1)</script>|&_%$#{}~^\\\x1b[2J\0"


@pytest.mark.parametrize("form", [*FORMATS, "html"])
def test_a_hostile_name_and_reason_harm_no_form(tmp_path, scored, write_run, form):
    scores = [scored("<script>", "crashed", ate_m=None, reason=HOSTILE), scored("fine")]
    folder = write_run(tmp_path / "suite" / "stamp", scores)
    made = page.run_board(folder, scores)
    text = page.board_page(folder, scores, made, tmp_path) if form == "html" else FORMATS[form](made, "ate")
    assert not {"\x1b", "\0"} & set(text)
    if form in ("md", "html"):
        assert "<script>alert" not in text
        assert not re.search(r"(?<!\\)<script>(?![\s\S]*</script>)", text)
    if form == "latex":
        assert "<" not in text.replace("$<$", "")


def test_a_board_without_any_sequence_is_empty_and_says_why(incomplete):
    made = make_board([score for score in incomplete if score.case != "down"], {})
    assert (made.cells, made.totals) == ((), ())
    for form, write in FORMATS.items():
        assert write(made, "ate"), form
