"""Every form of a leaderboard parses back into the same numbers."""

import html
import io
import json
import re

import pandas as pd
import pytest

from vobench.report import files, table
from vobench.report.table import HEADINGS
from vobench.results.estimate_file import FRAMES


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


@pytest.mark.parametrize("form", ["md", "json", "csv", "html"])
def test_every_form_shows_drift_and_the_commonest_reason_of_frames(tmp_path, scored, write_run, form):
    scores = [scored("still_one", drift_m=0.00234, ate_m=5.0), scored("moving_one", case="ahead")]
    folder = write_run(tmp_path / "suite" / "stamp", scores)
    path = folder.estimate("down", "still_one", 0) / FRAMES
    path.write_text(path.read_text() + "1,1,lost,few <7>,{},1.0,2.0\n2,2,lost,few <5>,{},1.0,2.0\n")
    files.write_reports(folder, scores)
    text = (folder.path / f"leaderboard.{form}").read_text(encoding="utf-8")
    if form in ("md", "html"):
        assert "still_one: stood still: drift 2.3 mm" in text
        assert 'still_one: 2 frames "few <7>", first at frame 1' in html.unescape(text)
        assert "5000.00" not in text
    elif form == "csv":
        (row,) = pd.read_csv(io.StringIO(text)).query("estimator == 'still_one' and board == 'down'").to_dict("records")
        assert (row["drift_mm"], row["frame_reason"], row["frame_reason_count"]) == (2.34, "few <7>", 2)
    else:
        (row,) = next(b["rows"] for b in json.loads(text)["boards"] if b["title"] == "down")
        assert (row["drift_mm"], row["ate_mm"], row["frame_reason_first"]) == (2.34, None, 1)
