"""A board as JSON, CSV and a pandas table: every number in full."""

import csv
import io
import json
import math

import pandas as pd
import pytest

from vobench.report import page
from vobench.report.board_records import as_csv, as_json, cell_records, data_frame, records
from vobench.report.cell import CaseFacts
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.report.leaderboard import make_board
from vobench.runner.folder import NO_SEQUENCE


@pytest.fixture
def made(run, mixed):
    return page.run_board(run, mixed)


def test_json_holds_every_cell_and_total_in_full(made):
    read = json.loads(as_json(made))
    assert [(c["case"], c["estimator"], c["status"]) for c in read["cells"]] == [
        (cell.case, cell.estimator, cell.status) for cell in made.cells
    ]
    assert [(t["estimator"], t["score"]) for t in read["totals"]] == [(t.estimator, t.score) for t in made.totals]
    assert next(c["ate"] for c in read["cells"] if c["estimator"] == "good_one") == pytest.approx(0.1)


def test_csv_is_read_by_pandas_with_gaps_where_there_is_no_number(made):
    read = pd.read_csv(io.StringIO(as_csv(made)))
    assert list(read["estimator"]) == [cell.estimator for cell in (*made.cells, *made.totals)]
    errors = [math.nan if (s := cell.spread("ate")) is None else s[0] for cell in made.cells]
    assert list(read["ate"])[: len(errors)] == pytest.approx(errors, rel=1e-12, nan_ok=True)
    assert list(read["rank"].dropna()) == [total.rank for total in made.totals]


def test_in_csv_the_origin_is_columns_of_every_row(placed):
    frame = pd.read_csv(io.StringIO(as_csv(placed)))
    assert set(frame.processor) == {"Some_CPU 9"}
    assert set(frame.simd) == {"x86-64-v3"}
    assert len(frame) == 4


def test_csv_has_a_row_for_each_case_without_a_sequence(incomplete):
    frame = pd.read_csv(io.StringIO(as_csv(make_board(incomplete, {}))))
    unmade = frame[frame.status == NO_SEQUENCE]
    assert dict(zip(unmade.case, unmade.reason, strict=True)) == {
        "dark": "no light",
        "dim": "no light",
        "far": "too far",
    }


def test_a_record_of_a_cell_has_the_median_and_both_ends_of_each_metric(scored):
    trials = [scored("a", repeat=n, ate_m=ate) for n, ate in enumerate((0.02, 0.01, 0.05))]
    facts = {"down": CaseFacts(group="worn", scenario="blur", severity=2, truth_noise="1 mm per axis")}
    statistics = EstimatorStatistics(2.0, "dark", 3, 7, 40.0, frames=9, dropped=2, late=1)
    (record,) = cell_records(make_board(trials, {("down", "a"): statistics}, facts))
    assert (record["ate_mm"], record["ate_mm_min"], record["ate_mm_max"]) == pytest.approx((20, 10, 50))
    assert (record["cpu_ms"], record["cpu_ms_min"], record["memory_mib_max"]) == (2.0, 2.0, 40.0)
    assert record["rpe_mm"] is record["rpe_mm_min"] is record["rpe_mm_max"] is None
    assert (record["group"], record["scenario"], record["severity"]) == ("worn", "blur", 2)
    assert (record["trials"], record["failed"], record["status"]) == (3, 0, "ok")
    reasons = ("frame_reason", "frame_reason_count", "frame_reason_first")
    assert [record[name] for name in reasons] == ["dark", 3, 7]
    assert (record["frames"], record["frames_dropped"], record["deadlines_missed"]) == (9, 2, 1)


def test_a_record_of_a_total_has_its_intervals_as_columns_and_the_case_all(scored):
    scores = [scored("a", case=f"c{k}", ate_m=0.01) for k in range(8)]
    scores += [scored("b", case=f"c{k}", ate_m=0.03 + 0.001 * k) for k in range(8)]
    made = make_board(scores, {})
    record = records(made)[-1]
    total = made.totals[-1]
    assert (record["case"], record["estimator"], record["ate"]) == ("all", "b", total.ate_percent)
    assert (record["rank_min"], record["rank_max"]) == total.ranks
    assert total.error_interval is not None
    assert (record["ratio_min"], record["ratio_max"]) == total.error_interval
    assert not {"claims", "ranks", "error_interval", "ate_percent", "cases"} & set(record)
    first = records(made)[-2]
    assert first["ratio_min"] is first["ratio_max"] is None


def test_whole_numbers_stay_whole_in_csv(scored):
    made = make_board([scored("a"), scored("b", drift_m=0.1)], {})
    rows = list(csv.DictReader(io.StringIO(as_csv(made))))
    assert [row["rank"] for row in rows if row["case"] == "all"] == ["1", "2"]
    assert {row["trials"] for row in rows} == {"1"}
    assert {row["rank"] for row in rows if row["case"] != "all"} == {""}


@pytest.mark.parametrize("beginning", ["=", "+", "-", "@", "|"])
def test_a_text_that_is_a_formula_is_quoted_in_csv(scored, beginning):
    made = make_board([scored("a", "lost", reason=f"{beginning}1+1"), scored("b", "lost", reason="1+1=2")], {})
    reasons = [row["reason"] for row in csv.DictReader(io.StringIO(as_csv(made))) if row["case"] == "down"]
    assert reasons == [f"'{beginning}1+1", "1+1=2"]


def test_the_pandas_table_has_a_row_for_each_record(scored):
    made = make_board([scored("a"), scored("b")], {})
    assert len(data_frame(made)) == len(records(made)) == 4
    assert list(data_frame(made)["case"]) == ["down", "down", "all", "all"]


def test_json_is_empty_and_null_where_nothing_is_known(scored):
    read = json.loads(as_json(make_board([scored("a", "lost")], {}, title="mine")))
    assert (read["title"], read["environment"], read["unmade"], read["curves"]) == ("mine", None, [], [])
    assert read["cells"][0]["ate"] is None
