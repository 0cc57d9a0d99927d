"""What the script of a page draws: each cell as text and number, and the worst cells in detail."""

import json
from pathlib import Path

import numpy as np
import pytest

from vobench.report import page_data as module
from vobench.report.board_table import matrix
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.report.leaderboard import make_board
from vobench.report.page_data import page_data
from vobench.report.practice import PRACTICES
from vobench.report.thumbnail import Thumbnails
from vobench.runner.folder import SEQUENCE
from vobench.runner.frames import COLUMNS, FRAMES, GROUND_TRUTH, new_table


def data_of(folder, trials, *, metrics=("ate",), answered=None, beside=None):
    made = make_board(trials, answered or {})
    matrices = {name: matrix(made, name) for name in metrics}
    data = page_data(folder, trials, made, matrices, thumbnails=Thumbnails(folder), beside=beside or folder.path)
    return json.loads(json.dumps(data, allow_nan=False))


def write_errors(folder, trial, errors_m, *, t0_ns=0):
    """A table of frames at 10 Hz with these errors, None for no pose."""
    with new_table(folder.estimate(trial.case, trial.estimator, trial.repeat) / FRAMES, COLUMNS) as table:
        for index, error_m in enumerate(errors_m):
            row = {"frame": index, "t_ns": t0_ns + index * 100_000_000}
            if error_m is not None:
                row |= {"status": "ok", "position_error_m": error_m}
            table.writerow(row)


def test_a_metric_has_the_text_and_the_number_of_each_cell(scored, write_run, tmp_path):
    trials = [scored("a", ate_m=0.02), scored("b", "lost"), scored("a", case="ahead", ate_m=0.03)]
    folder = write_run(tmp_path / "run", trials)
    costs = {("down", "b"): EstimatorStatistics(2.0)}
    data = data_of(folder, trials, metrics=("ate", "score", "cpu_ms"), answered=costs)
    assert (data["cases"], data["estimators"]) == (["ahead", "down"], ["a", "b"])
    ate = data["metrics"]["ate"]
    assert ate["text"] == [[["3.00", "", "", 0], ["", "", "", 0]], [["2.00", "", "*", 0], ["lost", "", "", 1]]]
    assert ate["value"] == [[pytest.approx(3.0), None], [pytest.approx(2.0), None]]
    assert (ate["higher"], ate["cost"]) == (False, False)
    assert data["metrics"]["score"]["higher"] is True
    assert data["metrics"]["score"]["value"][1][1] is None
    assert data["metrics"]["cpu_ms"]["cost"] is True
    assert data["metrics"]["cpu_ms"]["value"] == [[None, None], [None, 2.0]]


def test_ranked_estimators_have_cost_loss_and_whether_they_are_efficient(scored, write_run, tmp_path):
    trials = [scored("a", ate_m=0.05), scored("b", ate_m=0.09)]
    folder = write_run(tmp_path / "run", trials)
    answered = {("down", "a"): EstimatorStatistics(2.0), ("down", "b"): EstimatorStatistics(9.0)}
    first, second = data_of(folder, trials, answered=answered)["accuracy_and_cost"]
    assert first == {"name": "a", "group": "", "cpu": 2.0, "loss": pytest.approx(0.25), "on": True}
    assert (second["name"], second["on"]) == ("b", False)


def test_only_the_worst_cells_have_details_failures_first(scored, write_run, tmp_path, monkeypatch):
    trials = [
        scored("a", ate_m=0.01),
        scored("b", ate_m=0.05),
        scored("c", "lost"),
        scored("a", case="far", ate_m=0.02),
    ]
    folder = write_run(tmp_path / "run", trials)
    data = data_of(folder, trials)
    column = {name: index for index, name in enumerate(data["estimators"])}
    row = {name: index for index, name in enumerate(data["cases"])}
    worst_first = [("down", "c"), ("down", "b"), ("far", "a"), ("down", "a")]
    for count in range(1, 5):
        monkeypatch.setattr(module, "MOST_DETAILS", count)
        shown = data_of(folder, trials)
        assert set(shown["details"]) == {f"{row[case]}|{column[name]}" for case, name in worst_first[:count]}
        assert set(shown["truths"]) == {case for case, _ in worst_first[:count]}


def test_the_worst_trial_of_a_cell_is_shown_a_failed_one_first(scored, write_run, tmp_path):
    trials = [scored("a", repeat=n, ate_m=ate) for n, ate in enumerate((0.01, 0.05, 0.02))]
    folder = write_run(tmp_path / "run", trials)
    assert data_of(folder, trials)["details"]["0|0"]["trial"] == 1
    assert data_of(folder, trials[::-1])["details"]["0|0"]["trial"] == 1
    failed = [*trials[:2], trials[2].model_copy(update={"status": "lost"})]
    assert data_of(folder, failed)["details"]["0|0"]["trial"] == 2


