"""Manifests: what is read, what is refused in one line, and what loading makes of them."""

import subprocess
import sys
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

from vobench.errors import SuiteError, VobenchError
from vobench.estimator.worker import load
from vobench.suite.manifest import read_manifest

ESTIMATORS = Path(__file__).parents[2] / "estimators"
GOOD = {
    "name": "mine",
    "version": '"1"',
    "class": "estimator:Mine",
    "needs": "[stereo]",
    "pose_of": "body",
    "summary": "Mine",
}
CODE = """
class Mine:
    def start(self, rig, params, seed): ...
    def process(self, frame): ...
"""


def plugin(folder, code=CODE, **keys):
    content = {**GOOD, **keys}
    folder.mkdir(exist_ok=True)
    lines = [f"{key.rstrip('_')}: {value}" for key, value in content.items() if value is not None]
    (folder / "estimator.yaml").write_text("\n".join(lines))
    (folder / "estimator.py").write_text(code)
    return folder


@pytest.mark.parametrize(
    ("keys", "described"),
    [
        ({}, "Mine"),
        ({"summary": None}, "estimator:Mine, needs stereo"),
        ({"summary": None, "needs": "[mono, imu]"}, "estimator:Mine, needs mono and imu"),
        ({"summary": None, "needs": None}, "estimator:Mine, needs no sensor"),
        ({"summary": None, "class": None, "stream": "[./run, --fast]"}, "./run --fast, needs stereo"),
    ],
)
def test_a_manifest_without_a_summary_is_described_by_how_it_is_run(tmp_path, keys, described):
    assert read_manifest(plugin(tmp_path / "mine", **keys)).described == described


def loaded(folder):
    manifest = read_manifest(folder)
    return load(folder, manifest.class_path, name=manifest.name)


@pytest.mark.parametrize("folder", sorted(p for p in ESTIMATORS.iterdir() if p.is_dir()), ids=lambda p: p.name)
def test_every_estimator_of_the_house_is_read_and_loads_under_its_folder_name(folder):
    manifest = read_manifest(folder)
    assert manifest.name == folder.name
    if not manifest.oracle:
        assert type(loaded(folder)).__name__ == manifest.class_path.partition(":")[2]


def test_a_manifest_says_what_it_says(tmp_path):
    manifest = read_manifest(plugin(tmp_path, params="{window_px: 21}", paper="Somebody 1999"))
    assert (manifest.name, manifest.version, manifest.pose_of) == ("mine", "1", "body")
    assert manifest.class_path == "estimator:Mine"
    assert (manifest.needs, manifest.params, manifest.paper) == (("stereo",), {"window_px": 21}, "Somebody 1999")


def test_what_a_manifest_leaves_out_is_what_most_estimators_are(tmp_path):
    manifest = read_manifest(plugin(tmp_path, limits="{frame_s: 1}"))
    assert (manifest.metric, manifest.causal, manifest.deterministic, manifest.claims) == (True, True, True, ())
    assert (manifest.limits.start_s, manifest.limits.frame_s, manifest.limits.threads) == (60.0, 1.0, 1)


def test_a_board_hears_what_an_estimator_does_not_claim(tmp_path):
    folder = plugin(tmp_path, metric="false", causal="false", deterministic="false")
    assert read_manifest(folder).claims == ("Sim(3)", "not causal", "not deterministic")
    folder = plugin(tmp_path, **{"class": None, "command": "[./run, '{dataset}', '{out}']", "causal": "false"})
    assert read_manifest(folder).claims == ("whole recording",)


def test_a_manifest_does_not_change(tmp_path):
    manifest = read_manifest(plugin(tmp_path))
    with pytest.raises(FrozenInstanceError):
        manifest.name = "other"


