"""Scores of files as tables, CSV and Markdown."""

import csv
import io
from types import SimpleNamespace

import pytest

from vobench.report import score_table

VALUES = {"rmse": 0.25, "mean": 0.2, "median": 0.2, "std": 0.1, "min": 0, "max": 0.5, "sse": 1, "p95": 0.45, "p99": 0.5}


def metric(name, unit="m", statistic="rmse", **changes):
    return {"id": f"{name}.{statistic}[pairs=all]", "name": name, "unit": unit, "n": 12, **VALUES, **changes}


def content(*metrics, **changes):
    return {"metrics": list(metrics), "coverage": 0.9876, "warnings": [], "per_length": [], **changes}


def pooled_content():
    one = content(metric("ate"), metric("rot", "deg"), est="one", warnings=["few poses"])
    two = content(metric("ate", rmse=0.5), est="two", consistency={"sentence": "claims too much"})
    whole = {
        key: value for key, value in content(metric("ate", rmse=0.4), warnings=["mixed"]).items() if key != "coverage"
    }
    return {"sequences": [one, two], "pooled": whole}


def score(*, lost_aware=0.75, survived=True):
    return SimpleNamespace(
        association=SimpleNamespace(pairs=10, gt_poses=12, est_poses=11),
        coverage=SimpleNamespace(ratio=0.9876),
        failure=SimpleNamespace(lost_aware=lost_aware, survived=survived),
    )


def test_a_metric_is_a_row_with_its_statistics_in_six_digits():
    ((headings, rows),) = score_table.tables(content(metric("ate", rmse=1 / 3)), per_length=False)
    assert headings == ["metric", "unit", "n", "rmse", "mean", "median", "std", "min", "max", "p95", "p99"]
    assert rows == [["ate", "m", "12", "0.333333", "0.2", "0.2", "0.1", "0", "0.5", "0.45", "0.5"]]


def test_lengths_are_a_table_of_their_own():
    lengths = [metric("seg", "%", length_m=100.0), metric("seg", "%", length_m=2.5)]
    _, (headings, rows) = score_table.tables(content(metric("ate"), per_length=lengths), per_length=True)
    assert headings[:4] == ["metric", "unit", "length m", "n"]
    assert [row[:4] for row in rows] == [["seg", "%", "100", "12"], ["seg", "%", "2.5", "12"]]


def test_sequences_are_rows_with_the_quoted_statistic_and_a_last_row_of_all():
    ((headings, rows),) = score_table.tables(pooled_content(), per_length=False)
    assert headings == ["sequence", "coverage", "ate rmse m", "rot rmse deg"]
    assert rows == [["one", "0.988", "0.25", "0.25"], ["two", "0.988", "0.5", ""], ["pooled", "", "0.4", ""]]


def compared_content():
    first, second = pooled_content()["sequences"]
    for part, poses in ((first, "12/12"), (second, "11/12")):
        part["metrics"][0]["id"] = f"ate.rmse[pairs=all; n={poses}]"
    return {"gt": "truth", "estimates": [first, second]}


def test_estimates_of_one_truth_are_rows_without_a_last_row():
    ((headings, rows),) = score_table.tables(compared_content(), per_length=False)
    assert headings == ["estimate", "coverage", "ate rmse m", "rot rmse deg"]
    assert rows == [["one", "0.988", "0.25", "0.25"], ["two", "0.988", "0.5", ""]]
    assert score_table.ids(compared_content()) == ["ate.rmse[pairs=all]", "rot.rmse[pairs=all]"]
    assert score_table.warnings(compared_content()) == ["one: few poses"]


def test_lengths_of_estimates_stand_together():
    given = compared_content()
    for part in given["estimates"]:
        part["per_length"] = [metric("seg", "%", length_m=length_m) for length_m in (1.0, 2.0)]
    *_, (headings, rows) = score_table.tables(given, per_length=True)
    assert headings[:4] == ["estimate", "metric", "unit", "length m"]
    assert [(row[0], row[3]) for row in rows] == [("one", "1"), ("two", "1"), ("one", "2"), ("two", "2")]


def test_a_ratio_has_no_unit_and_another_statistic_is_named():
    given = pooled_content()
    given["pooled"]["metrics"] = [metric("cov", "1", "mean")]
    ((headings, rows),) = score_table.tables(given, per_length=False)
    assert headings[-1] == "cov mean"
    assert rows[-1][-1] == "0.2"


@pytest.mark.parametrize(("count", "widths"), [(6, [6]), (7, [6, 1]), (13, [6, 6, 1])])
def test_more_than_six_metrics_go_to_further_tables(count, widths):
    given = pooled_content()
    given["pooled"]["metrics"] = given["sequences"][0]["metrics"] = [metric(f"m{k}") for k in range(count)]
    given["sequences"][1]["metrics"] = []
    tables = score_table.tables(given, per_length=False)
    assert [len(headings) - 2 for headings, _ in tables] == widths
    assert [headings[2].split()[0] for headings, _ in tables] == [f"m{6 * k}" for k in range(len(widths))]


def test_csv_has_all_statistics_and_lengths_only_where_asked_for():
    given = content(metric("ate", n=3), per_length=[metric("seg", length_m=100.0)])
    (row,) = csv.DictReader(io.StringIO(score_table.as_csv(given, per_length=False)))
    assert list(row) == ["name", "unit", "n", "rmse", "mean", "median", "std", "min", "max", "sse", "p95", "p99", "id"]
    assert (row["n"], row["sse"], row["id"]) == ("3", "1", "ate.rmse[pairs=all]")
    rows = list(csv.DictReader(io.StringIO(score_table.as_csv(given, per_length=True))))
    assert list(rows[0])[:3] == ["name", "unit", "length_m"]
    assert [row["length_m"] for row in rows] == ["", "100.0"]


def test_csv_of_sequences_names_each_in_front():
    rows = list(csv.DictReader(io.StringIO(score_table.as_csv(pooled_content(), per_length=False))))
    assert next(iter(rows[0])) == "sequence"
    assert [(row["sequence"], row["name"]) for row in rows] == [
        ("one", "ate"),
        ("one", "rot"),
        ("two", "ate"),
        ("pooled", "ate"),
    ]


def test_markdown_aligns_words_left_and_lists_ids_summaries_and_warnings():
    text = score_table.as_markdown(content(metric("ate"), warnings=["few poses"]), [score()], per_length=False)
    lines = text.splitlines()
    assert lines[1] == "|---|---|" + "---:|" * 9
    assert lines[-3:] == [
        "- ate.rmse[pairs=all]",
        "- 10 pairs of 12 true and 11 estimated poses, coverage 0.988, lost-aware score 0.750 (survived)",
        "- warning: few poses",
    ]
    assert text.endswith("\n")


def test_sentences_on_sequences_begin_with_their_names():
    given = pooled_content()
    assert score_table.warnings(given) == ["one: few poses", "mixed"]
    assert score_table.ids(given) == ["ate.rmse[pairs=all]"]
    failed = score(lost_aware=None, survived=False)
    assert score_table.summaries(given, [score(), failed]) == [
        "one: 10 pairs of 12 true and 11 estimated poses, coverage 0.988, lost-aware score 0.750 (survived)",
        "two: 10 pairs of 12 true and 11 estimated poses, coverage 0.988 (not survived)",
        "two: claims too much",
    ]
