"""vobench new and try: a scaffold that keeps the contract and scores as it is."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI


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


@pytest.mark.parametrize(
    ("name", "expected"),
    [("mine", "Mine"), ("my_vo", "MyVo"), ("vo2_fast_", "Vo2Fast"), ("none", "NoneEstimator")],
)
def test_the_class_has_the_name_of_the_estimator(vobench, here, name, expected):
    vobench("new", "estimator", name)
    folder = Path("estimators") / name
    assert f"class: estimator:{expected} " in (folder / "estimator.yaml").read_text()
    assert f"class {expected}:" in (folder / "estimator.py").read_text()
    compile((folder / "estimator.py").read_text(), "estimator.py", "exec")


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
    reason = "invalid_output after 1 frames: frame 1: the pose is not a rigid"
    assert f"BROKEN     rigid poses in time: {reason}" in tried.out


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
    advice = "advice     imports: estimator.py:3: vobench.estimator.Result: from vobench.plugin import Result\n"
    assert tried.out.startswith(advice)
    assert "poor       standstill: moves by up to 19.00 mm within a second; up to 10 mm is good\n" in tried.out
    assert "BROKEN" not in tried.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("new", "estimator", "My-Own"),
            "a name should consist of lower-case letters, digits and _, and begin with a letter (got 'My-Own')",
        ),
        (("new", "suit", "mine"), "no kind of thing to create named 'suit'. Did you mean 'suite'?"),
        (
            ("new", "suite", "My-Own"),
            "a name should consist of lower-case letters, digits and _, and begin with a letter",
        ),
        (("new", "suite", "mine", "--command"), "--command requires an estimator, not a suite"),
        (("new", "estimator", "mine", "--from", "lk_epipolar"), "--from requires a suite or a scene"),
        (
            ("new", "suite", "mine", "--from", "lightning"),
            "no suite or example named 'lightning'. Did you mean 'lighting'?",
        ),
        (("new", "scene", "mine", "--from", "rom"), "no scene named 'rom'. Did you mean 'room'?"),
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
    assert "already exists; choose another name, or remove it: estimators/mine" in again.err


def test_a_new_suite_and_scene_are_checked_and_run_by_the_commands_that_new_prints(vobench, here):
    made = vobench("new", "suite", "mine")
    assert made.out == "Created suites/mine.yaml. Check it: vobench check mine\nRun it: vobench run mine\n"
    assert "4 cases, 3 estimators, 12 trials: the suite is valid" in vobench("check", "mine").out

    made = vobench("new", "scene", "lab")
    printed = re.findall(r"vobench (scene|render) (\w+)", made.out)
    assert printed == [("scene", "lab"), ("render", "lab")]
    assert "light: lamp, 6000 lm" in vobench("scene", "lab").out
    assert vobench("render", "lab").code == 0
    assert Path("frame.png").is_file()

    suite = Path("suites/mine.yaml")
    suite.write_text(suite.read_text().replace("scenes: [room]", "scenes: [lab]").replace("lamp_b", "lamp"))
    ran = vobench("run", "mine", "--set", "estimators=[stand_still]", "--json").json
    assert {cell["status"] for cell in ran["cells"]} == {"ok"}
    assert len(ran["cells"]) == 4


def test_an_example_is_run_by_its_name_once_it_is_copied(vobench, here):
    assert vobench("run", "lighting").code == 1
    made = vobench("new", "suite", "lighting", "--from", "lighting", "--json").json
    assert made == {"path": "suites/lighting.yaml", "files": ["lighting.yaml"]}
    assert "6 cases, 2 estimators, 12 trials: the suite is valid" in vobench("check", "lighting").out


def test_what_is_made_elsewhere_is_named_by_its_path(vobench, here):
    made = vobench("new", "suite", "mine", "--out", "elsewhere")
    assert "vobench check elsewhere/mine.yaml" in made.out
    assert vobench("check", "elsewhere/mine.yaml").code == 0
