"""vobench new and try: a scaffold that keeps the contract and scores as it is."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize("words", [(), ("--command",)], ids=["class", "command"])
def test_from_new_to_a_row_of_the_board_in_three_commands(vobench, here, words):
    made = vobench("new", "estimator", "mine", *words)
    assert "vobench try mine" in made.out
    tried = vobench("try", "mine")
    assert tried.code == 0, tried.out
    assert "BROKEN" not in tried.out
    ran = vobench("run", "tiny", "-e", "mine")
    assert ran.code == 0
    assert "mine" in ran.out
    assert "crashed" not in ran.out


def test_the_scaffold_tests_itself(vobench, here):
    vobench("new", "estimator", "mine")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "estimators/mine"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_json_says_what_was_made_and_what_is_kept(vobench, here):
    made = vobench("new", "estimator", "mine", "--json").json
    assert made == {"path": "estimators/mine", "files": ["estimator.py", "estimator.yaml", "test_contract.py"]}
    tried = vobench("try", "mine", "--json").json
    assert tried["kept"] is True
    assert {clause["name"] for clause in tried["clauses"]} >= {"determinism", "causality", "restart", "standstill"}


def test_a_broken_one_ends_with_1_and_says_where(vobench, here):
    vobench("new", "estimator", "mine")
    file = Path("estimators/mine/estimator.py")
    file.write_text(file.read_text().replace("self.T_odom_left.copy()", "2 * self.T_odom_left"))
    tried = vobench("try", "mine")
    assert tried.code == 1
    assert "BROKEN    rigid poses in time: invalid_output after 1 frames: frame 1: the pose is no rigid" in tried.out


DRIFTS = """
import numpy as np
from vobench.estimator import Result

class Mine:
    def start(self, rig, params, seed):
        self.frames = 0

    def process(self, frame):
        T_odom_left = np.eye(4)
        T_odom_left[0, 3] = 1e-3 * self.frames
        self.frames += 1
        return Result(T_odom_left)
"""


def test_a_poor_one_ends_with_0_and_imports_from_inside_vobench_are_named(vobench, here):
    vobench("new", "estimator", "mine")
    Path("estimators/mine/estimator.py").write_text(DRIFTS)
    tried = vobench("try", "mine")
    assert tried.code == 0, tried.out
    advice = "advice    imports: estimator.py:3: vobench.estimator.Result: from vobench.plugin import Result\n"
    assert tried.out.startswith(advice)
    assert "poor      standstill: at most 19.00 mm away within a second; at most 10 mm is good\n" in tried.out
    assert "BROKEN" not in tried.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("new", "estimator", "My-Own"),
            "a name should be lower-case letters, digits and _, a letter first (got 'My-Own')",
        ),
        (("new", "suite", "mine"), "no kind of thing to make named 'suite'"),
        (("try", "stand_stil"), "no estimator named 'stand_stil'. Did you mean 'stand_still'?"),
    ],
)
def test_a_mistake_is_one_line(vobench, here, words, said):
    done = vobench(*words)
    assert done.code == 1
    assert said in done.err


def test_what_is_there_is_not_written_over(vobench, here):
    vobench("new", "estimator", "mine")
    again = vobench("new", "estimator", "mine")
    assert again.code == 1
    assert "there is one already; choose another name or take it away: estimators/mine" in again.err
