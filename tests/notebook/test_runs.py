"""A suite is checked and run from Python as on the command line, and its results are tables."""

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import vobench
from tests.forgery import forged
from vobench.errors import InputError, MissingDependencyError, SuiteError, UnknownNameError
from vobench.notebook.runs import plan


class Still:
    """Never moves."""

    needs = ()

    def start(self, rig, params, seed):
        import numpy as np

        self.pose = np.eye(4)

    def process(self, frame):
        from vobench.plugin import Result

        return Result(self.pose)


def test_a_run_is_what_the_command_line_makes(ran, here):
    again = vobench.run("tiny", jobs=1, quiet=True, out="again")
    by_command = vobench.read_run(ran)
    assert again.trials.equals(by_command.trials)
    first = by_command.path / "cases" / "short"
    assert (again.case("short") / "ground_truth.tum").read_bytes() == (first / "ground_truth.tum").read_bytes()


def test_the_board_ranks_estimators_and_has_no_empty_half(ran):
    board = vobench.read_run(ran).board
    assert list(board["estimator"]) == ["wheel_odometry", "stand_still"]
    assert board["rank"][0] == 1
    assert board["rank"].isna()[1]  # a baseline
    assert board["score"].is_monotonic_decreasing
    assert board["score"].notna().all()


def test_cells_trials_and_frames_have_a_row_each(ran):
    run = vobench.read_run(ran)
    assert list(zip(run.cells["case"], run.cells["estimator"], strict=True)) == [
        ("short", "stand_still"),
        ("short", "wheel_odometry"),
    ]
    assert set(run.trials["status"]) == {"ok"}
    assert {"case", "estimator", "repeat", "rig", "ate"} <= set(run.trials.columns)
    per_trial = run.frames.groupby("estimator")["frame"].count()
    assert per_trial.to_dict() == dict(zip(run.trials["estimator"], run.trials["frames"], strict=True))


@pytest.mark.slow
def test_until_decided_ends_with_what_is_known_of_each_pair(drawn, capsys):
    run = vobench.run("drawn", until="decided", ratio=10, budget="20min", jobs=1, quiet=True)
    assert capsys.readouterr().out == ""
    (pair,) = run.pairs.to_dict("records")
    assert (pair["places"], pair["verdict"]) == (8, "alike within 10 ×")
    assert 0.1 < pair["low"] < pair["ratio"] == 1 < pair["high"] < 10


def test_until_decided_needs_places_to_draw_and_has_a_ratio_and_a_budget(here, drawn, ran):
    with pytest.raises(SuiteError, match="fresh units require places"):
        vobench.run("tiny", until="decided", quiet=True)
    with pytest.raises(InputError, match="budget requires until='decided'"):
        vobench.run("drawn", budget="3min")
    with pytest.raises(InputError, match="ratio should be above 1, got 1"):
        vobench.run("drawn", until="decided", ratio=1.0)
    with pytest.raises(InputError, match="until should be 'decided' or None, got 'done'"):
        vobench.run("drawn", until="done")
    with pytest.raises(InputError, match="only a run with until='decided' has pairs"):
        _ = vobench.read_run(ran).pairs


def test_only_chooses_cases_scenes_or_estimators(here):
    assert [case.name for case in plan("tiny", only="sh*").cases] == ["short"]
    assert [entry.label for entry in plan("tiny", only=["stand*", "closet"]).estimator_entries] == ["stand_still"]
    with pytest.raises(UnknownNameError, match=r"no case, scene or estimator named 'shirt'. Did you mean 'short'"):
        plan("tiny", only="shirt")


def test_changes_are_values_by_their_keys(here):
    changed = plan(
        "tiny", changes={"repeats": 3, "rigs.down.pitch_deg": 45, "trajectories.short.targets_m": [[0.2, 0]]}
    )
    assert changed.suite.repeats == 3
    assert changed.cases[0].rig.pitch_deg == 45
    with pytest.raises(InputError, match="a change should be a number"):
        plan("tiny", changes={"seed": object()})


def test_a_class_takes_part_as_an_estimator_of_its_own_folder(here):
    run = vobench.run("tiny", estimators=["stand_still", Still], jobs=1, quiet=True)
    assert (here / "estimators" / "still" / "estimator.py").is_file()
    errors = run.trials.set_index("estimator")["ate_mm"]
    assert errors["still"] == errors["stand_still"]


def test_check_says_what_a_run_would_do_and_makes_nothing(here):
    check = vobench.check("tiny")
    assert list(check.cases["case"]) == ["short"]
    assert set(check.estimators["estimator"]) == {"wheel_odometry", "stand_still"}
    assert check.tasks.set_index("stage")["to do"].to_dict() == {"bake": 1, "sequence": 1, "estimate": 2, "score": 2}
    assert not (here / "runs").exists()


