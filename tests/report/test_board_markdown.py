"""A board in Markdown."""

import re

import pytest

from vobench.report import page
from vobench.report.board_markdown import markdown
from vobench.report.leaderboard import make_board


@pytest.fixture
def made(run, mixed):
    return page.run_board(run, mixed)


def test_markdown_has_as_many_cells_in_every_line_of_a_table(made):
    text = markdown(made)
    for table in text.split("\n\n"):
        if table.startswith("|"):
            assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1
    assert "- down: mad: diverged: it went dark" in text
    assert "lost" not in text.split("## Totals")[0] or "crashed" in text


def test_words_are_left_aligned_and_numbers_right_aligned(scored):
    lines = markdown(make_board([scored("a"), scored("b")], {})).splitlines()
    rules = [line for line in lines if line.startswith("|---")]
    assert rules == [
        "|---|---:|---:|",
        "|---|---|---:|---:|---:|---:|",
    ]
    assert lines[0] == "## ATE % of path"
    assert "## Totals: 1 case, 1 drive, 1 place" in lines


def test_sentences_on_access_and_origin_follow_the_legend(scored, placed):
    assert markdown(placed).splitlines()[-1].startswith("Made on Some_CPU 9")
    text = markdown(make_board([scored("a")], {}))
    assert "Made on" not in text
    assert text.endswith("a: what it could see is not recorded.\n")


def test_the_legend_keeps_its_tilde(scored):
    assert "; \\~ not significantly worse" in markdown(make_board([scored("a")], {}))
