"""A board as people read it; and every form of it says what the estimators could see."""

import csv
import io
import json
from dataclasses import replace

import pytest

from vobench.cli import report as cli_report
from vobench.estimator.sandbox import Sandbox
from vobench.report.board_formats import FORMATS
from vobench.report.board_records import as_csv, as_json
from vobench.report.board_table import (
    cell_notes,
    matrix,
    named,
    number,
    origin,
    rank,
    remarks,
    total_score,
    totals,
)
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.report.leaderboard import Board, make_board
from vobench.runner.folder import TrialScore

OPEN = Sandbox("none", ("the user's files", "the network"))
CLOSED = Sandbox("full")


def trial(estimator: str, sandbox: Sandbox | None) -> TrialScore:
    return TrialScore(
        case="room",
        variant={},
        estimator=estimator,
        repeat=0,
        status="ok",
        reason="",
        coverage=1.0,
        frames=9,
        path_m=100.0,
        score={"metrics": [{"name": "ate_trans", "rmse": 1.0}]},
        sandbox=sandbox,
    )


def board_of(**sandboxes: Sandbox | None) -> Board:
    return make_board([trial(name, sandbox) for name, sandbox in sandboxes.items()], {})


@pytest.mark.parametrize("form", ["md", "json", "csv", "latex", "terminal"])
def test_every_form_names_the_estimators_that_saw_more_than_their_own_files(form, capsys):
    made = board_of(honest=CLOSED, watched=OPEN)
    if form == "terminal":
        cli_report.print_board(made)
        text = capsys.readouterr().out
    else:
        text = FORMATS[form](made, "ate")
    assert "not sandboxed: it could see the user" in " ".join(text.split())


@pytest.mark.parametrize("form", ["md", "json", "latex"])
def test_a_board_of_sandboxed_estimators_says_so(form):
    text = FORMATS[form](board_of(honest=CLOSED), "ate")
    assert "Estimators saw only their own files." in text


def test_each_row_says_what_its_own_trials_saw():
    made = board_of(honest=CLOSED, watched=OPEN, older=None)
    rows = list(csv.DictReader(io.StringIO(as_csv(made))))
    saw = {row["estimator"]: row["saw"] for row in rows if row["case"] == "room"}
    assert saw == {
        "honest": "only its own files",
        "watched": "not sandboxed: it could see the user's files and the network",
        "older": "what it could see is not recorded",
    }
    cells = json.loads(as_json(made))["cells"]
    assert {cell["estimator"]: cell["saw"] for cell in cells} == saw


def test_a_cell_shows_the_median_and_range_of_its_trials_and_how_many_failed(scored):
    trials = [scored("a", repeat=n, ate_m=ate) for n, ate in enumerate((0.02, 0.01, 0.05))]
    (shown,) = matrix(make_board(trials, {}), "ate_mm")[0][1]
    assert (shown.text, shown.range) == ("20.0", "10.0–50.0")
    (shown,) = matrix(make_board([*trials, scored("a", "lost", repeat=3)], {}), "ate_mm")[0][1]
    assert str(shown) == "20.0 (10.0–50.0, 1/4 lost)"
    random = ("not deterministic",)
    crashed = [scored("a", "crashed", repeat=n, ate_m=None, claims=random) for n in (0, 1)]
    (shown,) = matrix(make_board(crashed, {}), "ate")[0][1]
    assert (str(shown), shown.failed) == ("2/2 crashed", True)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (0.0, "0"),
        (1234.5, "1234"),
        (123.45, "123"),
        (12.345, "12.3"),
        (1.2345, "1.23"),
        (0.12345, "0.123"),
        (0.0123456, "0.0123"),
        (1.23456e-5, "0.00001"),
        (-0.12345, "-0.123"),
        (1e-12, "0.00000"),
    ],
)
def test_a_number_has_three_digits_and_at_most_five_decimals(value, text):
    assert number(value) == text


@pytest.fixture
def total(scored):
    return make_board([scored("a")], {}).totals[0]


@pytest.mark.parametrize(
    ("score", "text"),
    [(0.5, "0.500"), (0.94, "0.940"), (0.991, "0.9910"), (0.99876, "0.9988"), (1.0, "1.0000000"), (0.0, "0.000")],
)
def test_a_score_has_as_many_decimals_as_its_loss_needs(total, score, text):
    assert total_score(replace(total, score=score)) == text


def test_a_rank_has_its_interval_where_that_is_wider_than_one_rank(total):
    assert rank(replace(total, rank=2, ranks=(2, 2))) == "2"
    assert rank(replace(total, rank=2, ranks=(1, 3))) == "2 (1–3)"
    assert rank(replace(total, rank=None, ranks=None)) == ""


def test_claims_stand_behind_a_name():
    assert named("a", ()) == "a"
    assert named("a", ("Sim(3)", "not causal")) == "a [Sim(3), not causal]"


def rows_of(made):
    ((_, table),) = totals(made)
    return [dict(zip(table[0], row, strict=True)) for row in table[1:]]


