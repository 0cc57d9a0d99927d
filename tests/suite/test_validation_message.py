"""A mistake in a file is said once: what only follows from another mistake is left out."""

from pathlib import Path
from typing import Annotated

import pytest
from annotated_types import Ge, Gt, MinLen
from pydantic import ValidationError

from vobench.errors import SettingError
from vobench.setting import settings
from vobench.suite.validation_message import pydantic_location, validation_mistakes
from vobench.suite.yaml_file import checked, json_schema
from vobench.suite.yaml_parser import parse_text
from vobench.suite.yaml_source import YamlFile


@settings()
class Span:
    """From one time to another."""

    first_s: Annotated[float, Ge(0)] = 0.0
    last_s: float = 1.0

    def __post_init__(self) -> None:
        if self.first_s > self.last_s:
            raise SettingError(f"should be at most last_s (got {self.first_s:g})", "first_s")


@settings()
class Body:
    """A body with two required keys."""

    radius_m: Annotated[float, Gt(0)]
    height_m: Annotated[float, Gt(0)]
    sizes: Annotated[tuple[Annotated[float, Gt(0)], ...], MinLen(2)] = (1.0, 2.0)
    span: Span | None = None


def error_of(text):
    """The error of a file with this text, and the file."""
    path = Path("file.yaml")
    source = YamlFile(path, parse_text(path, text).tree)
    with pytest.raises(ValidationError) as refused:
        checked(Body, source.plain)
    return refused.value, source


def said(text, unread=()):
    """The mistakes of a file with this text, as lines without the name of the file."""
    error, source = error_of(text)
    mistakes = validation_mistakes(source, error, json_schema(Body), unread)
    return [str(mistake).removeprefix("file.yaml:") for mistake in mistakes]


KNOWN = "Known: height_m, radius_m, sizes, span"


def test_a_required_key_that_is_misspelt_is_not_said_to_be_missing_too():
    assert said("radus_m: 1\nheight_m: 2\n") == [f"1: radus_m: unknown key. Did you mean 'radius_m'? {KNOWN}"]


def test_another_required_key_is_still_missing_beside_a_misspelt_one():
    assert said("radus_m: 1\n") == [
        f"1: radus_m: unknown key. Did you mean 'radius_m'? {KNOWN}",
        " height_m: this key is missing",
    ]


def test_a_key_like_no_other_hides_no_missing_key():
    lines = said("xyz: 1\nheight_m: 2\n")
    assert lines[0] == f"1: xyz: unknown key. {KNOWN}"
    assert lines[1].endswith("radius_m: this key is missing")


def test_unknown_keys_come_first():
    lines = said("radius_m: -1\nheight_m: 1\nsizess: [1, 2]\n")
    assert lines == [
        f"3: sizess: unknown key. Did you mean 'sizes'? {KNOWN}",
        "1: radius_m: should be greater than 0 (got -1)",
    ]


def test_a_list_that_is_too_short_is_said_unless_its_entries_are_wrong():
    head = "radius_m: 1\nheight_m: 1\n"
    assert said(f"{head}sizes: [1]\n") == ["3: sizes: should have 2 or more entries, but has 1"]
    assert said(f"{head}sizes: [1, -2]\n") == ["3: sizes.1: should be greater than 0 (got -2)"]
    # An entry that could not be read at all was reported before.
    assert said(f"{head}sizes: [1]\n", unread=[("sizes", 1)]) == []
    assert said(f"{head}sizes: [1]\n", unread=[("span", 1)]) != []


def test_a_value_that_could_not_be_read_is_not_wrong_a_second_time():
    text = "radius_m: x\nheight_m: y\n"
    assert len(said(text)) == 2
    assert said(text, unread=[("radius_m",)]) == ["2: height_m: should be a number (got 'y')"]


def test_a_mistake_is_where_the_settings_say_it_is():
    text = "radius_m: 1\nheight_m: 1\nspan:\n  first_s: 3\n"
    error, _ = error_of(text)
    (entry,) = error.errors()
    assert pydantic_location(entry) == ("span", "first_s")
    assert said(text) == ["4: span.first_s: should be at most last_s (got 3)"]


def test_a_place_of_pydantic_is_that_of_the_file_where_no_setting_says_otherwise():
    error, _ = error_of("radius_m: 1\nheight_m: 1\nsizes: [1, 2, x]\n")
    assert [pydantic_location(entry) for entry in error.errors()] == [("sizes", 2)]