def test_reading_a_manifest_imports_neither_opencv_nor_the_code():
    script = (
        "import sys; from pathlib import Path; from vobench.suite.manifest import read_manifest;"
        "read_manifest(Path(sys.argv[1]));"
        "print('cv2' in sys.modules, any('vobench_estimators' in m for m in sys.modules))"
    )
    command = [sys.executable, "-c", script, str(ESTIMATORS / "lk_epipolar")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ESTIMATORS.parent)
    assert done.stdout.split() == ["False", "False"]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"name": "My-Own"}, r"estimator\.yaml:1: name: .*\(got 'My-Own'\)"),
        ({"version": "1.0"}, r":2: version: should be text .*\(got 1\.0\)"),
        ({"class_": "Mine", "class": None}, r"class: .*\(got 'Mine'\)"),
        ({"needs": "[lidar]"}, r":4: needs\.0: .*'stereo', 'mono', 'colour', 'encoders' or 'imu' \(got 'lidar'\)"),
        ({"pose_of": "head"}, r":5: pose_of: .*'left_camera', 'body' or 'imu' \(got 'head'\)"),
        ({"version": None}, r"version: .*missing"),
        ({"parms": "{}"}, r":7: parms: unknown key\. Did you mean 'params'\?"),
        ({"params": "7"}, r":7: params: .*\(got 7\)"),
        ({"class": None}, r"an estimator has one of class, command, stream, oracle \(got none\)"),
        ({"stream": "[./run]"}, r"an estimator has one of .* \(got class and stream\)"),
        ({"class": None, "command": "[./run, '{dataset}']"}, r"command: should have \{out\}"),
        (
            {"class": None, "command": "[./run, '{data}', '{out}']"},
            r"command: no placeholder or parameter named 'data'\. Did",
        ),
        ({"class": None, "command": "[./run]", "out": "../poses.txt"}, r"out: should be a file below the work folder"),
        ({"class": None, "stream": "[./run, '{out}']"}, r"stream: no placeholder or parameter named 'out'"),
        ({"class": None, "oracle": "true"}, r"oracle: only estimators included with vobench may use the ground truth"),
        ({"limits": "{frame_s: 0}"}, r":7: limits\.frame_s: should be greater than 0 \(got 0\)"),
    ],
)
def test_a_wrong_manifest_is_refused_in_one_line_with_file_line_key_and_value(tmp_path, keys, said):
    with pytest.raises(SuiteError, match=said) as refused:
        read_manifest(plugin(tmp_path, **keys))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["- a list", "name: [", ""])
def test_a_file_that_is_no_mapping_is_refused_by_name(tmp_path, text):
    (tmp_path / "estimator.yaml").write_text(text)
    with pytest.raises(SuiteError, match=r"estimator\.yaml") as refused:
        read_manifest(tmp_path)
    assert "\n" not in str(refused.value)


def test_a_folder_without_a_manifest_is_refused(tmp_path):
    with pytest.raises(SuiteError, match=r"estimator\.yaml: No such file"):
        read_manifest(tmp_path)


@pytest.mark.parametrize("with_init", [False, True])
def test_an_estimator_may_be_several_files(tmp_path, with_init):
    folder = plugin(tmp_path, "from .part import Mine\n")
    (folder / "part.py").write_text(CODE)
    if with_init:
        (folder / "__init__.py").write_text("ORIGIN = 'here'\n")
    assert type(loaded(folder)).__module__ == "vobench_estimators.mine.part"


def test_two_folders_of_one_name_do_not_mix(tmp_path):
    folders = [plugin(tmp_path / side, f"{CODE}    side = '{side}'\n") for side in ("a", "b")]
    assert [loaded(folder).side for folder in (*folders, folders[0])] == ["a", "b", "a"]


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import no_such_library\n", r"ModuleNotFoundError: No module named 'no_such_library': .*estimator\.py:1"),
        ("x = 1 / 0\n", r"ZeroDivisionError: .*estimator\.py:1"),
        ("def f(:\n", r"SyntaxError: .*estimator\.py:1"),
        ("class Other: ...\n", r"has no class 'Mine': .*estimator\.py"),
        ("class Mine:\n    def start(self): ...\n", r"Mine lacks the method process"),
        (CODE + "    def __init__(self): raise ValueError('a\\nb')\n", r"Mine\(\) ValueError: a b: .*estimator\.py:5"),
    ],
)
def test_what_is_wrong_in_a_plugin_is_said_in_one_line(tmp_path, code, said):
    with pytest.raises(VobenchError, match=said) as refused:
        loaded(plugin(tmp_path, code))
    assert "\n" not in str(refused.value)


def test_a_class_in_a_file_that_is_not_there_is_named(tmp_path):
    folder = plugin(tmp_path, **{"class": "elsewhere:Mine"})
    with pytest.raises(VobenchError, match=r"there is no .*elsewhere\.py"):
        loaded(folder)


MANIFESTS = {path.stem: path for path in (ESTIMATORS.parent / "examples" / "manifests").glob("*.yaml")}


@pytest.mark.parametrize("name", MANIFESTS)
def test_the_manifests_of_known_systems_in_the_examples_are_valid(tmp_path, name):
    (tmp_path / "estimator.yaml").write_text(MANIFESTS[name].read_text(encoding="utf-8"))
    manifest = read_manifest(tmp_path)
    assert manifest.name == name
    assert manifest.command or manifest.stream


def test_there_are_those_that_people_ask_for():
    assert set(MANIFESTS) == {"orb_slam3", "openvins", "basalt", "stella_vslam", "libviso2", "dpvo", "cuvslam"}
