"""Every form of a leaderboard parses back into the same numbers."""

import io
import json
import re

import pandas as pd
import pytest

from vobench.report import files, table
from vobench.report.table import HEADINGS


@pytest.fixture
def made(run, mixed):
    return files.boards_of(run, mixed)


def test_json_holds_every_row_in_full(made):
    read = json.loads(table.as_json(made))["boards"]
    assert [b["title"] for b in read] == [b.title for b in made]
    for board, again in zip(made, read, strict=True):
        assert [(r["estimator"], r["ate_mm"]) for r in again["rows"]] == [(r.estimator, r.ate_mm) for r in board.rows]


def test_csv_is_read_by_pandas_with_gaps_where_there_is_no_number(made):
    read = pd.read_csv(io.StringIO(table.csv(made)))
    written = [row for board in made for row in board.rows]
    assert list(read["estimator"]) == [row.estimator for row in written]
    numbers = [float("nan") if row.ate_mm is None else row.ate_mm for row in written]
    assert list(read["ate_mm"]) == pytest.approx(numbers, rel=1e-12, nan_ok=True)
    assert set(read["board"]) == {board.title for board in made}


def test_markdown_has_as_many_cells_in_every_line(made):
    text = table.markdown(made)
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in lines} == {len(HEADINGS) + 1}
    assert len(lines) == sum(len(board.rows) + 2 for board in made)
    assert text.count("\n## ") + text.startswith("## ") == len(made)
    assert "- mad: diverged: down: it went dark" in text


def test_latex_is_a_tabular_with_every_special_character_escaped(made):
    text = table.latex(made)
    assert text.startswith(r"\begin{tabular}{" + "l" * len(HEADINGS) + "}")
    assert text.rstrip().endswith(r"\end{tabular}")
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert len(rows) == 1 + len(made[0].rows)
    assert {line.count("&") for line in rows} == {len(HEADINGS) - 1}
    assert not re.search(r"(?<!\\)[_%#]", text)


def test_the_reports_of_a_run_are_written_beside_it(run, mixed):
    files.write_reports(run, mixed)
    assert {path.suffix for path in run.path.glob("leaderboard.*")} == {".md", ".json", ".csv", ".html"}
    assert json.loads((run.path / "leaderboard.json").read_text(encoding="utf-8"))


def test_cost_is_the_mean_over_frames_and_none_where_no_frame_was_answered(made):
    assert {row.estimator: row.ms_per_frame for row in made[0].rows} == {"good_one": 2.0, "mad": 2.0, "dead": None}
