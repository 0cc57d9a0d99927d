"""Nobody reaches the first rank without looking at pictures: programs that search for the truth, and saboteurs."""

import json
import os
import shutil
import sys
from pathlib import Path

import pytest

from vobench.estimator import isolation
from vobench.estimator.program import sandbox_here
from vobench.runner.folder import ONLY_THEIR_OWN, open_run, visible_to

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        isolation.FILES in sandbox_here().sees, reason="this machine cannot keep files from an estimator, and says so"
    ),
]

MANIFEST = """name: {name}
version: "1"
{door}
needs: []
pose_of: left_camera
summary: Finds the truth
"""
SEARCH = '''
import glob, os, sys

def found():
    """Every ground_truth.tum in reach."""
    places = ["CACHE", "RUNS", os.path.join(os.path.dirname(__file__), "link"), "/proc/[0-9]*/rootRUNS", *sys.argv[1:]]
    paths = [path for place in places for path in glob.glob(place + "/**/ground_truth.tum", recursive=True)]
    return sorted(paths, key=len)
'''
CLASS = """
import numpy as np
from vobench.estimator import Result
from vobench.geometry import se3
from vobench.trajectory.tum import parse_tum

class Oracle:
    def start(self, rig, params, seed):
        paths = found()
        self.poses = {}
        if paths:
            truth = parse_tum(open(paths[0]).read(), name="truth")
            self.poses = dict(zip(truth.t_ns.tolist(), se3.inverse(truth.T_world_frame[0]) @ truth.T_world_frame))

    def process(self, frame):
        return Result(self.poses.get(frame.t_ns, np.eye(4)))
"""
LINKS = """
paths = found() + ["RUNS/tiny/latest/cases/CASE/ground_truth.tum"]
out = sys.argv[1]
HOW
"""
HOWS = {
    "symlink": "os.symlink(paths[0], out)",
    "hardlink": "os.link(paths[0], out)",
    "folder_link": "os.symlink(os.path.dirname(paths[0]), 'ground'); os.symlink('ground/ground_truth.tum', out)",
    "descriptor": "os.symlink('/proc/self/fd/0', out)",
}


def add(here, name, door, code):
    folder = here / "estimators" / name
    folder.mkdir(parents=True)
    (folder / "estimator.yaml").write_text(MANIFEST.format(name=name, door=door))
    case = next((here / "runs" / "tiny" / "latest" / "cases").iterdir()).name
    for word, value in (("CACHE", here / "cache"), ("RUNS", here / "runs"), ("CASE", case)):
        code = code.replace(word, str(value))
    (folder / "estimator.py").write_text(code)
    (folder / "link").symlink_to(here / "cache")
    return name


@pytest.fixture
def oracles(here, vobench):
    """A folder with an earlier run, and oracles by every door."""
    assert vobench("run", "tiny").code == 0
    made = [add(here, "oracle_class", "class: estimator:Oracle", SEARCH + CLASS)]
    for how, code in HOWS.items():
        words = f'command: [{sys.executable}, ./estimator.py, "{{out}}", "{here}/cache/x", "{here}/runs", ./link]'
        made.append(add(here, how, words, SEARCH + LINKS.replace("HOW", code)))
    return made


def rows(here):
    run = open_run(here / "runs" / "tiny")
    return {score.estimator: score for score in run.scores()}, json.loads((run.path / "leaderboard.json").read_text())


def test_no_oracle_is_better_than_one_that_stands_still(here, vobench, oracles):
    names = [word for name in (*oracles, "wheel_odometry", "stand_still") for word in ("-e", name)]
    assert vobench("run", "tiny", *names).code == 0
    scores, _ = rows(here)
    still = scores["stand_still"]
    assert scores["oracle_class"].score["metrics"] == still.score["metrics"]
    for how in HOWS:
        assert scores[how].status in ("crashed", "invalid_output"), scores[how]
    ate = {name: score.value("ate_trans", "rmse") for name, score in scores.items() if score.score}
    assert min(ate, key=ate.get) == "wheel_odometry"
    if sandbox_here().level == "full":
        assert visible_to(scores.values()) == ONLY_THEIR_OWN


def test_without_a_sandbox_an_oracle_is_first_but_no_link_is_followed_and_the_record_says_so(
    here, vobench, oracles, monkeypatch
):
    monkeypatch.setenv("VOBENCH_SANDBOX", "off")
    names = [word for name in (*oracles, "wheel_odometry") for word in ("-e", name)]
    assert vobench("run", "tiny", *names, "--fresh").code == 0
    scores, _ = rows(here)
    assert scores["oracle_class"].value("ate_trans", "rmse") < 1e-6
    assert scores["oracle_class"].sandbox.level == "none"
    assert "not sandboxed" in visible_to(scores.values())
    for how in HOWS:
        assert scores[how].status == "invalid_output", scores[how]
    assert "is a symbolic link" in scores["symlink"].reason
    assert "hard link" in scores["hardlink"].reason


