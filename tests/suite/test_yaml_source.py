"""A YAML file knows the place of every key, and gathers mistakes in the order of its lines."""

from pathlib import Path

import pytest

from vobench.errors import FilePlace, InputError, Mistake, SuiteError
from vobench.suite.yaml_parser import parse_text
from vobench.suite.yaml_source import Mistakes, YamlFile, line_of, plain_tree, without_empty_keys

TEXT = """name: tiny
scenes: [closet, attic]
rigs:
  down: {pitch_deg: 90}
  up:
    pitch_deg: -90
estimators: one
"""
BASE = """name: base
seed: 7
rigs: {down: {height_m: 0.3}}
"""


def file(text: str = TEXT, name: str = "file.yaml", **more: object) -> YamlFile:
    path = Path(name)
    return YamlFile(path, parse_text(path, text).tree, **more)


@pytest.mark.parametrize(
    ("keys", "line", "key", "value"),
    [
        ((), None, "", None),
        (("name",), 1, "name", "tiny"),
        (("scenes",), 2, "scenes", None),
        (("scenes", 1), 2, "scenes.1", "attic"),
        (("rigs", "down", "pitch_deg"), 4, "rigs.down.pitch_deg", 90),
        (("rigs", "up", "pitch_deg"), 6, "rigs.up.pitch_deg", -90),
        (("rigs", "up", "height_m"), 5, "rigs.up.height_m", None),
        (("rigs", "left", "pitch_deg"), 3, "rigs.left.pitch_deg", None),
        (("nothing",), None, "nothing", None),
        (("scenes", 2), 2, "scenes.2", None),
        (("estimators", 0), 7, "estimators", "one"),
        (("estimators", 0, "name"), 7, "estimators.name", None),
        (("rigs", 0, "pitch_deg"), 3, "rigs.pitch_deg", None),
    ],
)
def test_a_place_is_that_of_the_last_key_that_the_file_has(keys, line, key, value):
    assert file().place(keys) == FilePlace("file.yaml", line, key=key, value=value)


def test_the_file_that_has_more_of_the_keys_is_named():
    over = file(included=file(BASE, "base.yaml"))
    assert over.place(("seed",)) == FilePlace("base.yaml", 2, key="seed", value=7)
    assert over.place(("rigs", "down", "height_m")) == FilePlace("base.yaml", 3, key="rigs.down.height_m", value=0.3)
    assert over.place(("rigs", "down", "pitch_deg")).file == "file.yaml"
    assert over.place(("name",)).file == "file.yaml", "the including file counts where both have the key"
    assert [each.path.name for each in over.files] == ["file.yaml", "base.yaml"]


def test_a_file_goes_over_what_it_includes_and_removes_keys_without_a_value():
    over = file("name: over\nseed:\nrigs: {down: {pitch_deg: 1}}\n", included=file(BASE, "base.yaml"))
    assert over.plain == {"name": "over", "rigs": {"down": {"height_m": 0.3, "pitch_deg": 1}}}
    assert file("seed:\n").plain == {"seed": None}, "without an included file the key stays"


def test_values_that_replace_the_files_have_no_line_of_their_own():
    changed = file()
    changed.parsed["rigs"]["up"] = {"pitch_deg": 3}
    try:
        place = changed.place(("rigs", "up", "pitch_deg"))
    finally:
        parse_text.cache_clear()  # the tree is shared
    assert (place.line, place.value) == (5, 3)


def test_entries_have_their_number_in_the_file():
    partial = file(remaining={"scenes": (1,)})
    assert partial.original_keys(("scenes", 0)) == ("scenes", 1)
    assert partial.original_keys(("scenes", 0, "name")) == ("scenes", 1, "name")
    assert partial.original_keys(("rigs", "down")) == ("rigs", "down")
    assert partial.original_keys(("scenes",)) == ("scenes",)
    assert partial.original_keys(()) == ()


def test_a_mistake_gets_the_place_of_the_keys_in_front_of_its_own():
    inner = Mistake("is wrong", (FilePlace("scene.yaml", 4),))
    (placed,) = file().located_mistakes(SuiteError(inner), "scenes", 1)
    assert [str(place) for place in placed.places] == ["file.yaml:2: scenes.1", "scene.yaml:4"]


def test_without_keys_only_a_mistake_without_a_place_gets_the_file():
    inner = Mistake("is wrong", (FilePlace("scene.yaml", 4),))
    bare, placed = file().located_mistakes(SuiteError("is bare", inner))
    assert [str(place) for place in bare.places] == ["file.yaml"]
    assert placed == inner


def test_mistakes_are_gathered_and_raised_once_each_in_the_order_of_the_lines():
    mistakes = Mistakes(file())
    for keys in (("rigs", "up"), ("name",), ("rigs", "up")):
        with mistakes.at(*keys):
            raise InputError("is wrong")
    with pytest.raises(SuiteError) as raised:
        mistakes.require_none()
    assert [line_of(mistake) for mistake in raised.value.mistakes] == [1, 5]


def test_a_block_without_a_mistake_adds_none_and_other_errors_pass():
    mistakes = Mistakes(file())
    with mistakes.at("name"):
        pass
    mistakes.require_none()
    with pytest.raises(ZeroDivisionError), mistakes.at("name"):
        raise ZeroDivisionError
    assert mistakes.recorded == []


def test_a_mistake_without_a_line_comes_first():
    assert line_of(Mistake("no place")) == 0
    assert line_of(Mistake("no line", (FilePlace("file.yaml"),))) == 0
    assert line_of(Mistake("a line", (FilePlace("file.yaml", 3), FilePlace("other.yaml", 9)))) == 3


def test_a_plain_tree_has_types_of_python_and_no_keys_that_are_no_text():
    tree = plain_tree(parse_text(Path("x"), "a: [1, 2.5, yes, true, null]\n3: 4\nb: !!timestamp 2001-01-01\n").tree)
    assert tree == {"a": [1, 2.5, "yes", True, None], "b": None}
    assert [type(value) for value in tree["a"]] == [int, float, str, bool, type(None)]


def test_keys_without_a_value_go_at_every_level_but_entries_of_lists_stay():
    tree = {"a": None, "b": {"c": None, "d": 0}, "e": [None, {"f": None}], "g": ({"h": None},)}
    assert without_empty_keys(tree) == {"b": {"d": 0}, "e": [None, {}], "g": [{}]}
