"""A run as pandas tables."""

import pytest

from vobench.report.board_metric import METRICS
from vobench.report.leaderboard import make_board
from vobench.report.run_tables import FIRST_COLUMNS, board_frame, cell_frame, frames_frame, trial_csv, trial_frame

CLAIMS = ("not causal", "whole recording")


def test_the_board_has_a_row_per_estimator_the_best_first(scored):
    scores = [
        scored("a", case=f"c{k}", ate_m=0.02 + 0.001 * k, claims=("not causal", "whole recording")) for k in range(8)
    ]
    made = make_board([*scores, *(scored("b", case=f"c{k}", ate_m=0.01) for k in range(8))], {})
    table = board_frame(made)
    assert tuple(table.columns[: len(FIRST_COLUMNS)]) == FIRST_COLUMNS
    assert list(table["estimator"]) == ["b", "a"]
    assert list(table["claims"]) == ["", "not causal, whole recording"]
    second = made.totals[1]
    assert (table["rank_low"][1], table["rank_high"][1]) == second.ranks
    assert (table["error_ratio_low"][1], table["error_ratio_high"][1]) == second.error_interval
    assert table["error_ratio_low"].isna()[0]
    assert not {"ranks", "error_interval"} & set(table.columns)


def test_tables_of_nothing_are_empty(tmp_path):
    assert board_frame(make_board([], {})).empty
    assert cell_frame(make_board([], {})).empty
    assert trial_frame([]).empty
    assert frames_frame(None, []).empty


def test_cells_have_a_row_per_case_and_estimator(scored):
    table = cell_frame(make_board([scored("a"), scored("a", case="ahead"), scored("b")], {}))
    assert list(zip(table["case"], table["estimator"], strict=True)) == [("ahead", "a"), ("down", "a"), ("down", "b")]


def test_a_trial_has_its_choices_and_every_metric_but_costs(scored):
    trial = scored("a", repeat=2, variant={"rig": "down", "light": "dim"}, ate_m=0.02, path_m=4.0, coverage=0.5)
    (row,) = trial_frame([trial]).to_dict("records")
    assert (row["case"], row["estimator"], row["repeat"]) == ("down", "a", 2)
    assert (row["rig"], row["light"], row["coverage"]) == ("down", "dim", 0.5)
    assert (row["ate"], row["ate_mm"]) == pytest.approx((0.5, 20.0))
    assert row["score"] == METRICS["score"].read(trial)
    assert not {"cpu_ms", "memory_mib"} & set(row)


def test_trials_as_csv_have_seven_significant_digits(scored):
    trial = scored("a", ate_m=0.02 / 3, path_m=1.0, coverage=1 / 3)
    header, row = trial_csv([trial], {}).splitlines()
    cells = dict(zip(header.split(","), row.split(","), strict=True))
    assert (cells["coverage"], cells["ate_mm"], cells["repeat"]) == ("0.3333333", "6.666667", "0")


def test_frames_of_all_trials_are_one_table_with_the_trial_in_front(run, mixed):
    table = frames_frame(run, mixed)
    assert list(table.columns[:4]) == ["case", "estimator", "repeat", "frame"]
    assert len(table) == len(mixed)
    assert list(table.index) == list(range(len(mixed)))
    assert list(table["estimator"]) == [trial.estimator for trial in mixed]
    assert table["cpu_ms"].tolist()[:2] == [2.0, 2.0]