def test_comparing_a_run_with_itself_finds_nothing(ran):
    run = vobench.read_run(ran)
    changes = vobench.compare(run, ran)
    assert set(changes["verdict"]) == {"same"}
    assert list(changes["case"].unique()) == ["all", "short"]


def test_a_bundle_is_a_zip_that_compares_with_its_run(ran, tmp_path):
    path = vobench.bundle(vobench.read_run(ran), tmp_path / "run.zip")
    assert set(vobench.compare(path, ran)["verdict"]) == {"same"}
    with pytest.raises(InputError, match=r"should end in \.zip"):
        vobench.bundle(ran, tmp_path / "run.tar")


def test_the_leaderboard_has_published_results_and_runs_of_ones_own(ran, tmp_path):
    published = tmp_path / "results" / "tiny"
    published.mkdir(parents=True)
    vobench.bundle(ran, published / "builtin.zip")
    alone = vobench.leaderboard(results=tmp_path / "results")
    assert sorted(alone["estimator"]) == ["stand_still", "wheel_odometry"]
    assert {Path(file).name for file in alone["file"]} == {"builtin.zip"}
    with_mine = vobench.leaderboard("tiny", runs=[vobench.read_run(ran)], results=tmp_path / "results")
    assert (len(with_mine), set(with_mine["board"])) == (4, {1})
    forged(published / "builtin.zip", published / "forged.zip")
    with pytest.warns(UserWarning, match=r"refused: stand_still on short, 0: another score .*forged\.zip"):
        assert len(vobench.leaderboard(results=tmp_path / "results")) == 2


def test_a_forged_score_of_a_bundle_is_named_and_does_not_count(ran, tmp_path):
    forged(vobench.bundle(ran, tmp_path / "honest.zip"), tmp_path / "forged.zip")
    with pytest.warns(UserWarning, match=r"forged\.zip: stand_still on short, 0: another score"):
        changes = vobench.compare(ran, tmp_path / "forged.zip")
    assert set(changes["verdict"]) == {"same"}


def test_plots_take_the_cases_and_estimators_that_there_are(ran):
    run = vobench.read_run(ran)
    names = [text.get_text() for text in run.plot("short").axes[0].get_legend().get_texts()]
    assert names == ["ground truth", "start", "wheel_odometry", "stand_still"]
    names = [text.get_text() for text in run.plot(estimators="stand_still").axes[0].get_legend().get_texts()]
    assert names == ["ground truth", "start", "stand_still"]
    with pytest.raises(UnknownNameError, match="no estimator named 'stand_stil'"):
        run.plot(estimators=["stand_stil"])


def test_a_plot_has_the_kinds_of_the_command(ran):
    run = vobench.read_run(ran)
    matrix = run.plot(kind="matrix", width_inches=5)
    assert matrix.get_size_inches()[0] == 5
    assert len(matrix.axes[0].get_yticklabels()) == len(run.cases)
    over_path = run.plot("short", kind="error", over="path").axes[1]
    assert over_path.get_xlabel() == "path length (m)"
    with pytest.raises(UnknownNameError, match="Did you mean 'matrix'"):
        run.plot(kind="matrx")


def test_a_view_without_a_display_says_what_to_do_and_a_saved_one_is_a_file(ran, tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    run = vobench.read_run(ran)
    assert run.view("short", estimator="stand_still", save=tmp_path / "look.rrd").stat().st_size > 1000
    with pytest.raises(MissingDependencyError, match="there is no display to open the viewer on"):
        run.view()


def test_a_run_and_a_check_show_themselves_as_tables(ran, here):
    shown = vobench.read_run(ran)._repr_html_()
    words = ("<table", "ATE % of path", "wheel_odometry", "stand_still", "totals over 1 case")
    assert all(word in shown for word in words)
    assert "<table" in vobench.check("tiny")._repr_html_()


def test_an_error_in_jupyter_is_one_line(here):
    with pytest.raises(UnknownNameError) as raised:
        vobench.run("tinny")
    (line,) = raised.value._render_traceback_()
    assert line.startswith("UnknownNameError: no suite named 'tinny'. Did you mean 'tiny'?")


@pytest.mark.slow
def test_a_program_without_a_main_guard_runs_a_suite_once(here):
    """Workers must not import the program that started them."""
    (here / "program.py").write_text(
        "import vobench\n"
        "print('here')\n"
        "run = vobench.run('tiny', jobs=2, quiet=True, changes={'seed': 5})\n"
        "print(len(run.trials))\n"
    )
    ran = subprocess.run([sys.executable, "program.py"], cwd=here, capture_output=True, text=True, check=False)
    assert (ran.stdout, ran.returncode) == ("here\n2\n", 0), ran.stderr


def test_tables_are_pandas(ran):
    run = vobench.read_run(ran)
    assert all(isinstance(table, pd.DataFrame) for table in (run.board, run.cells, run.trials, run.frames))
    assert json.loads(run.board.to_json(orient="records"))[0]["estimator"] == "wheel_odometry"
