"""The law of ranking: no failed run ever ranks before an estimator that survived."""

import html
import io
import json
import re
import time
from itertools import pairwise

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.report import leaderboard, page
from vobench.report.leaderboard import HEADINGS, EstimatorStatistics, answers, board, boards
from vobench.run.folder import STATUSES, SURVIVED, TrialScore
from vobench.run.frames import COLUMNS, FRAMES, TIMES, FrameRow, new_table

CASES = ("a", "b")
ates = st.none() | st.floats(0, 1e6)
runs = st.fixed_dictionaries(
    {name: st.tuples(*[st.tuples(st.sampled_from(STATUSES), ates)] * len(CASES)) for name in ("p", "q", "r", "s")}
)


def scores_of(outcomes):
    return [
        TrialScore(
            case=case,
            variant={},
            estimator=name,
            repeat=0,
            status=status,
            reason="",
            coverage=1.0,
            frames=9,
            path_m=1.0,
            score=None if ate is None else {"metrics": [{"name": "ate_trans", "rmse": ate}]},
        )
        for name, results in outcomes.items()
        for case, (status, ate) in zip(CASES, results, strict=True)
    ]


def failures(results):
    return sum(status not in SURVIVED for status, _ in results)


@given(runs)
def test_no_failure_ranks_before_a_survivor_however_small_its_error(outcomes):
    for made in boards(scores_of(outcomes), {}):
        failed = [row.runs - row.survived for row in made.rows]
        assert failed == sorted(failed)
        ranks = {row.estimator: row.rank for row in made.rows}
        for one in made.rows:
            for other in made.rows:
                if one.survived == one.runs and other.survived < other.runs:
                    assert ranks[one.estimator] < ranks[other.estimator]


@given(runs)
def test_everyone_who_ran_is_in_the_board_once(outcomes):
    overall = boards(scores_of(outcomes), {})[0]
    assert sorted(row.estimator for row in overall.rows) == sorted(outcomes)
    assert {row.estimator: row.runs - row.survived for row in overall.rows} == {
        name: failures(results) for name, results in outcomes.items()
    }


@given(runs, st.randoms(use_true_random=False))
def test_the_order_of_scores_does_not_matter(outcomes, random):
    shuffled = scores_of(outcomes)
    random.shuffle(shuffled)
    assert boards(shuffled, {}) == boards(scores_of(outcomes), {})


@given(runs)
def test_ranks_count_from_one_and_skip_as_many_as_are_tied(outcomes):
    rows = boards(scores_of(outcomes), {})[0].rows
    assert rows[0].rank == 1
    for position, (above, below) in enumerate(pairwise(rows), start=2):
        assert below.rank in (above.rank, position)


@given(st.floats(0, 1e6), st.floats(0, 1e6))
def test_among_survivors_the_smaller_error_is_first(one, other):
    rows = board("", scores_of({"p": [("ok", one)] * 2, "q": [("ok", other)] * 2}), {}).rows
    assert (rows[0].estimator, rows[0].rank) == ("p" if one <= other else "q", 1)
    assert (rows[1].rank == 1) == (one == other)


def test_one_that_was_blind_for_a_while_ranks_after_one_that_saw_all(scored):
    rows = board("", [scored("sharp", "partial", ate_m=0.001), scored("blunt", ate_m=0.5)], {}).rows
    assert [row.estimator for row in rows] == ["blunt", "sharp"]


def test_equal_results_share_a_rank_and_the_next_is_skipped(scored):
    rows = board("", [scored(name, ate_m=ate) for name, ate in (("b", 0.1), ("a", 0.1), ("c", 0.2))], {}).rows
    assert [(row.estimator, row.rank) for row in rows] == [("a", 1), ("b", 1), ("c", 3)]


def test_means_are_over_the_runs_that_survived(mixed):
    (mad,) = (
        row for row in boards(mixed, {("ahead", "mad"): EstimatorStatistics(4.0)})[0].rows if row.estimator == "mad"
    )
    assert (mad.survived, mad.runs, mad.status, mad.reason) == (1, 2, "diverged", "down: it went dark")
    assert mad.ate_mm == pytest.approx(1e-6)
    assert mad.ms_per_frame == 4.0