def test_the_columns_of_a_total(total, scored):
    made = make_board([scored("a"), scored("b", "lost")], {})
    first = replace(made.totals[0], error_interval=(0.5, 2.0), cpu_ms=1.5, memory_mib=30.0, is_efficient=True)
    second = replace(made.totals[1], p_above=0.01, decided_above=True)
    rows = rows_of(replace(made, totals=(first, second)))
    assert rows[0] | {"score": ""} == {
        "#": "1",
        "estimator": "a",
        "score": "",
        "ATE %": "10.0",
        "× best": "1.00 [0.500, 2.00]",
        "lost": "0 of 1",
        "decided": "–",
        "CPU ms/frame": "1.50 ◆",
        "MiB": "30.0",
    }
    chosen = [rows[1][heading] for heading in ("decided", "lost", "ATE %", "× best", "CPU ms/frame", "MiB")]
    assert chosen == ["yes", "1 of 1", "–", "–", "–", "–"]
    assert rows_of(replace(made, totals=(first, replace(second, decided_above=False))))[1]["decided"] == "no"


def test_costs_have_columns_only_where_one_is_known(scored):
    scores = [scored("a"), scored("b")]
    assert not {"CPU ms/frame", "MiB"} & set(rows_of(make_board(scores, {}))[0])
    one = {("down", "a"): EstimatorStatistics(1.0)}
    assert {"CPU ms/frame", "MiB"} <= set(rows_of(make_board(scores, one))[0])


def test_a_table_of_totals_is_named_by_its_cases_and_its_division_where_there_are_several(scored):
    one = make_board([scored("a")], {})
    assert [scope for scope, _ in totals(one)] == ["1 case, 1 drive, 1 place"]
    two = make_board([scored("a"), scored("a", case="ahead")], {})
    assert [scope for scope, _ in totals(two)] == ["2 cases, 2 drives, 2 places"]
    groups = tuple(replace(two.totals[0], group=f"calibration {level}") for level in ("none", "worn"))
    assert [scope for scope, _ in totals(replace(two, totals=groups))] == [
        "calibration none, 2 cases, 2 drives, 2 places",
        "calibration worn, 2 cases, 2 drives, 2 places",
    ]


def test_an_undecided_order_says_what_would_decide_it(scored):
    scores = [scored(name, repeat=repeat, ate_m=0.1) for name in "ab" for repeat in (0, 1)]
    made = make_board(scores, {})
    first = made.totals[0]

    def sentences(**changes):
        second = replace(made.totals[1], decided_above=False, p_above=0.25, smallest_ratio=1.84, places=12, **changes)
        return remarks(replace(made, totals=(first, second), remarks=("known",)))

    order = "The order of a and b is not decided (p = 0.25); a ratio of losses of 1.84 would have been"
    assert sentences(places_needed=31) == ["known", f"{order}, and 1.5 takes about 19 more places"]
    assert sentences(places_needed=13) == ["known", f"{order}, and 1.5 takes about 1 more place"]
    assert sentences(places_needed=12) == ["known", order]
    assert sentences(places_needed=None) == ["known", order]
    for decided in (True, None):
        second = replace(made.totals[1], decided_above=decided)
        assert remarks(replace(made, totals=(first, second), remarks=())) == []


def test_a_note_on_several_cells_is_written_once_with_its_first_case(scored):
    lost = [scored("a", "lost", case=case) for case in ("down", "ahead", "far")]
    assert cell_notes(make_board(lost, {})) == ["ahead and 2 more: a: lost: it went dark"]
    assert cell_notes(make_board(lost[:2], {})) == ["ahead and 1 more: a: lost: it went dark"]
    assert cell_notes(make_board([lost[0], scored("b", case="far")], {})) == ["down: a: lost: it went dark"]
    assert cell_notes(make_board(lost[:1], {})) == ["a: lost: it went dark"]


def test_a_cell_without_a_number_and_one_without_trials_are_not_the_same(scored):
    made = make_board([scored("a", drift_m=0.1), scored("b"), scored("b", case="ahead")], {})
    shown = {case: [str(cell) for cell in cells] for case, cells in matrix(made, "ate")}
    assert shown == {"ahead": ["10.0", ""], "down": ["10.0", "–"]}


def test_scores_have_four_decimals_and_costs_are_shown_even_of_failures(scored):
    made = make_board([scored("a", coverage=0.98765), scored("b", "lost")], {("down", "b"): EstimatorStatistics(2.0)})
    assert str(matrix(made, "coverage")[0][1][0]) == "0.9877"
    costs = dict(zip(made.estimators, matrix(made, "cpu_ms")[0][1], strict=True))
    assert (str(costs["b"]), costs["b"].failed) == ("2.00 (1/1 lost)", True)
    assert str(costs["a"]) == "–"


def test_an_origin_that_is_not_known_is_no_line(scored, placed):
    assert origin(make_board([scored("a")], {})) == ""
    assert origin(placed).startswith("Made on Some_CPU 9 (x86-64-v3), ")
