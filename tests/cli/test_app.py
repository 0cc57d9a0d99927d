"""Every command: its help, its JSON, its exit code, and one line for every mistake."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from vobench import __version__
from vobench.cli import command_group

# ruff: noqa: E501 - a sentence stands in one line


README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
COMMANDS = list(command_group.COMMANDS)
HEAVY = ("numpy", "cv2", "pandas", "rerun", "scipy", "pydantic", "rich.table", "OpenGL", "trimesh")
GT, EST = (
    "runs/tiny/latest/cases/short/ground_truth.tum",
    "runs/tiny/latest/cases/short/estimates/stand_still/0/estimate.tum",
)


def test_help_imports_no_heavy_library():
    script = (
        "import sys; from vobench.cli import main; sys.argv = ['vobench', '--help']\n"
        "try: main()\nexcept SystemExit: pass\n"
        f"print('heavy:', *(name for name in {HEAVY!r} if name in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].strip() == "heavy:"
    assert "Usage: vobench" in done.stdout


FAULT = """
import ctypes, sys
from vobench.cli import app, main
app._call_command = lambda: ctypes.string_at(0)
sys.argv = ["vobench", "list"]
main()
"""


def test_a_fault_in_a_library_shows_where_vobench_was():
    done = subprocess.run([sys.executable, "-c", FAULT], capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGSEGV
    assert "Fatal Python error: Segmentation fault" in done.stderr
    assert "cli/app.py" in done.stderr


OUTSIDE = """
import numpy as np
from vobench.plugin import POSES, MetricDefinition

def greet(name: str = "you", *, json: bool = False) -> None:
    \"\"\"Say hello.\"\"\"
    print('{"hello": "%s"}' % name if json else f"hello {name}")

