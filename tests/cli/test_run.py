"""vobench run, check, report and view on a suite whose pictures are grey."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from vobench.errors import MissingDependencyError
from vobench.rendering import raster
from vobench.runner.task import PERFORMERS


def test_run_ends_in_a_leaderboard_and_says_where_everything_is(vobench, here):
    said = vobench("run", "tiny")
    latest = (Path("runs") / "tiny" / "latest").readlink()
    assert said.code == 0
    assert "wheel_odometry" in said.out
    trial = f"runs/tiny/{latest}/short/wheel_odometry"
    text = " ".join(said.out.split())  # without the breaks of lines, which depend on the length of the folder's name
    assert f"Everything is in runs/tiny/{latest} wheel_odometry on short is off by " in text
    assert text.endswith(f" % of the path: see it (`vobench view {trial}`), ask why (`vobench explain {trial}`)")


def test_a_run_on_a_recording_says_how_to_explain_it(vobench, ran):
    assert vobench("export", "runs/tiny/latest/cases/short/sequence", "walk", "--form", "euroc").code == 0
    Path("real.yaml").write_text("name: real\nsource: walk\nestimators: [stand_still]\n")
    text = " ".join(vobench("run", "real.yaml").out.split())
    latest = (Path("runs") / "real" / "latest").readlink()
    recording = f"runs/real/{latest}/cases/walk/sequence"
    assert text.endswith(f"ask why (`vobench explain {recording} --estimator stand_still`)")


def test_where_nobody_watches_each_stage_is_one_line_and_one_in_the_cache_is_none(vobench, here):
    stages = re.fullmatch(
        r"light of closet\nsimulate short: (\d+) frames\nwheel_odometry on short: (\d+) frames\n"
        r"stand_still on short: (\d+) frames\n",
        vobench("run", "tiny").err,
    )
    assert stages
    assert len(set(stages.groups())) == 1
    assert vobench("run", "tiny").err == ""


def test_a_folder_that_the_sandbox_does_not_open_is_named_once_and_the_run_goes_on(vobench, here, monkeypatch):
    monkeypatch.delenv("VOBENCH_SANDBOX", raising=False)
    monkeypatch.setenv("VOBENCH_SANDBOX_READ", "/tmp")
    said = vobench("run", "tiny")
    assert said.code == 0
    assert said.err.count("vobench: VOBENCH_SANDBOX_READ does not open /tmp: ") == 1


def test_run_takes_the_estimators_that_are_asked_for(vobench, here):
    said = vobench("run", "tiny", "-e", "stand_still", "-e", "constant_velocity", "--json")
    assert {row["estimator"] for row in said.json["totals"]} == {"stand_still", "constant_velocity"}


def test_check_counts_what_run_would_do_and_does_none_of_it(vobench, here):
    planned = vobench("check", "tiny", "--json").json
    assert [(case["case"], case["simulated"]) for case in planned["cases"]] == [("short", False)]
    assert planned["trials"] == 2
    assert not (here / "runs").exists()
    assert not (here / "cache").exists()
    dry = vobench("run", "tiny", "--dry-run", "--json").json
    to_do = {row["stage"]: (row["tasks"], row["in the cache"], row["to do"]) for row in dry.pop("tasks")}
    assert dry == planned
    assert to_do == {"bake": (1, 0, 1), "sequence": (1, 0, 1), "estimate": (2, 0, 2), "score": (2, 0, 2)}
    vobench("run", "tiny")
    assert vobench("check", "tiny", "--json").json["cases"][0]["simulated"]


def test_all_mistakes_of_a_suite_are_said_a_line_each_and_as_a_list(vobench, here):
    path = here / "suites" / "tiny.yaml"
    path.write_text(path.read_text().replace("closet", "closset").replace("pitch_deg: 90", "pitch_deg: 91"))
    said = vobench("check", "tiny")
    assert (said.code, said.out) == (1, "")
    assert [line.split(":")[2:4] for line in said.err.splitlines()] == [
        ["2", " scenes.0"],
        ["3", " rigs.down.pitch_deg"],
    ]
    assert all(line.startswith(f"vobench: {path}:") for line in said.err.splitlines())
    listed = vobench("check", "tiny", "--json").json
    assert listed["error"].endswith("(and 1 more mistake)")
    assert [(each["file"], each["line"], each["key"], each["value"]) for each in listed["mistakes"]] == [
        (str(path), 2, "scenes.0", "closset"),
        (str(path), 3, "rigs.down.pitch_deg", 91),
    ]
    assert listed["mistakes"][1]["sentence"] == "should be 90 or less (got 91)"


def test_check_and_list_say_where_a_name_was_found(vobench, here):
    (here / "suites" / "scenes").mkdir()
    nearer = here / "suites" / "scenes" / "closet.yaml"
    nearer.write_text((here / "scenes" / "closet.yaml").read_text())
    found = vobench("check", "tiny", "--json").json["found"]
    (scene,) = [each for each in found if each["kind"] == "scene"]
    assert scene == {"kind": "scene", "name": "closet", "origin": "beside the suite", "path": str(nearer)}
    assert "beside the suite" in vobench("check", "tiny").out
    origins = {each["name"]: each["origin"] for each in vobench("list", "scenes", "--json").json["entries"]}
    assert (origins["closet"], origins["office"]) == ("./scenes", "built in")


def test_paths_may_be_relative_to_wherever_one_stands(vobench, here, monkeypatch):
    monkeypatch.setenv("VOBENCH_CACHE", "kept")
    (here / "deep").mkdir()
    monkeypatch.chdir(here / "deep")
    monkeypatch.setenv("VOBENCH_PATH", str(here))
    assert vobench("run", "../suites/tiny.yaml", "--out", "../out").code == 0
    assert (here / "deep" / "kept" / "sequences").is_dir()
    assert vobench("report", "../out/tiny").code == 0
    assert vobench("view", "../out/tiny", "--save", "a.rrd").code == 0


def test_without_its_cache_a_run_still_reports_and_view_says_how_to_get_the_pictures_back(vobench, here):
    vobench("run", "tiny")
    shutil.rmtree(here / "cache")
    assert vobench("report", "runs/tiny").code == 0
    said = vobench("view", "runs/tiny", "--save", "a.rrd")
    assert said.code == 1
    assert said.err.startswith("vobench: the sequence is no longer in the cache; run the suite again to recreate it: ")
    assert vobench("run", "tiny").code == 0
    assert vobench("view", "runs/tiny", "--save", "a.rrd").code == 0


def test_the_pictures_may_be_missing_for_a_reason_that_doctor_knows(vobench, here, monkeypatch):
    def broken(*_, **__):
        raise MissingDependencyError("cannot draw without a display (missing libEGL); run: apt-get install -y libegl1")

    monkeypatch.setattr(raster, "RasterRenderer", broken)
    said = vobench("run", "tiny")
    assert (said.code, said.out) == (1, "")
    assert said.err.splitlines()[-1].startswith("vobench: cannot draw without a display (")
    assert not list((here / "runs").rglob("*"))


@pytest.mark.parametrize(
    ("name", "begin"),
    [
        ("b.md", "## ATE % of path"),
        ("b.html", "<!doctype html>"),
        ("b.csv", "case,"),
        ("b.json", "{"),
        ("b.tex", "% Needs \\usepackage{booktabs} and \\usepackage{graphicx}.\n\\begin{table}"),
    ],
)
def test_a_files_ending_says_its_form(vobench, ran, here, name, begin):
    said = vobench("report", "runs/tiny", "--out", name)
    assert (said.code, said.out) == (0, "")
    assert (here / name).read_text(encoding="utf-8").startswith(begin)


@pytest.mark.parametrize("label", ["sequence", "case.json", "ground_truth.tum", "estimates", "0"])
def test_no_label_reaches_anything_but_its_own_folder(vobench, here, label):
    suite = here / "suites" / "tiny.yaml"
    suite.write_text(suite.read_text().replace("[wheel_odometry,", f"[{{name: wheel_odometry, label: {label!r}}},"))
    assert vobench("run", "tiny").code == 0
    case = here / "runs" / "tiny" / "latest" / "cases" / "short"
    assert {path.name for path in case.iterdir()} == {"case.json", "ground_truth.tum", "sequence", "estimates"}
    assert {path.name for path in (case / "estimates").iterdir()} == {label, "stand_still"}
    made = {
        "inputs.json",
        "manifest.json",
        "sensors.mcap",
        "truth.mcap",
        "ground_truth.tum",
        "exposures.csv",
        "made_on.json",
    }
    assert {path.name for path in (case / "sequence").iterdir()} == made
    assert vobench("verify", "runs/tiny").code == 0
    assert vobench("view", "runs/tiny", "--estimator", label, "--save", "a.rrd").code == 0


@pytest.mark.parametrize("label", ["..", ".", "a/b", "/tmp/x", "", "../sequence", ".hidden"])
def test_a_label_that_is_no_plain_name_is_refused(vobench, here, label):
    suite = here / "suites" / "tiny.yaml"
    suite.write_text(suite.read_text().replace("[wheel_odometry,", f"[{{name: wheel_odometry, label: {label!r}}},"))
    said = vobench("run", "tiny")
    assert said.code == 1
    assert f"letter or digit first (got {label!r})" in said.err
    assert not (here / "runs").exists()


def test_view_runs_no_file_of_the_working_folder(vobench, ran, here, monkeypatch):
    (here / "rerun.py").write_text("open('executed', 'w')\n")
    started = []
    monkeypatch.setenv("DISPLAY", ":0")
    with monkeypatch.context() as patch:
        patch.setattr(subprocess, "Popen", lambda command, **_: started.append(command))
        assert vobench("view", "runs/tiny").code == 0
    (command,) = started
    assert command[-1].endswith("run.rrd")
    assert "Rerun" in subprocess.check_output([*command[:-1], "--help"], text=True)
    assert not (here / "executed").exists()


def add_failing_estimator(here):
    plug = here / "estimators" / "blind"
    plug.mkdir(parents=True)
    (plug / "estimator.yaml").write_text(
        "name: blind\nversion: '1'\nclass: estimator:Blind\npose_of: body\nsummary: Blind\n"
    )
    (plug / "estimator.py").write_text("raise ValueError('no eyes')\n")


def test_a_run_in_which_no_estimator_finishes_a_trial_ends_with_code_1_and_one_line(vobench, here):
    add_failing_estimator(here)
    failed = vobench("run", "tiny", "-e", "blind", "-n", "2")
    (sentence,) = [line for line in failed.err.splitlines() if "no estimator finished" in line]
    assert failed.code == 1
    assert sentence.startswith("vobench: no estimator finished a trial: 3 refused; blind on short: estimator 'blind'")
    assert "ValueError: no eyes" in sentence
    assert "blind" in failed.out  # the board is there all the same


def test_an_estimator_that_fails_while_another_finishes_leaves_the_code_0(vobench, here):
    add_failing_estimator(here)
    ran = vobench("run", "tiny", "-e", "blind", "-e", "stand_still")
    assert ran.code == 0
    assert "no estimator finished" not in ran.err


def test_view_of_a_run_without_a_single_pose_works_too(vobench, here):
    add_failing_estimator(here)
    assert vobench("run", "tiny", "-e", "blind", "-e", "stand_still").code == 0
    said = vobench("view", "runs/tiny", "--save", "a.rrd", "--json")
    assert said.json["estimator"] == "blind"
    assert (here / "a.rrd").stat().st_size > 0


def test_only_what_matches_is_run_and_values_take_the_place_of_the_suites(vobench, here):
    said = vobench("run", "tiny", "-e", "stand*", "-c", "sh*", "-n", "2", "--set", "seed=5", "--json")
    (row,) = said.json["totals"]
    assert (row["estimator"], row["trials"]) == ("stand_still", 2)
    assert '"seed": 5' in (here / "runs/tiny/latest/suite.json").read_text()
    for words, sentence in (
        (("-c", "long"), "no case named 'long'. Known: short"),
        (("--set", "seed"), "--set should be key=value, as in rigs.ahead.pitch_deg=20, got 'seed'"),
        (("--set", "name.x=1"), "--set name.x=1: there are no keys below 'name'"),
        (("--fail-if", "ate > x"), "should be compared with a number, got 'x' in 'ate > x'"),
        (
            ("--fail-if", "much"),
            "should be a metric, a comparison and a number, as in 'ate_trans.rmse > 0.2', got 'much'",
        ),
    ):
        wrong = vobench("run", "tiny", *words)
        assert wrong.code == 1
        assert sentence in wrong.err


def test_a_threshold_that_is_broken_is_said_and_is_a_code_of_its_own(vobench, here):
    kept = vobench("run", "tiny", "-e", "stand_still", "--fail-if", "coverage < 0.5")
    assert (kept.code, kept.err.count("which is")) == (0, 0)
    broken = vobench("run", "tiny", "-e", "stand_still", "--fail-if", "ate_trans.max >= 0")
    assert broken.code == 3
    assert "stand_still on short: ate_trans.max is" in broken.err


def test_a_run_without_a_sequence_is_one_sentence_and_no_board(vobench, here, monkeypatch):
    def broken(*_, **__):
        raise AttributeError("module 'OpenGL.GL' has no attribute 'glClipControl'")

    monkeypatch.setattr(raster, "RasterRenderer", broken)
    said = vobench("run", "tiny")
    assert (said.code, said.out) == (1, "")
    sentence = said.err.splitlines()[-1]
    assert sentence.startswith("vobench: no case could be simulated or imported, so nothing was scored: short: ")
    assert "glClipControl" in sentence
    assert not list((here / "runs").rglob("*.json"))


def test_a_run_of_which_some_cases_cannot_be_simulated_has_a_board_and_ends_with_1(vobench, here, monkeypatch):
    suite = here / "suites" / "tiny.yaml"
    suite.write_text(suite.read_text().replace("rigs: {", "rigs: {ahead: {pitch_deg: 0}, "))
    simulate = PERFORMERS["sequence"]

    def some(case, *others):
        if "ahead" in case.name:
            raise RuntimeError("no lens for it")
        simulate(case, *others)

    monkeypatch.setitem(PERFORMERS, "sequence", some)
    said = vobench("run", "tiny")
    assert said.code == 1
    assert "1 of 2 cases could not be simulated or imported and count for no estimator: ahead: " in said.out
    assert "crashed" not in said.out
    assert vobench("run", "tiny", "--json").json["unmade"][0]["cases"] == ["ahead"]
    for command in ("report", "verify"):
        assert vobench(command, "runs/tiny").code == 0
    assert vobench("bundle", "runs/tiny", "partial.zip").code == 0
    assert vobench("score", "partial.zip").code == 0
    shown = vobench("view", "runs/tiny", "--case", "ahead", "--save", "a.rrd")
    assert shown.err.startswith(
        "vobench: 'ahead' has no sequence to show because it could not be simulated or imported: "
    )


def test_the_board_and_the_page_say_where_the_figures_come_from(vobench, ran, here):
    from vobench.runner.environment import processor

    assert f"Made on {processor()}, " in vobench("report", "runs/tiny").out
    assert vobench("report", "runs/tiny", "--json").json["environment"]["processors"][0]["simd"] == processor().simd
    assert vobench("bundle", "runs/tiny", "a.zip").code == 0
    assert f"Made on {processor()}, " in vobench("report", "a.zip").out
    assert f"Made on {processor()}, " in vobench("report", "a.zip", "runs/tiny").out
    (page,) = ran.glob("*T*/leaderboard.html")
    assert f"<dt>processor</dt><dd>{processor()}</dd>" in page.read_text()


def test_compare_names_what_differs_between_two_machines(vobench, ran, here):
    assert "differ in settings that can change scores" not in vobench("compare", "runs/tiny", "runs/tiny").out
    elsewhere = here / "elsewhere"
    shutil.copytree(ran / "latest", elsewhere, symlinks=True)
    stated = json.loads((elsewhere / "environment.json").read_text())
    stated["processors"] = [{"model": "another", "simd": "x86-64-v3"}]
    (elsewhere / "environment.json").write_text(json.dumps(stated))
    said = vobench("compare", "runs/tiny", "elsewhere").out
    assert "The runs differ in settings that can change scores: processor " in said
    assert "→ another (x86-64-v3)" in said


def test_the_log_of_events_has_a_start_and_an_end_of_each_task(vobench, here):
    vobench("run", "tiny", "--events", "events.jsonl")
    events = [json.loads(line) for line in (here / "events.jsonl").read_text().splitlines()]
    started = [event["key"] for event in events if event["event"] == "started"]
    assert sorted(started) == sorted(event["key"] for event in events if event["event"] == "done")
    assert next(event["stage"] for event in events if event["event"] == "done") == "bake"


def test_a_limit_of_time_holds_for_every_trial_and_fresh_makes_all_anew(ran: Path, vobench):
    store = Path(os.environ["VOBENCH_CACHE"])
    made = {path: path.stat().st_mtime_ns for path in store.glob("*/*/manifest.json")}
    assert vobench("run", "tiny", "--timeout", 0.001, "--json").json["cells"][0]["status"] == "timeout"
    assert {path: path.stat().st_mtime_ns for path in made} == made
    assert vobench("run", "tiny", "--limit", 3, "--json").json["cells"][0]["frames"] == 3
    whole = vobench("run", "tiny", "--limit", 999, "--dry-run", "--json").json["tasks"]
    assert [row["to do"] for row in whole if row["stage"] in ("bake", "sequence")] == [0, 0]
    vobench("run", "tiny", "--fresh", "--json")
    assert all(path.stat().st_mtime_ns > before for path, before in made.items())
