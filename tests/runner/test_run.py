"""A suite from end to end: what is cached, what is repeatable, and what survives being killed."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vobench.estimator.program import sandbox_here
from vobench.estimator.readable_folders import READ_VARIABLE
from vobench.rendering import raster
from vobench.report.verify import verify_run
from vobench.runner import estimate
from vobench.runner import estimate as estimate_file
from vobench.runner.estimate import ESTIMATE
from vobench.runner.executor import TaskOutcome
from vobench.runner.folder import ENVIRONMENT, PAGE, SCORE, SEQUENCE, TIMES_HASHES, read_tum
from vobench.runner.frames import GROUND_TRUTH, TIMES
from vobench.runner.import_recording import read_all
from vobench.runner.run import _Gathering
from vobench.runner.task import Task, missing, plan, sequence_tasks
from vobench.sequence import Sequence, payload_hash, read_truth


def contents(run, *names):
    """Bytes of all files of these names in a run, by their place in it."""
    return {str(p.relative_to(run.path)): p.read_bytes() for name in names for p in sorted(run.path.rglob(name))}


def sequence_key(case):
    return sequence_tasks(case)[-1].key


def never(*_, **__):
    raise AssertionError("this should have come from the cache")


def test_a_run_holds_all_that_its_folder_promises(first):
    assert {p.name for p in first.path.iterdir()} == {
        "suite.json",
        "estimators.json",
        "environment.json",
        "hashes.json",
        "times.csv",
        "times_hashes.json",
        "trials.csv",
        "cases",
        *(f"leaderboard.{suffix}" for suffix in ("md", "json", "csv", "html")),
    }
    assert [(s.case, s.status, s.coverage) for s in first.scores()] == [
        (case, "ok", 1.0) for case in ("dim", "dim", "full", "full")
    ]


def test_a_suite_may_let_estimators_run_beside_other_tasks_and_its_run_says_so(bench, first, monkeypatch):
    from vobench.runner import run as runs

    heard = list[bool]()
    monkeypatch.setattr(runs, "perform_all", lambda *_, shares_time, **__: heard.append(shares_time) or {})
    shared = bench.run(("name: tiny", "name: tiny\nshare_time: true"))
    said = [json.loads((run.path / ENVIRONMENT).read_text())["timed"] for run in (first, shared)]
    assert said == [runs.ALONE, runs.BESIDE]
    assert heard == [True]


def test_a_noisy_truth_changes_scores_and_no_sequence_and_no_estimate(bench, first):
    noisy = bench.run(("seed: 1", "seed: 1\ntruth_noise: {position_m: 0.005, rotation_deg: 0.2}"))
    for case in ("dim", "full"):
        assert (noisy.case(case) / "sequence").resolve() == (first.case(case) / "sequence").resolve()
    assert contents(noisy, ESTIMATE) == contents(first, ESTIMATE)
    told, exact = (read_tum(run.case("full") / GROUND_TRUTH) for run in (noisy, first))
    assert np.std(told.positions_m - exact.positions_m) == pytest.approx(0.005, rel=0.5)  # of a dozen poses
    by_wheels = [[s for s in run.scores() if s.estimator == "wheel_odometry"] for run in (noisy, first)]
    ate_m, exact_ate_m = ([score.value("ate_trans", "rmse") for score in scores] for scores in by_wheels)
    assert ate_m[0] == ate_m[1] > exact_ate_m[0] + 0.002
    (said,) = contents(noisy, "leaderboard.md").values()
    assert "The ground truth used for scoring is perturbed by 5 mm per axis and 0.2° per axis" in said.decode()
    assert not [finding for finding in verify_run(noisy) if finding.wrong]


def test_the_second_run_renders_nothing_estimates_nothing_and_says_the_same(bench, first, monkeypatch):
    monkeypatch.setattr(raster, "RasterRenderer", never)
    monkeypatch.setattr(estimate, "EstimatorProcess", never)
    second = bench.run()
    assert second.path != first.path
    boards = contents(second, "leaderboard.[!h]*", SCORE)  # the page shows times, and has hashes among theirs
    assert boards == contents(first, "leaderboard.[!h]*", SCORE)
    assert len(boards) == 3 + 4


def test_two_fresh_caches_give_equal_pictures_and_all_files_but_those_of_times_equal(bench, first):
    other = bench.run(cache="fresh")
    for case in ("full", "dim"):
        sequences = [(run.case(case) / SEQUENCE).resolve() for run in (first, other)]
        assert sequences[0] != sequences[1]
        assert payload_hash(sequences[0]) == payload_hash(sequences[1])
    differing = {TIMES, TIMES_HASHES, PAGE}
    files = [
        {str(p.relative_to(run.path)): p.read_bytes() for p in run.path.rglob("*") if p.is_file()}
        for run in (first, other)
    ]
    assert files[0].keys() == files[1].keys()
    assert {name for name in files[0] if files[0][name] != files[1][name]} == {
        name for name in files[0] if Path(name).name in differing
    }
    assert len(files[0]) > len(differing)


def test_another_lighting_changes_the_pictures_and_nothing_else(first):
    full, dim = (first.case(case) / SEQUENCE for case in ("full", "dim"))
    assert read_truth(full).T_world_frame.tobytes() == read_truth(dim).T_world_frame.tobytes()
    for one, other in zip(Sequence.open(full).encoders(), Sequence.open(dim).encoders(), strict=True):
        assert np.array_equal(one, other)
    bright, dark = (next(Sequence.open(case).frames()).left.mean() for case in (full, dim))
    assert dark < 0.7 * bright


def test_the_name_of_a_variant_is_no_part_of_what_is_cached(bench):
    plans = [bench.plan(), bench.plan(("full:", "bright:"), ("name: tiny", "name: other"))]
    keys = [sequence_key(plan.cases[0]) for plan in plans]
    assert keys[0] == keys[1]


def test_a_replayed_file_counts_by_what_it_holds_and_not_by_where_it_lies(bench):
    rows = [f"{k / 10} {k / 40} 0 0 0 0 0 1\n" for k in range(20)]
    for name, lines in (("a.tum", rows), ("b.tum", ["# moved\n", *rows]), ("c.tum", rows[:-1])):
        (bench.folder / name).write_text("".join(lines))
    old = "{targets_m: [[0.3, 0]], tolerance_m: 0.03, rate_hz: 5}"
    here, moved, other = (
        sequence_key(bench.plan((old, f"{{kind: replay, file: {name}, rate_hz: 5}}")).cases[0])
        for name in ("a.tum", "b.tum", "c.tum")
    )
    assert here == moved
    assert here != other


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("seed: 1", "seed: 2"),
        ("pitch_deg: 90", "pitch_deg: 89"),
        ("pitch_deg: 90", "pitch_deg: 90, imu: exact"),
        ("0.03", "0.02"),
        ("rate_hz: 5", "rate_hz: 5, encoders: exact"),
        ("rate_hz: 5", "rate_hz: 5, slip: none"),
        ("rate_hz: 5", "rate_hz: 5, delta: nominal"),
        ("rate_hz: 5", "rate_hz: 5, robot: pioneer_3dx_paper"),
        ("rate_hz: 5", "rate_hz: 5, leg_s: 1"),
        ("rate_hz: 5", "rate_hz: 5, mover: unicycle"),
        ("rate_hz: 5", "rate_hz: 5, floor: [{surface: seam, center_m: [0, 0], size_m: [1, 1]}]"),
        ("power_lm: 150", "power_lm: 151"),
    ],
)
def test_whatever_a_suite_changes_makes_another_sequence(bench, old, new):
    before, after = (sequence_key(plan.cases[-1]) for plan in (bench.plan(), bench.plan((old, new))))
    assert before != after


@pytest.mark.parametrize(
    "change",
    ["rate_hz: 200", "position_m: [0.1, 0, 0]", "gyro: {walk: 0}", "accel: {bias: [0, 0, 0.1]}", "like: exact"],
)
def test_every_key_of_an_imu_makes_another_sequence(bench, change):
    imu = "like: bmi055, rate_hz: 100"
    changed = change if change.startswith("like") else f"like: bmi055, {change}"
    before, after = (
        sequence_key(bench.plan(("pitch_deg: 90", f"pitch_deg: 90, imu: {{{text}}}")).cases[0])
        for text in (imu, changed)
    )
    assert before != after


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("short:", "long:"),
        ("rate_hz: 5", "rate_hz: 5, kind: waypoints, mover: pioneer"),
        ("rate_hz: 5}", "rate_hz: 5}, other: {kind: circle, radius_m: 0.3}"),
        ("{down:", "{other: {pitch_deg: 60, imu: exact}, down:"),
        ("estimators: [wheel_odometry, stand_still]", "estimators: [constant_velocity]\nrepeats: 3"),
    ],
)
def test_what_a_case_does_not_depend_on_is_no_part_of_what_is_cached(bench, old, new):
    before, after = (
        {case.lighting["lamp"].power_lm: sequence_key(case) for case in plan.cases if _is_first(case)}
        for plan in (
            bench.plan(("full: {}", "full: {lamp: {power_lm: 300}}")),
            bench.plan(("full: {}", "full: {lamp: {power_lm: 300}}"), (old, new)),
        )
    )
    assert before == after
    assert len(before) == 2


def _is_first(case):
    """Whether a case is of the suite as it was."""
    return case.rig.pitch_deg == 90 and case.trajectory.kind == "waypoints" and case.repeat == 0


def killed_amid_a_sequence(bench):
    """The name of a cache in which a killed run has left a sequence unfinished."""
    for attempt in range(5):  # the worker may finish the short sequence before it sees that vobench is gone
        cache = bench.folder / f"killed_{attempt}"
        words = ["vobench", "run", str(bench.suite()), "--out", str(bench.folder / "runs")]
        script = f"import sys; from vobench.cli import main; sys.argv = {words!r}; main()"
        environment = os.environ | {"VOBENCH_CACHE": str(cache)}
        process = subprocess.Popen([sys.executable, "-c", script], env=environment, start_new_session=True)
        try:
            await_file(cache, "sequences/.unfinished-*/*")
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        if list(cache.glob("sequences/.unfinished-*")):
            return cache.name
    raise AssertionError("no kill came before the end of the sequence")


@pytest.mark.slow
def test_a_killed_run_goes_on_and_ends_byte_identical_with_nothing_left_behind(bench, first):
    name = killed_amid_a_sequence(bench)
    resumed = bench.run(cache=name)
    names = (SCORE, estimate_file.ESTIMATE, estimate_file.TRACKS, GROUND_TRUTH)
    assert contents(resumed, *names) == contents(first, *names)
    for case in ("full", "dim"):
        files = [contents_of((run.case(case) / SEQUENCE).resolve()) for run in (first, resumed)]
        assert files[0] == files[1]
    folders = (bench.folder / name, bench.folder / "runs")
    assert not [path for folder in folders for path in folder.rglob(".unfinished-*")]


def contents_of(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def await_file(folder: Path, pattern: str, patience_s: float = 600.0) -> None:
    until = time.monotonic() + patience_s
    while not list(folder.glob(pattern)):
        assert time.monotonic() < until, f"nothing like {pattern} in {patience_s} s"
        time.sleep(0.02)


def test_an_estimator_may_be_a_folder_that_the_suite_names(bench, first, plugin):
    folder = plugin("return Result(np.eye(4)) if frame.index < 2 else Result(None, Status.LOST, 'dark')")
    run = bench.run(("[wheel_odometry, stand_still]", f"[{folder}]"))
    assert [(s.estimator, s.status) for s in run.scores()] == [("mine", "lost")] * 2


def test_a_failure_is_a_row_and_is_tried_again_when_its_cause_may_be_gone(bench, first, plugin, tmp_path, monkeypatch):
    change = ("[wheel_odometry, stand_still]", f"[{plugin('return lib.answer()', head='import lib')}]")
    failed = bench.run(change)
    assert {s.status for s in failed.scores()} == {"refused"}
    assert "No module named 'lib'" in (failed.path / "leaderboard.md").read_text()
    (tmp_path / "lib.py").write_text(
        "import numpy\nfrom vobench.estimator import Result\ndef answer(): return Result(numpy.eye(4))\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    if sandbox_here().level == "full":
        out_of_reach = bench.run(change).scores()[0]
        assert out_of_reach.status == "refused"
        assert f"PYTHONPATH has {tmp_path}" in out_of_reach.reason
        assert f"which an estimator may not read: name it in {READ_VARIABLE}" in out_of_reach.reason
    monkeypatch.setenv(READ_VARIABLE, str(tmp_path))
    assert {s.status for s in bench.run(change).scores()} == {"ok"}


def test_that_a_recording_lacks_a_sensor_is_not_found_again_by_the_next_run(bench, first, plugin):
    change = ("[wheel_odometry, stand_still]", f"[{plugin('return Result(np.eye(4))', needs='[imu]')}]")
    unfit = bench.run(change)
    assert {s.status for s in unfit.scores()} == {"not_applicable"}
    recordings, store = read_all(bench.plan(change)), bench.folder / "cache"
    assert missing(plan(bench.plan(change), recordings), store) == []
    assert [s.reason for s in bench.run(change).scores()] == [s.reason for s in unfit.scores()]


@pytest.mark.parametrize(("step_m", "status"), [("1e5", "diverged"), ("1e200", "invalid_output")])
def test_a_pose_beyond_the_world_or_all_numbers_does_not_stop_the_suite(bench, first, plugin, step_m, status):
    folder = plugin(f"T = np.eye(4); T[0, 3] = {step_m} * (frame.index % 3); return Result(T)")
    run = bench.run(("[wheel_odometry, stand_still]", f"[{folder}, stand_still]"))
    assert [(s.estimator, s.status) for s in run.scores()] == [("mine", status), ("stand_still", "ok")] * 2


def test_what_an_estimator_says_while_it_is_lost_is_no_pose(bench, first, plugin):
    folder = plugin("return Result(np.eye(4), Status.LOST if frame.index == 3 else Status.OK, 'dark')")
    score = bench.run(("[wheel_odometry, stand_still]", f"[{folder}]")).scores()[0]
    assert score.status == "partial"
    assert score.reason == f"no pose for 1 of {score.frames} frames; the first is 3"


def test_who_gives_up_before_the_end_is_lost_however_much_it_covered(bench, first, plugin):
    folder = plugin("return Result(np.eye(4), Status.OK if frame.index < 8 else Status.LOST, 'dark')")
    score = bench.run(("[wheel_odometry, stand_still]", f"[{folder}]")).scores()[0]
    assert score.status == "lost"
    assert score.reason == f"a pose for {score.coverage:.0%} of the frames and none at the end"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lets a process forget its peak")
def test_memory_does_not_grow_with_the_length_of_a_sequence(bench, plugin):
    script = Path(__file__).with_name("measure_memory.py")
    looker = plugin("return Result(np.eye(4), stats={'grey': frame.left.mean()})", needs="[stereo]")
    fewer = (("dim: {lamp: {power_lm: 150}}", ""), ("[wheel_odometry, stand_still]", f"[{looker}]"))
    suites = [bench.suite(("rate_hz: 5", f"rate_hz: {rate}"), *fewer) for rate in (5, 6, 30)]
    command = [sys.executable, str(script), str(bench.folder / "long"), *map(str, suites)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    # The first suite also pays for the light, which the others find in the cache.
    _, (few, *short_mb), (many, *long_mb) = [map(float, line.split()) for line in said.splitlines()]
    assert many > few + 45
    # One grey picture kept of each frame would be 15 MB here.
    assert all(longer - shorter < 8 for shorter, longer in zip(short_mb, long_mb, strict=True)), said


def test_a_suite_of_stock_pyrender_runs_to_a_board(bench):
    run = bench.run(
        ("seed: 1", "seed: 1\nrendering: {engine: pyrender}"), ("full: {}, dim: {lamp: {power_lm: 150}}", "full: {}")
    )
    board = (run.path / "leaderboard.csv").read_text()
    assert "wheel_odometry" in board
    assert "crashed" not in (run.path / "leaderboard.md").read_text()


@pytest.mark.parametrize(
    ("failure", "status"), [("out_of_memory", "out_of_memory"), ("refused", "refused"), (None, "crashed")]
)
def test_a_trial_has_the_status_of_the_task_that_failed_and_is_crashed_if_that_has_none(failure, status):
    task = Task("score", None, {"case": "down"}, ("sequence/1", "estimate/1"))
    outcome = TaskOutcome(failure, "it is full", stack="main")
    gathering = SimpleNamespace(_failed_cases={}, _failures={task.key: outcome})
    made = _Gathering._failure(gathering, task)
    assert (made.status, made.reason, made.stack) == (status, "it is full", "main")
    assert _Gathering._failure(SimpleNamespace(_failed_cases={}, _failures={}), task) is None
