"""The example for CI: its workflow is valid, and its script passes, fails and comments as it says."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from vobench.runner.bundle import opened
from vobench.runner.folder import SUITE, RunFolder

CI = Path(__file__).parents[2] / "examples" / "ci"
BASELINE = CI / "baseline.zip"
MOST_BYTES = 2_000_000  # small enough to commit
# Stands for vobench: running a suite is done already, everything else is done by vobench itself.
STAND_IN = """#!{python}
import os, sys
if sys.argv[1] != "run":
    os.execv(sys.executable, [sys.executable, "-m", "vobench", *sys.argv[1:]])
"""


def steps():
    workflow = YAML(typ="safe").load((CI / "vobench.yml").read_text())
    return workflow["jobs"]["regression"]["steps"]


def test_the_workflow_runs_the_script_before_it_comments():
    commands = [step.get("run", "") for step in steps()]
    (checks,) = [number for number, command in enumerate(commands) if "check.sh regression" in command]
    (comments,) = [number for number, command in enumerate(commands) if "gh pr comment" in command]
    assert checks < comments
    assert "ci/baseline.zip" in commands[checks]


def test_a_failed_comparison_still_comments_and_fails_the_job():
    for step in steps():
        command = step.get("run", "")
        if "gh pr comment" in command:
            assert step["if"].startswith("always()")
        if "check.sh" in command:
            assert not {"continue-on-error", "if"} & step.keys()


def test_the_baseline_is_a_small_run_of_the_suite_that_the_workflow_runs():
    assert BASELINE.stat().st_size < MOST_BYTES
    with opened(BASELINE) as folder:
        assert json.loads((folder.path / SUITE).read_text())["name"] == "regression"
        assert {score.status for score in folder.scores()} <= {"ok", "partial", "lost", "diverged"}


@pytest.fixture
def checked(tmp_path):
    """Runs the script on the baseline's own run, after a change of its files; returns the exit code and the comment."""

    def run(change):
        with zipfile.ZipFile(BASELINE) as file:
            file.extractall(tmp_path / "runs" / "regression")
        folder = RunFolder(tmp_path / "runs" / "regression")
        change(folder)
        stand_in = tmp_path / "bin" / "vobench"
        stand_in.parent.mkdir()
        stand_in.write_text(STAND_IN.format(python=sys.executable))
        stand_in.chmod(0o755)
        environment = {**os.environ, "PATH": f"{stand_in.parent}:{os.environ['PATH']}"}
        command = [str(CI / "check.sh"), "regression", "lk_epipolar", str(BASELINE)]
        ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        return ended.returncode, (tmp_path / "comment.md").read_text()

    return run


def stretch_estimates(folder):
    """Make every path of lk_epipolar 20 % too long."""
    for path in folder.path.glob("cases/*/estimates/lk_epipolar/*/estimate.tum"):
        lines = []
        for line in path.read_text().splitlines():
            stamp, x, y, z, *rotation = line.split()
            longer = [repr(1.2 * float(value)) for value in (x, y, z)]
            lines.append(" ".join([stamp, *longer, *rotation]))
        path.write_text("\n".join(lines) + "\n")


def test_the_same_run_passes(checked):
    code, comment = checked(lambda folder: None)
    assert code == 0
    assert comment.startswith("### regression: nothing got worse")
    assert "lk_epipolar" in comment


def test_a_worse_estimator_fails_and_the_comment_says_which(checked):
    code, comment = checked(stretch_estimates)
    assert code == 3
    assert comment.startswith("### regression: something got worse")
    assert "worse" in comment.partition("Compared with the baseline")[2]