def test_one_that_never_survived_has_no_numbers_and_a_reason(mixed):
    dead = boards(mixed, {})[0].rows[-1]
    assert (dead.estimator, dead.survived, dead.ate_mm, dead.rpe_mm) == ("dead", 0, None, None)
    assert dead.status == "crashed"


def test_one_case_needs_no_board_over_all(scored):
    assert [b.title for b in boards([scored("a")], {})] == ["down"]
    assert [b.title for b in boards([scored("a"), scored("a", case="ahead")], {})] == ["all 2 cases", "ahead", "down"]


@given(runs)
def test_of_equal_failures_fewer_partial_runs_rank_first(outcomes):
    places = [(row.runs - row.survived, row.partial) for row in boards(scores_of(outcomes), {})[0].rows]
    assert places == sorted(places)
    partial = {name: sum(status == "partial" for status, _ in results) for name, results in outcomes.items()}
    assert {row.estimator: row.partial for row in boards(scores_of(outcomes), {})[0].rows} == partial


def test_over_several_cases_a_reason_names_its_case():
    both = scores_of({"p": (("ok", 0.1), ("crashed", None))})
    told = [score.model_copy(update={"reason": "out of luck" if score.case == "b" else ""}) for score in both]
    assert [made.rows[0].reason for made in boards(told, {})] == ["b: out of luck", "", "out of luck"]


@given(runs, st.floats(0, 1e3))
def test_a_case_that_stands_still_changes_no_error_and_no_rank(outcomes, drift_m):
    """Nothing but whether it was survived counts of it."""
    moving = scores_of(outcomes)
    still = [
        s.model_copy(update={"case": "still", "drift_m": drift_m, "status": "ok"}) for s in moving if s.case == "a"
    ]
    before, after = (boards(scores, {})[0].rows for scores in (moving, [*moving, *still]))
    shown = [[(r.rank, r.estimator, r.ate_mm, r.segment_percent, r.rpe_mm) for r in rows] for rows in (before, after)]
    assert shown[0] == shown[1]


def test_a_still_case_shows_the_largest_drift_of_its_runs_and_no_error(scored):
    scores = [scored("a", repeat=n, drift_m=drift, ate_m=9.0) for n, drift in enumerate((0.0023, 0.001))]
    (row,) = board("down", scores, {}).rows
    assert (row.drift_mm, row.ate_mm, row.survived) == (2.3, None, 2)


def frames(*reasons):
    return [
        FrameRow(10 + k, k, "lost", reason, None, None, None, None, None, None, "{}", 1.0, 2.0)
        for k, reason in enumerate(reasons)
    ]


def test_the_commonest_reason_of_frames_is_counted_whatever_its_numbers(scored):
    rows = frames("", "blurred", "too few tracks (7)", "", "too few tracks (-1.5e3)", "too few tracks")
    found = answers([rows])
    assert found == EstimatorStatistics(2.0, "too few tracks (7)", 2, 12, frames=6)
    (row,) = board("down", [scored("a")], {("down", "a"): found}).rows
    assert (row.frame_reason, row.frame_reason_count, row.frame_reason_first) == ("too few tracks (7)", 2, 12)


def test_frames_without_a_reason_have_none_and_no_frame_no_answer():
    assert answers([frames("", ""), []]) == EstimatorStatistics(2.0, frames=2)
    assert answers([[], []]) == EstimatorStatistics()


@pytest.fixture
def made(run, mixed):
    return page.boards_of(run, mixed)


def test_json_holds_every_row_in_full(made):
    read = json.loads(leaderboard.as_json(made))["boards"]
    assert [b["title"] for b in read] == [b.title for b in made]
    for shown, again in zip(made, read, strict=True):
        assert [(r["estimator"], r["ate_mm"]) for r in again["rows"]] == [(r.estimator, r.ate_mm) for r in shown.rows]