HEIGHT = MetricDefinition(
    "ate_height", "height", "m", "|z|", "a test", POSES, "the floor",
    measure=lambda of: np.abs(of.T_aligned[:, 2, 3] - of.matched.T_gt[:, 2, 3]),
)
"""


def test_a_verb_and_a_metric_from_outside_are_there_once_they_are_installed(vobench, ran, tmp_path, monkeypatch):
    site = tmp_path / "site"
    (site / "outside-1.dist-info").mkdir(parents=True)
    (site / "outside.py").write_text(OUTSIDE)
    (site / "outside-1.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\nVersion: 1\n")
    groups = "[vobench.commands]\ngreet = outside:greet\n[vobench.metrics]\nheight = outside:HEIGHT\n"
    (site / "outside-1.dist-info" / "entry_points.txt").write_text(groups)
    assert vobench("greet").code == 2
    monkeypatch.syspath_prepend(str(site))
    assert vobench("greet", "--name", "Ada", "--json").json == {"hello": "Ada"}
    assert "Say hello." in vobench("--help").out
    assert vobench("metrics", "ate_height", "--json").json["unit"] == "m"
    assert "ate_height" in [metric["name"] for metric in vobench("score", GT, EST, "--full", "--json").json["metrics"]]
    assert "ate_height" not in vobench("score", GT, EST).out


def test_every_command_is_in_the_readmes_list_and_the_list_has_no_other():
    section = README.split("## Commands\n")[1].split("\n## ")[0]
    listed = section.split("\nEvery command")[0]
    codes = re.findall(r"`([^`]+)`", listed)
    assert set(COMMANDS) <= {code.split()[0] for code in codes}
    with_arguments = {code.split()[0] for code in codes if " " in code}
    assert with_arguments <= set(COMMANDS)


JSON = [
    (("run", "tiny"), "totals"),
    (("run", "tiny", "--dry-run"), "cases"),
    (("check", "tiny"), "cases"),
    (("render", "closet", "--at", "0", "0", "1", "--out", "look.png"), "files"),
    (("list",), "entries"),
    (("list", "scenes"), "entries"),
    (("score", GT, EST), "metrics"),
    (("diagnose", GT, GT), "findings"),
    (("metrics",), "metrics"),
    (("metrics", "ate_trans"), "formula"),
    (("metrics", "ate"), "error"),
    (("report", "runs/tiny"), "cells"),
    (("report", "runs/tiny", "--out", "board.html"), "path"),
    (("report", "runs/tiny", "runs/tiny"), "totals"),
    (("compare", "runs/tiny", "runs/tiny"), "changes"),
    (("bundle", "runs/tiny", "tiny.zip"), "bytes"),
    (("view", "runs/tiny"), "path"),
    (("view", "runs/tiny", "--save", "look.rrd"), "path"),
    (("schema",), "properties"),
    (("schema", "scene"), "properties"),
    (("schema", "estimator"), "properties"),
    (("schema", "nope"), "error"),
    (("run", "nope"), "error"),
    (("report", "nope"), "error"),
    (("list", "nope"), "error"),
]


@pytest.mark.parametrize(("words", "key"), JSON, ids=[" ".join(words[:2]) for words, _ in JSON])
def test_json_is_one_object_and_nothing_else(vobench, ran, words, key):
    said = vobench(*words, "--json")
    assert key in said.json
    assert said.code == (1 if key == "error" else 0)


def test_a_broken_file_beside_the_good_ones_is_listed_with_its_reason(vobench, here):
    (here / "suites" / "broken.yaml").write_text("name: [\n")
    (here / "scenes" / "binary.yaml").write_bytes(b"\xff\xfe")
    (here / "suites" / "folder.yaml").mkdir()
    said = vobench("list", "--json")
    summaries = {entry["name"]: entry["summary"] for entry in said.json["entries"]}
    assert said.code == 0
    assert summaries["broken"].startswith("unreadable: ")
    assert summaries["binary"].endswith("binary.yaml: not a text file in UTF-8")
    assert summaries["folder"].endswith("Is a directory")


WRONG = [
    (("run", "tinny"), "no suite named 'tinny'. Did you mean 'tiny'? Known: daily, full, hand, paper, quickstart, regression, sensors, street, tiny, worlds"),
    (("check", "./no.yaml"), "no suite file at no.yaml. Known by name: daily, full, hand, paper, quickstart, regression, sensors, street, tiny, worlds"),
    (("run", "tiny", "-e", "stand_stil"), "no estimator named 'stand_stil'. Did you mean 'stand_still'? Known: constant_velocity, feature_vo, imu_dead_reckoning, "
     "imu_visual, lk_epipolar, mono_vo, noisy_truth, planar_floor, stand_still, stereo_pnp, wheel_odometry, wheel_visual"),
    (("run", "tiny", "--out", "suites/tiny.yaml"), "out should be a folder that can be written (File exists): suites/tiny.yaml"),
    (("list", "scene_s"), "no kind named 'scene_s'. Did you mean 'scenes'? Known: estimators, scenarios, scenes, suites"),
    (("score", "no.tum", "no.tum"), "cannot read no.tum: No such file or directory"),
    (("score", "suites/tiny.yaml", "no.tum"), "suites/tiny.yaml:1: no format of trajectories has 2 columns: TUM has 8 columns (t x y z qx qy qz qw); KITTI has 12, or 13 with a frame number in front; TartanAir has 7; EuRoC has 8, separated by commas"),
    (("score", "a", "b", "--align", "sm3"), "no alignment named 'sm3'. Did you mean 'sim3'? Known: none, origin, scale, se3, sim3, yaw"),
    (("score", "a", "b", "--t-max-diff", "nan"), "--t-max-diff should be 0 to 1e+06 seconds, got nan"),
    (("report", "suites"), "not the folder of a run (no cases/*/estimates/*/*/score.json in it): suites"),
    (("report", "suites", "--format", "htm"), "no format named 'htm'. Did you mean 'html'? Known: csv, html, json, latex, md, terminal"),
    (("report", "suites", "--out", "a.xls"), "no format has the ending of 'a.xls'; choose one with --format: md, json, csv, latex, html"),
    (("view", "suites"), "not the folder of a run (no cases/*/estimates/*/*/score.json in it): suites"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "sentence"), WRONG, ids=[" ".join(words) for words, _ in WRONG])
def test_a_mistake_is_one_line_and_exit_code_1(vobench, words, sentence):
    said = vobench(*words)
    assert (said.code, said.out, said.err) == (1, "", f"vobench: {sentence}\n")


def test_a_mistake_in_the_words_themselves_is_exit_code_2(vobench):
    for words in (("bogus",), ("run",), ("run", "tiny", "--bogus"), ("score", "a", "b", "--delta", "much")):
        assert vobench(*words).code == 2


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("report", "runs/tiny", "--out", "no/board.md"), "No such file or directory: no/board.md"),
        (("report", "runs/tiny", "--format", "md", "--out", "runs"), "Is a directory: runs"),
        (("view", "runs/tiny", "--save", "no/a.rrd"), "--save should name a file in a folder that can be written to, got no/a.rrd"),
        (("view", "runs/tiny", "--save", "runs"), "--save should name a file, but this is a folder: runs"),
        (("view", "runs/tiny", "--case", "long"), "no case 'long' in this run. Known: short"),
        (("view", "runs/tiny", "--estimator", "me"), "no estimator 'me' in this run. Known: stand_still, wheel_odometry"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_or_written_is_one_line(vobench, ran, words, sentence):
    said = vobench(*words)
    assert (said.code, said.err) == (1, f"vobench: {sentence}\n")


def test_version_needs_no_command(vobench):
    assert vobench("--version").out == f"{__version__}\n"


def test_a_terminal_that_knows_no_degree_sign_gets_a_table_all_the_same(ran, here):
    script = "import sys; from vobench.cli import main; sys.argv = ['vobench', 'report', 'runs/tiny']; main()"
    environment = os.environ | {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, env=environment, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"? best" in done.stdout


@pytest.mark.parametrize("words", [("list", "--json"), ("metrics",), ("report", "runs/tiny")], ids=" ".join)
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_seen_enough_is_no_failure_and_gets_no_traceback(ran, words, unbuffered):
    script = f"import sys; from vobench.cli import main; sys.argv = ['vobench', *{words!r}]; main()"
    pipe = 'set -o pipefail; "$0" -c "$1" | true'
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    command = ["bash", "-c", pipe, sys.executable, script]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_shell_is_told_how_to_complete_and_is_offered_the_commands(shell):
    asked = {"COMP_WORDS": "vobench ver", "COMP_CWORD": "1"}
    asked |= {"_TYPER_COMPLETE_ARGS": "vobench ver", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    script = "import sys; from vobench.cli import main; sys.argv = ['vobench']; main()"

    def said(instruction):
        environment = os.environ | asked | {"_VOBENCH_COMPLETE": f"{instruction}_{shell}"}
        return subprocess.check_output([sys.executable, "-c", script], env=environment, text=True)

    assert f"complete_{shell}" in said("source")
    offered = said("complete")
    assert "verify" in offered
    assert "report" not in offered


def test_python_m_vobench_is_the_same_command(tmp_path):
    def output_of(*words):
        command = [sys.executable, "-m", "vobench", *words]
        return subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)

    assert output_of("--version").stdout.strip() == __version__
    wrong = output_of("run", "no_such_suite")
    assert wrong.returncode == 1
    assert wrong.stderr.startswith("vobench: no suite named 'no_such_suite'")
    assert "Usage: vobench run" in output_of("run", "--help").stdout
