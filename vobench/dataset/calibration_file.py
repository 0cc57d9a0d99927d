"""Reads calibration files in YAML, and checks their sections against frozen dataclasses."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import AliasEvent

from vobench.dataset.picture import read_text
from vobench.errors import InputError
from vobench.setting import MESSAGES as SETTING_MESSAGES

MOST_CHARACTERS = 1 << 16  # a typical calibration file has 1000 to 2000 characters
OPENCV_HEAD = re.compile(r"\A%YAML:1\.0[^\n]*")  # OpenCV requires this first line, which YAML forbids
MOST_BRACKETS = 500  # a camera has about 12; the parser's time grows with the square of their nesting depth
MOST_VALUE_CHARACTERS = 120  # of a value in a message
MOST_ERROR_CHARACTERS = 200  # of the parser's error in a message

Model = TypeVar("Model")

# The message for each of pydantic's error types. The fields in braces are filled in from the context of the error.
# Some differ from those of settings, because they are followed by the value.
MESSAGES = {
    **SETTING_MESSAGES,
    "float_type": "should be a finite number",
    "finite_number": "should be a finite number",
    "multiple_of": "should be a whole number",
    "greater_than": "should be greater than {gt:g}",
    "greater_than_equal": "should be {ge:g} or more",
    "less_than": "should be less than {lt:g}",
    "less_than_equal": "should be {le:g} or less",
    "too_short": "should have {min_length} or more entries",
    "too_long": "should have {max_length} or fewer entries",
}

_adapter: Callable[[Any], TypeAdapter[Any]] = cache(TypeAdapter)


@dataclass(frozen=True, slots=True)
class CalibrationFile:
    """The keys and values of a calibration file."""

    path: Path
    tree: Mapping[str, Any]

    def has(self, key: str) -> bool:
        """Whether the file has a top-level key with a value other than null."""
        return self.tree.get(key) is not None

    def checked(self, kind: type[Model], section: str = "") -> Model:
        """The file, or one of its sections, as an instance of the dataclass `kind`.

        Keys of the file that the dataclass does not have are ignored.

        Raises InputError with the file, the key, the wrong value and what would be right.
        """
        if section and not self.has(section):
            raise self.missing_key_error(section, self.tree)
        section_values = self.tree[section] if section else self.tree
        try:
            model: Model = _adapter(kind).validate_python(section_values)
        except ValidationError as error:
            raise self._value_error(error, section) from None
        return model

    def missing_key_error(self, key: str, section_values: Mapping[str, Any]) -> InputError:
        """The error about a key that is missing in a section with the given values."""
        present = _shortened(", ".join(map(str, section_values)) or "none")
        return InputError(f"{self.path}: the key {key} is missing; the keys beside it are {present}")

    def _value_error(self, error: ValidationError, section: str) -> InputError:
        """The first of pydantic's errors as one sentence: the file, the key, what would be right and the value seen."""
        first = error.errors(include_url=False)[0]
        key_path = [section, *first["loc"]] if section else first["loc"]
        key = ".".join(map(str, key_path))
        if first["type"] == "missing":
            return self.missing_key_error(key, first["input"])

        template = MESSAGES.get(first["type"])
        requirement = first["msg"]
        if template is not None:
            requirement = template.format(**first.get("ctx", {}))
        return InputError(f"{self.path}: {key} {requirement}, but is {shown(first['input'])}")


def read_yaml(path: Path) -> CalibrationFile:
    """Read a YAML 1.2 file. Raises InputError with the line and column, if they are known."""
    text = OPENCV_HEAD.sub("", read_text(path), count=1)
    _require_small(text, path)
    _require_no_alias(text, path)
    with _parser_errors(path):
        tree = YAML(typ="safe", pure=True).load(text)
    if not isinstance(tree, dict):
        raise InputError(f"{path}: should be keys with values, but is {shown(tree)}")
    return CalibrationFile(path, tree)


def _require_small(text: str, path: Path) -> None:
    """Raise InputError for a text that would take the parser too long."""
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"a calibration should have at most {MOST_CHARACTERS} characters, not {len(text)}: {path}")
    brackets = text.count("[") + text.count("{")
    if brackets > MOST_BRACKETS:
        raise InputError(f"{path}: a calibration in YAML should have at most {MOST_BRACKETS} brackets, not {brackets}")


def _require_no_alias(text: str, path: Path) -> None:
    """Raise InputError for a text with an alias, before the aliases are expanded.

    A few nested aliases can expand to more than fits into memory.
    """
    with _parser_errors(path):
        alias = _first_alias(text)
    if alias is not None:
        line = alias.start_mark.line + 1
        raise InputError(f"{path}:{line}: a calibration may not use a YAML alias (*{alias.anchor})")


@contextmanager
def _parser_errors(path: Path) -> Iterator[None]:
    """Raise InputError with the place in the file for each error of the YAML parser in the block."""
    try:
        yield
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else str(path)
        raise InputError(f"{place}: not valid YAML: {_one_line(error.problem or error)}") from None
    except Exception as error:  # the parser raises many types of errors for malformed text
        raise InputError(f"{path}: not valid YAML: {type(error).__name__} {_one_line(error)}") from None


def _first_alias(text: str) -> AliasEvent | None:
    """The first alias in a YAML text; None if it has none."""
    for event in YAML(typ="safe", pure=True).parse(text):
        if isinstance(event, AliasEvent):
            return event
    return None


def _one_line(error: object) -> str:
    """The text of an error as one line, shortened."""
    words = str(error).split()
    return " ".join(words)[:MOST_ERROR_CHARACTERS]


def shown(value: Any) -> str:
    """A value as it is shown in a message, shortened."""
    return "nothing" if value is None else _shortened(repr(value))


def _shortened(text: str) -> str:
    if len(text) <= MOST_VALUE_CHARACTERS:
        return text
    return f"{text[: MOST_VALUE_CHARACTERS - 3]}..."