def test_csv_is_read_by_pandas_with_gaps_where_there_is_no_number(made):
    read = pd.read_csv(io.StringIO(leaderboard.csv(made)))
    written = [row for board in made for row in board.rows]
    assert list(read["estimator"]) == [row.estimator for row in written]
    numbers = [float("nan") if row.ate_mm is None else row.ate_mm for row in written]
    assert list(read["ate_mm"]) == pytest.approx(numbers, rel=1e-12, nan_ok=True)
    assert set(read["board"]) == {board.title for board in made}


def test_markdown_has_as_many_cells_in_every_line(made):
    text = leaderboard.markdown(made)
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in lines} == {len(HEADINGS) + 1}
    assert len(lines) == sum(len(board.rows) + 2 for board in made)
    assert text.count("\n## ") + text.startswith("## ") == len(made)
    assert "- mad: diverged: down: it went dark" in text


def test_latex_is_a_tabular_with_every_special_character_escaped(made):
    text = leaderboard.latex(made)
    assert text.startswith(r"\begin{tabular}{" + "l" * len(HEADINGS) + "}")
    assert text.rstrip().endswith(r"\end{tabular}")
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert len(rows) == 1 + len(made[0].rows)
    assert {line.count("&") for line in rows} == {len(HEADINGS) - 1}
    assert not re.search(r"(?<!\\)[_%#]", text)


def test_the_reports_of_a_run_are_written_beside_it(run, mixed):
    page.write_reports(run, mixed)
    assert {path.suffix for path in run.path.glob("leaderboard.*")} == {".md", ".json", ".csv", ".html"}
    assert json.loads((run.path / "leaderboard.json").read_text(encoding="utf-8"))


def test_no_time_stands_in_a_report_but_in_a_file_of_its_own(run, mixed):
    page.write_reports(run, mixed)
    said = {path.suffix: path.read_text(encoding="utf-8") for path in run.path.glob("leaderboard.*")}
    assert not any("CPU" in text for text in said.values())
    assert {row["ms_per_frame"] for b in json.loads(said[".json"])["boards"] for row in b["rows"]} == {None}
    costs = pd.read_csv(run.path / TIMES).set_index(["case", "estimator"])
    assert costs.loc["down", "mad"].to_list() == [1.0, 2.0, 3.0]
    assert costs.loc["down", "dead"].isna().all()


def test_cost_is_the_mean_over_frames_and_none_where_no_frame_was_answered(made):
    assert {row.estimator: row.ms_per_frame for row in made[0].rows} == {"good_one": 2.0, "mad": 2.0, "dead": None}


@pytest.mark.parametrize("form", ["md", "json", "csv", "html"])
def test_every_form_shows_drift_and_the_commonest_reason_of_frames(tmp_path, scored, write_run, form):
    scores = [scored("still_one", drift_m=0.00234, ate_m=5.0), scored("moving_one", case="ahead")]
    folder = write_run(tmp_path / "suite" / "stamp", scores)
    with new_table(folder.estimate("down", "still_one", 0) / FRAMES, COLUMNS) as table:
        table.writerows({"frame": k, "t_ns": k, "status": "lost", "reason": f"few <{9 - 2 * k}>"} for k in (1, 2))
    page.write_reports(folder, scores)
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


@pytest.mark.parametrize(("cases", "estimators"), [(2500, 4), (5, 2000)])
def test_the_boards_of_ten_thousand_trials_take_a_second_of_work(cases, estimators):
    """Were it quadratic in either, it would take several."""
    one = scores_of({"e": [("ok", 0.1)] * len(CASES)})[0]
    trials = [
        one.model_copy(
            update={
                "case": f"c{k}",
                "estimator": f"e{n}",
                "score": {"metrics": [{"name": "ate_trans", "rmse": 0.1 + n}]},
            }
        )
        for k in range(cases)
        for n in range(estimators)
    ]
    began = time.process_time()
    made = boards(trials, {})
    assert time.process_time() - began < 2
    assert [len(board.rows) for board in made] == [estimators] * (cases + 1)
    assert [row.rank for row in made[1].rows] == list(range(1, estimators + 1))
