"""The parser reads YAML 1.2, finds duplicate keys, and refuses what is beyond a limit at its exact size."""

from pathlib import Path

import pytest

from vobench.errors import FilePlace, SuiteError
from vobench.suite import yaml_parser
from vobench.suite.yaml_parser import MOST_BYTES, MOST_DEPTH, MOST_DIGITS, parse_file, parse_text

FILE = Path("file.yaml")


def test_a_tree_knows_the_lines_of_its_keys():
    tree = parse_text(FILE, "a: 1\nb: [x, {c: 2}]\n").tree
    assert tree == {"a": 1, "b": ["x", {"c": 2}]}
    assert tree.lc.key("b")[0] == 1


def test_yaml_is_of_version_1_2():
    assert parse_text(FILE, "a: 1e-3\nb: no\nc: 0o17\n").tree == {"a": 0.001, "b": "no", "c": 15}


def test_the_first_of_duplicate_keys_counts_and_each_other_is_reported_with_line_and_column():
    parsed = parse_text(FILE, "a: 1\nb: {c: 1, c: 2}\na: 3\n")
    assert parsed.tree == {"a": 1, "b": {"c": 1}}
    inner, outer = parsed.duplicates
    assert inner.places == (FilePlace("file.yaml", 2, 11),)
    assert outer.places == (FilePlace("file.yaml", 3, 1),)
    assert outer.sentence == 'found duplicate key "a" with value "3" (original value: "1")'


def refusal(text: str) -> str:
    with pytest.raises(SuiteError) as refused:
        parse_text(FILE, text)
    return str(refused.value)


@pytest.mark.parametrize("digits", [MOST_DIGITS, MOST_DIGITS + 1])
def test_a_number_has_at_most_so_many_digits(digits):
    text = f"a: {'7' * digits}\n"
    if digits > MOST_DIGITS:
        assert refusal(text) == f"file.yaml:1:4: a number has more than {MOST_DIGITS} characters"
    else:
        assert parse_text(FILE, text).tree["a"] == int("7" * digits)


def test_a_long_text_is_no_long_number():
    assert parse_text(FILE, f"a: '{'7' * 2 * MOST_DIGITS}'\n").tree["a"] == "7" * 2 * MOST_DIGITS


def nested(list_count: int) -> str:
    """A mapping with lists in lists, which is a level more than there are lists."""
    return f"a: {'[' * list_count}{']' * list_count}\n"


def test_a_tree_has_at_most_so_many_levels():
    assert parse_text(FILE, nested(MOST_DEPTH - 1)).tree["a"] is not None
    assert refusal(nested(MOST_DEPTH)) == f"file.yaml:1:{3 + MOST_DEPTH}: is nested more than 100 deep"


def test_a_tree_has_at_most_so_many_values(monkeypatch):
    monkeypatch.setattr(yaml_parser, "MOST_NODES", 20)

    def listed(count: int) -> str:
        return f"a: [{', '.join(['1'] * count)}]\n"

    # The mapping, its key and the list count, too.
    assert len(parse_text(FILE, listed(17)).tree["a"]) == 17
    assert refusal(listed(18)).startswith("file.yaml:1:1: holds more than 20 values")


def test_an_alias_counts_as_what_it_repeats(monkeypatch):
    monkeypatch.setattr(yaml_parser, "MOST_NODES", 20)
    assert parse_text(FILE, "a: &a [1, 2, 3]\nb: [*a, *a]\n").tree["b"] == [[1, 2, 3]] * 2
    assert "including those that aliases repeat" in refusal("a: &a [1, 2, 3]\nb: [*a, *a, *a]\nc: 0\n")


def test_an_alias_may_stand_beside_what_it_repeats_but_not_inside():
    assert parse_text(FILE, "a: &a [1]\nb: *a\n").tree == {"a": [1], "b": [1]}
    assert refusal("a: &a [1, [*a]]\n") == "file.yaml:1:4: an alias is inside what it repeats"


@pytest.mark.parametrize("size", [MOST_BYTES, MOST_BYTES + 1])
def test_a_file_has_at_most_so_many_bytes(tmp_path, size):
    path = tmp_path / "file.yaml"
    path.write_text("a: 1\n#".ljust(size, "x"))
    if size > MOST_BYTES:
        with pytest.raises(SuiteError, match=r"file\.yaml: should be text of at most 2 MiB"):
            parse_file(path)
    else:
        assert parse_file(path).tree == {"a": 1}


def test_every_kind_of_line_end_is_one(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_bytes(b"a: 1\r\nb: 2\rc: 3\n")
    assert parse_file(path).tree == {"a": 1, "b": 2, "c": 3}


def test_a_file_that_cannot_be_read_is_one_sentence(tmp_path):
    with pytest.raises(SuiteError, match=r"^cannot read .*none\.yaml: No such file or directory$"):
        parse_file(tmp_path / "none.yaml")


def test_a_syntax_error_has_its_line_and_column():
    assert refusal("a: 1\nb: [1, 2\n").startswith("file.yaml:3:1: ")
    assert refusal("a: 'x\n").startswith("file.yaml:2:1: ")