HONEST = """
import shutil
import sys
import time
from pathlib import Path

dataset, out = Path(sys.argv[1]), Path(sys.argv[2])
stamps = (dataset / "times.txt").read_text().split()
with out.open("w") as file:
    for number, stamp in enumerate(stamps):
        file.write(f"{stamp} {0.01 * number} 0 0 0 0 0 1\\n")
        file.flush()
        time.sleep(0.05)
"""
SABOTEUR = """
import glob, os, signal, sys, time
from contextlib import suppress

until = time.monotonic() + 4
while time.monotonic() < until:
    places = ["/tmp", os.environ["TMPDIR"] + "/..", os.environ["TMPDIR"] + "/../..", "TEMPORARY", "/proc/[0-9]*/cwd"]
    for place in places:
        for path in glob.glob(place + "/**/poses.txt", recursive=True):
            with suppress(OSError):
                open(path, "a").write("9 9 9 9 0 0 0 1\\n")
    for path in glob.glob("/dev/shm/*"):
        with suppress(OSError):
            os.remove(path)
    with suppress(OSError):
        os.kill(-1, signal.SIGCONT)
    time.sleep(0.01)
"""


def test_the_neighbour_of_a_saboteur_scores_as_it_does_alone(here, vobench, tmp_path, monkeypatch):
    if sandbox_here().level != "full":
        pytest.skip("this machine cannot keep neighbours apart, and says so")
    (here / "runs" / "tiny" / "latest" / "cases" / "none").mkdir(parents=True)
    door = f'command: [{sys.executable}, ./estimator.py, "{{dataset}}", "{{out}}"]'
    add(here, "honest", door, HONEST)
    (here / "runs" / "tiny" / "latest").rename(here / "not a run")
    assert vobench("run", "tiny", "-e", "honest").code == 0
    alone = files_of(here, "honest")
    temporary = os.environ.get("TMPDIR", "/tmp")
    add(here, "saboteur", door, SABOTEUR.replace("TEMPORARY", temporary))
    both = ("run", "tiny", "-e", "honest", "-e", "saboteur", "--fresh", "--jobs", "2", "--share-time")
    assert vobench(*both).code == 0
    assert files_of(here, "honest") == alone


def files_of(here, name):
    """An estimator's score, poses and frames, as bytes."""
    place = next((here / "runs" / "tiny" / "latest" / "cases").iterdir()) / "estimates" / name / "0"
    return {file: Path(place, file).read_bytes() for file in ("score.json", "estimate.tum", "frames.csv")}


def put_in(own, here):
    """Put an earlier run in three forms, and recordings of the truth, into the folder of an estimator."""
    earlier = (here / "runs" / "tiny" / "latest").resolve()
    truth = next(earlier.glob("cases/*/ground_truth.tum")).read_text()
    shutil.copytree(earlier, own / "kept" / "deep" / "run", symlinks=True)
    (own / "truth").mkdir()
    for name in ("groundtruth.txt", "ground_truth.tum"):
        (own / "truth" / name).write_text(truth)


OWN_SEARCH = """
import glob, os, sys

def found():
    '''Everything below its own folder that could be a trajectory, but its own answers.'''
    own = os.path.dirname(os.path.abspath(__file__))
    paths = [path for end in ("tum", "txt") for path in glob.glob(own + "/**/*." + end, recursive=True)]
    seen = [path for path in paths if os.path.getsize(path) and os.access(path, os.R_OK)]
    print("it sees", seen)
    return sorted(seen, key=lambda path: "truth" not in os.path.basename(path))
"""


@pytest.fixture
def project(here, vobench):
    """An estimator whose folder is that of a whole project, with results of an earlier run in it."""
    assert vobench("run", "tiny").code == 0
    add(here, "project", "class: estimator:Oracle", OWN_SEARCH + CLASS)
    own = here / "estimators" / "project"
    put_in(own, here)
    results = own / "results"
    assert vobench("run", "tiny", "-e", "stand_still", "--out", str(results)).code == 0
    return own


def test_an_estimator_whose_folder_holds_results_does_not_read_them(here, vobench, project):
    names = [word for name in ("project", "stand_still", "wheel_odometry") for word in ("-e", name)]
    assert vobench("run", "tiny", *names, "--out", str(project / "results")).code == 0
    run = open_run(project / "results" / "tiny")
    scores = {score.estimator: score for score in run.scores()}
    assert scores["project"].score["metrics"] == scores["stand_still"].score["metrics"]
    (log,) = run.path.glob("cases/*/estimates/project/0/log.txt")
    assert "it sees []" in log.read_text()


def test_nor_does_one_to_which_the_folder_of_all_results_is_opened(here, vobench, project, monkeypatch):
    monkeypatch.setenv("VOBENCH_SANDBOX_READ", str(here))
    names = [word for name in ("project", "stand_still") for word in ("-e", name)]
    assert vobench("run", "tiny", *names, "--out", str(here / "other")).code == 0
    scores = {score.estimator: score for score in open_run(here / "other" / "tiny").scores()}
    assert scores["project"].score["metrics"] == scores["stand_still"].score["metrics"]
