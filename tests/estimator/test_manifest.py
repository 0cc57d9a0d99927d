"""Manifests: what is read, what is refused in one line, and what loading makes of them."""

import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import ValidationError

from vobench.errors import SuiteError, VobenchError
from vobench.estimator.load import load
from vobench.estimator.manifest import read_manifest

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


def loaded(folder):
    return load(folder, read_manifest(folder))


@pytest.mark.parametrize("folder", sorted(p for p in ESTIMATORS.iterdir() if p.is_dir()), ids=lambda p: p.name)
def test_every_estimator_of_the_house_is_read_and_loads_under_its_folder_name(folder):
    manifest = read_manifest(folder)
    assert manifest.name == folder.name
    assert type(load(folder, manifest)).__name__ == manifest.class_name


def test_a_manifest_says_what_it_says(tmp_path):
    manifest = read_manifest(plugin(tmp_path, params="{window_px: 21}", paper="Somebody 1999"))
    assert (manifest.name, manifest.version, manifest.pose_of) == ("mine", "1", "body")
    assert (manifest.module_name, manifest.class_name) == ("estimator", "Mine")
    assert (manifest.needs, manifest.params, manifest.paper) == (("stereo",), {"window_px": 21}, "Somebody 1999")


def test_a_manifest_does_not_change(tmp_path):
    manifest = read_manifest(plugin(tmp_path))
    with pytest.raises(ValidationError, match="frozen"):
        manifest.name = "other"


def test_reading_a_manifest_imports_neither_opencv_nor_the_code():
    script = (
        "import sys; from pathlib import Path; from vobench.estimator.manifest import read_manifest;"
        "read_manifest(Path(sys.argv[1]));"
        "print('cv2' in sys.modules, any('vobench_estimators' in m for m in sys.modules))"
    )
    command = [sys.executable, "-c", script, str(ESTIMATORS / "lk_epipolar")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ESTIMATORS.parent)
    assert done.stdout.split() == ["False", "False"]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"name": "My-Own"}, r"name is 'My-Own', expected lower-case letters"),
        ({"version": "1.0"}, r"version is 1\.0, expected a quoted string"),
        ({"class_": "Mine", "class": None}, r"class is 'Mine', expected file:class such as"),
        ({"needs": "[lidar]"}, r"needs\.0 is 'lidar', expected a list of stereo, encoders"),
        ({"pose_of": "head"}, r"pose_of is 'head', expected left_camera or body"),
        ({"summary": None}, r"key 'summary' is missing, expected one sentence"),
        ({"parms": "{}"}, r"no key 'parms' in a manifest\. Did you mean 'params'\? Known: name"),
        ({"params": "7"}, r"params is 7, expected a mapping"),
    ],
)
def test_a_wrong_manifest_is_refused_in_one_line_with_file_key_value_and_remedy(tmp_path, keys, said):
    folder = plugin(tmp_path, **keys)
    with pytest.raises(SuiteError, match=said) as refused:
        read_manifest(folder)
    assert str(refused.value).endswith(str(folder / "estimator.yaml"))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [("- a list", "a manifest is a mapping of name"), ("name: [", "not YAML"), ("", "got None")],
)
def test_a_file_that_is_no_mapping_is_refused(tmp_path, text, said):
    (tmp_path / "estimator.yaml").write_text(text)
    with pytest.raises(SuiteError, match=said) as refused:
        read_manifest(tmp_path)
    assert "\n" not in str(refused.value)


def test_a_folder_without_a_manifest_is_refused(tmp_path):
    with pytest.raises(SuiteError, match=r"No such file.*estimator\.yaml"):
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
