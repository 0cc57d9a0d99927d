"""The loader of a plugin's class: from this folder and no other, with one sentence for whatever is wrong."""

import sys

import pytest

from vobench.errors import VobenchError
from vobench.estimator.check import InvalidOutputError
from vobench.estimator.worker import NAMESPACE, _tag, load

CLASS = "class Mine:\n    number = {}\n    def start(self, rig, params, seed): ...\n    def process(self, frame): ...\n"


def plugin(folder, source, name="estimator.py"):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(source)
    return folder


def test_a_class_is_loaded_from_its_folder_each_time_anew(tmp_path):
    for number in (1, 2):
        folder = plugin(tmp_path / str(number), CLASS.format(number))
        assert load(folder, "estimator:Mine", name="mine").number == number


def test_modules_beside_the_class_are_imported_from_its_folder_and_forgotten_with_it(tmp_path):
    for number in (1, 2):
        folder = plugin(tmp_path / str(number), f"VALUE = {number}\n", "part.py")
        plugin(folder, f"from .part import VALUE\n{CLASS.format('VALUE')}")
        assert load(folder, "estimator:Mine", name="mine").number == number
    assert f"{NAMESPACE}.mine.part" in sys.modules


def test_a_plugin_whose_name_begins_like_anothers_is_left_alone(tmp_path):
    load(plugin(tmp_path / "long", CLASS.format(1)), "estimator:Mine", name="mine_too")
    load(plugin(tmp_path / "short", CLASS.format(2)), "estimator:Mine", name="mine")
    assert f"{NAMESPACE}.mine_too.estimator" in sys.modules


def test_a_folder_with_an_init_file_is_the_package_it_says(tmp_path):
    folder = plugin(tmp_path, "VALUE = 5\n", "__init__.py")
    plugin(folder, f"from . import VALUE\n{CLASS.format('VALUE')}")
    assert load(folder, "estimator:Mine", name="mine").number == 5


def test_a_class_in_a_module_below_is_found(tmp_path):
    plugin(tmp_path / "inner", CLASS.format(7), "part.py")
    assert load(tmp_path, "inner.part:Mine", name="mine").number == 7


@pytest.mark.parametrize(
    ("source", "class_path", "sentence"),
    [
        (CLASS, "other:Mine", r"estimator 'mine' says class: other:Mine, but there is no .*other\.py"),
        (CLASS, "estimator:Yours", r"estimator 'mine' has no class 'Yours': .*estimator\.py"),
        ("Mine = 3\n", "estimator:Mine", "estimator 'mine' has no class 'Mine'"),
        ("class Mine:\n    def start(self): ...\n", "estimator:Mine", "Mine lacks the method process: "),
        ("class Mine: ...\n", "estimator:Mine", "Mine lacks the method start and process: "),
        ("x = 1\n\nraise ValueError('a\\n  b')\n", "estimator:Mine", r"ValueError: a b: .*estimator\.py:3$"),
        ("def f(:\n", "estimator:Mine", r"SyntaxError: .*estimator\.py:1$"),
        (
            CLASS
            + "    def __init__(self):\n        self.open()\n    def open(self):\n        raise OSError('gone')\n",
            "estimator:Mine",
            r"Mine\(\) OSError: gone: .*estimator\.py:8$",
        ),
    ],
)
def test_what_is_wrong_with_a_plugin_is_one_sentence_with_its_place(tmp_path, source, class_path, sentence):
    plugin(tmp_path, source.replace("{}", "1"))
    with pytest.raises(VobenchError, match=sentence) as raised:
        load(tmp_path, class_path, name="mine")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("error", "tag"),
    [
        (MemoryError(), b"NMEM"),
        (OSError(28, "No space left on device"), b"NMEM"),
        (OSError(2, "No such file"), b"CRSH"),
        (RuntimeError("OpenCV: Insufficient memory (-4)"), b"NMEM"),
        (InvalidOutputError("no pose"), b"WRNG"),
        (VobenchError("needs wheels"), b"FAIL"),
        (KeyError("x"), b"CRSH"),
    ],
)
def test_a_failure_has_the_tag_of_its_kind(error, tag):
    assert _tag(error) == tag