def test_errors_are_millimetres_over_seconds_since_the_first_frame(scored, write_run, tmp_path):
    trial = scored("a")
    folder = write_run(tmp_path / "run", [trial])
    write_errors(folder, trial, [0.0, 0.0123456, None, 0.5], t0_ns=5 * 10**9)
    detail = data_of(folder, [trial])["details"]["0|0"]
    assert detail["t"] == [0.0, 0.1, 0.2, 0.3]
    assert detail["e"] == [0.0, 12.35, None, 500.0]


def test_the_path_has_the_errors_of_its_poses_where_these_correspond(scored, write_run, tmp_path):
    trial = scored("a")
    folder = write_run(tmp_path / "run", [trial])
    write_errors(folder, trial, [0.001, None, 0.002, 0.003])
    detail = data_of(folder, [trial])["details"]["0|0"]
    assert detail["path"] == [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]
    assert detail["pathe"] == [1.0, 2.0, 3.0]
    write_errors(folder, trial, [0.001, None, 0.002])
    assert data_of(folder, [trial])["details"]["0|0"]["pathe"] == []


def test_a_trial_without_a_score_has_no_path(scored, write_run, tmp_path):
    trial = scored("a", "crashed", ate_m=None)
    folder = write_run(tmp_path / "run", [trial])
    detail = data_of(folder, [trial])["details"]["0|0"]
    assert (detail["path"], detail["pathe"]) == ([], [])
    assert detail["notes"] == ["a: crashed: it went dark"]


def test_links_lead_from_where_the_page_is_to_files_that_exist(scored, write_run, tmp_path):
    trial = scored("a b")
    folder = write_run(tmp_path / "run", [trial])
    detail = data_of(folder, [trial], beside=tmp_path / "elsewhere")["details"]["0|0"]
    names = [name for name, _ in detail["files"]]
    assert names == ["score.json", "frames.csv", "estimate.tum"]
    for name, link in detail["files"]:
        assert link == f"../run/cases/down/estimates/a%20b/0/{name}"
    assert detail["view"] == ["--case", "down", "--estimator", "a b"]
    assert Path(folder.path / "cases/down/estimates/a b/0" / names[0]).is_file()


def test_moments_with_a_picture_are_shown(scored, write_run, tmp_path):
    trial = scored("a")
    folder = write_run(tmp_path / "run", [trial])
    errors_m = [0.0] * 20
    errors_m[12] = 0.5
    write_errors(folder, trial, errors_m)
    assert data_of(folder, [trial])["details"]["0|0"]["thumbs"] == []
    PRACTICES["drive"].write(folder.case("down") / SEQUENCE)
    (thumb,) = data_of(folder, [trial])["details"]["0|0"]["thumbs"]
    assert (thumb["frame"], thumb["t_s"], thumb["why"]) == (12, 1.2, "large error")
    assert thumb["src"].startswith("data:image/jpeg;base64,")


def test_a_case_that_another_run_could_not_make_does_not_stop_the_page(scored, write_run, tmp_path):
    trial = scored("a")
    folder = write_run(tmp_path / "run", [trial])
    unmade = scored("a", "no_sequence", repeat=1, ate_m=None)
    assert data_of(folder, [trial, unmade])["details"]["0|0"]["trial"] == 0


def test_a_long_curve_keeps_its_peak(scored, write_run, tmp_path):
    trial = scored("a")
    folder = write_run(tmp_path / "run", [trial])
    errors_m = np.zeros(1000)
    errors_m[777] = 0.25
    write_errors(folder, trial, errors_m.tolist())
    detail = data_of(folder, [trial])["details"]["0|0"]
    assert len(detail["e"]) == len(detail["t"]) == 160
    assert dict(zip(detail["t"], detail["e"], strict=True))[77.7] == 250.0


def test_a_case_without_a_ground_truth_has_details_but_no_true_path(scored, write_run, tmp_path):
    trial = scored("a")
    folder = write_run(tmp_path / "run", [trial])
    (folder.case(trial.case) / GROUND_TRUTH).unlink(missing_ok=True)
    data = data_of(folder, [trial])
    assert data["truths"] == {}
    assert "0|0" in data["details"]


def test_baselines_are_the_last_columns_and_not_in_the_chart(scored, write_run, tmp_path):
    still = scored("still", ate_m=0.001, claims=("baseline",))
    trials = [still, scored("a", ate_m=0.05), scored("b", ate_m=0.09)]
    folder = write_run(tmp_path / "run", trials)
    answered = {("down", name): EstimatorStatistics(2.0) for name in ("a", "b", "still")}
    data = data_of(folder, trials, answered=answered)
    assert data["estimators"] == ["a", "b", "still"]
    assert [point["name"] for point in data["accuracy_and_cost"]] == ["a", "b"]
