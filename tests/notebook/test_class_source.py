"""An estimator's folder from a class: what the class uses comes along, and what cannot come is said."""

import linecache
import math
import sys
import types

import pytest

from vobench.errors import InputError
from vobench.notebook.class_source import class_module, global_names, snake_case, source_of, write_estimator
from vobench.suite.manifest import read_manifest

CELL = '''
import math
import numpy as np
from collections import deque as queue

STEP_M = 0.01
SIZES = (1, [2.5, "three"], {"four": None})
HANDLE = open

def unused():
    raise AssertionError

def step(n):
    return scaled(n) * STEP_M

def scaled(n: int) -> float:
    return math.sqrt(n * n)

class Base:
    def start(self, rig, params, seed):
        self.frames = queue()

class MyLKTracker(Base):
    """Walks straight on.

    More of it.
    """

    needs = ("mono",)
    params = {"speed": 2}

    def process(self, frame):
        self.frames.append(frame)
        return np.array([step(len(self.frames)), *SIZES[:1]])

print("the cell goes on")
'''


def define(text: str, name: str = "a_cell") -> types.ModuleType:
    """A module whose source is in no file, as a notebook's cell."""
    module = types.ModuleType(name)
    file = f"<{name}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    sys.modules[name] = module
    exec(compile(text, file, "exec"), module.__dict__)
    return module


@pytest.fixture
def cell(capsys):
    yield define(CELL)
    del sys.modules["a_cell"]


def test_the_written_module_runs_by_itself_and_does_what_the_class_does(cell):
    text = class_module(cell.MyLKTracker)
    alone: dict[str, object] = {"__name__": "alone"}
    exec(compile(text, "alone.py", "exec"), alone)
    here, there = cell.MyLKTracker(), alone["MyLKTracker"]()
    for tracker in (here, there):
        tracker.start(None, {}, 0)
    assert there.process("a frame").tolist() == here.process("a frame").tolist() == [0.01, 1]


def test_only_what_is_used_comes_along(cell):
    text = class_module(cell.MyLKTracker)
    assert "unused" not in text
    assert "HANDLE" not in text
    assert "the cell goes on" not in text
    assert text.index("class Base") < text.index("class MyLKTracker")
    assert "from collections import deque as queue" in text


def test_the_manifest_says_what_the_class_says_of_itself(cell, tmp_path):
    folder = write_estimator(cell.MyLKTracker, root=tmp_path)
    manifest = read_manifest(folder)
    assert folder == tmp_path / "my_lk_tracker"
    assert manifest.needs == ("mono",)
    assert manifest.params == {"speed": 2}
    assert manifest.summary == "Walks straight on."
    assert manifest.pose_of == "left_camera"


def test_a_folder_is_written_again_but_never_over_somebody_elses(cell, tmp_path):
    write_estimator(cell.MyLKTracker, root=tmp_path)
    folder = write_estimator(cell.MyLKTracker, root=tmp_path)
    (folder / "estimator.yaml").write_text("name: my_lk_tracker\n")
    with pytest.raises(InputError, match=r"not written from a class: .*my_lk_tracker"):
        write_estimator(cell.MyLKTracker, root=tmp_path)


def test_an_object_that_no_source_makes_is_named(capsys):
    module = define(
        "socket = object()\nclass A:\n    def start(self): ...\n    def process(self): return socket\n", "b"
    )
    with pytest.raises(InputError, match="A uses socket, a object, which cannot be written to a file"):
        class_module(module.A)


def test_a_name_that_is_nowhere_is_named():
    module = define("class A:\n    def process(self): return missing\n", "c")
    with pytest.raises(InputError, match="A uses missing, which is not defined"):
        class_module(module.A)


def test_a_class_without_the_methods_of_an_estimator_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"a method start\(\), but Plain has none"):
        write_estimator(type("Plain", (), {"process": lambda self: None}), root=tmp_path)


def test_a_class_without_source_is_refused():
    with pytest.raises(InputError, match="the source of Bare cannot be found"):
        source_of(type("Bare", (), {}))


def test_local_names_and_attributes_are_no_globals():
    source = "def f(a):\n    b = a.c\n    return [d for d in b if e(d)] + [math.pi]\n"
    assert global_names(source) == ["e", "math"]
    assert math.pi > 3


@pytest.mark.parametrize(
    ("name", "snake"), [("MyLKTracker", "my_lk_tracker"), ("Mine", "mine"), ("VO2Stereo", "vo2_stereo"), ("_A", "a")]
)
def test_names_of_classes_become_names_of_estimators(name, snake):
    assert snake_case(name) == snake
