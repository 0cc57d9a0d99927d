"""The process of a maker leaves the scene or one line about an error in its working folder, never both."""

import pytest

from vobench.suite.maker_message import decode
from vobench.suite.maker_worker import ERROR_FILE, MAKE, SCENE_FILE, call, main

HEAD = """
from vobench.plugin import Material, Thing, quad

WALL = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
"""
GREY = (
    HEAD
    + """
def make(seed):
    return [Thing("wall", WALL, "paint")], {"paint": Material(colour=(0.1 * seed, 0.0, 0.0))}
"""
)


@pytest.fixture
def maker(tmp_path, monkeypatch):
    """Writes a maker and changes to a working folder of its own."""
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)

    def write(text):
        path = tmp_path / "maker.py"
        path.write_text(text)
        return str(path)

    return write


def test_a_scene_is_left_as_data_that_is_the_scene_of_the_call(maker, tmp_path):
    path = maker(GREY)
    main(path, MAKE, [3])
    made = decode((tmp_path / "work" / SCENE_FILE).read_bytes())
    assert made.materials == call(path, MAKE, [3]).materials
    assert made.materials["paint"].colour[0] == pytest.approx(0.3)
    assert not (tmp_path / "work" / ERROR_FILE).exists()


COUNTING = (
    HEAD
    + """
SEEN = []

def make(seed):
    SEEN.append(seed)
    return [Thing("wall", WALL, "paint")], {"paint": Material(colour=(0.1 * len(SEEN), 0.0, 0.0))}
"""
)


def test_two_calls_do_not_share_what_the_maker_keeps_in_globals(maker):
    path = maker(COUNTING)
    assert call(path, MAKE, [1]).materials == call(path, MAKE, [1]).materials


def test_a_file_that_was_just_edited_is_read_anew(maker):
    red = call(maker(GREY), MAKE, [2]).materials["paint"].colour[0]
    brighter = call(maker(GREY.replace("0.1 * seed", "0.4 * seed")), MAKE, [2]).materials["paint"].colour[0]
    assert brighter == pytest.approx(4 * red)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x = 1\n", "has no function make(seed)"),
        ("def make(seed):\n    return 3\n", "should return things, materials by name"),
        ("def make(seed):\n    return 1 / 0\n", "ZeroDivisionError: division by zero"),
        ("def make(seed):\n    raise ValueError('two\\nlines')\n", "ValueError: two lines"),
        ("def make(\n", "SyntaxError"),
    ],
)
def test_an_error_is_left_as_one_line_and_no_scene(maker, tmp_path, text, sentence):
    main(maker(text), MAKE, [0])
    left = (tmp_path / "work" / ERROR_FILE).read_text()
    assert sentence in left
    assert "\n" not in left
    assert not (tmp_path / "work" / SCENE_FILE).exists()


def test_a_maker_that_wants_to_end_the_process_ends_it(maker):
    """So that the harness sees its exit code, instead of an error that the maker worded."""
    with pytest.raises(SystemExit):
        main(maker("import sys\ndef make(seed):\n    sys.exit(3)\n"), MAKE, [0])
