"""Reads calibration files in YAML, and checks their sections against frozen dataclasses."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen, MultipleOf
from numpy.typing import NDArray
from pydantic import AllowInfNan, PlainValidator, Strict, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import AliasEvent

from vobench.dataset.picture import read_text
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.setting import MESSAGES as SETTING_MESSAGES

MOST_CHARACTERS = 1 << 16  # a typical calibration file has 1000 to 2000 characters
OPENCV_HEAD = re.compile(r"\A%YAML:1\.0[^\n]*")  # OpenCV requires this first line, which YAML forbids
MOST_BRACKETS = 500  # a camera has about 12; the parser's time grows with the square of their nesting depth
LONGEST_SHOWN = 120  # the largest number of characters of a value in a message
ROTATION_TOLERANCE = 1e-3  # for the rounding errors of a printed rotation matrix

Model = TypeVar("Model")


def _rigid_transform(value: Any) -> Array:
    """The transform T (4, 4) from four rows, from 16 numbers, or from a mapping with the key `data`, as in EuRoC.

    Its rotation is projected onto SO(3).
    """
    matrix = value.get("data") if isinstance(value, dict) else value
    try:
        cells = _numbers().validate_python(_flattened(matrix))
    except ValidationError:
        cells = ()
    if len(cells) != 16:
        raise PydanticCustomError("matrix", "should be a 4 x 4 matrix of finite numbers")

    T = np.array(cells, float).reshape(4, 4)
    R = T[:3, :3]
    has_rotation = se3.is_rotation(R, tolerance=ROTATION_TOLERANCE)
    has_last_row = T[3].tolist() == [0, 0, 0, 1]
    if not (has_rotation and has_last_row):
        raise PydanticCustomError("transform", "should be a rigid transform with the last row 0 0 0 1")
    return se3.transform(se3.nearest_rotation(R), T[:3, 3])


def _flattened(matrix: Any) -> list[Any]:
    """The cells of a matrix that is given as a list of rows or as a list of cells; empty for any other value."""
    if not isinstance(matrix, list):
        return []
    cells: list[Any] = []
    for entry in matrix:
        if isinstance(entry, list):
            cells.extend(entry)
        else:
            cells.append(entry)
    return cells


# The types of values in calibration files. They are strict: a text, true or false is not accepted as a number.
Text = Annotated[str, Strict()]
Number = Annotated[float, Strict(), AllowInfNan(False), Gt(-1e300), Lt(1e300)]
AboveZero = Annotated[Number, Gt(0)]
ZeroOrMore = Annotated[Number, Ge(0)]
Numbers = tuple[Number, ...]
Pixels = Annotated[Number, MultipleOf(1), Ge(1), Le(100_000)]
Resolution = Annotated[tuple[Pixels, ...], MinLen(2), MaxLen(2)]  # width, height
RigidTransform = Annotated[NDArray[np.float64], PlainValidator(_rigid_transform)]

_adapter: Callable[[Any], TypeAdapter[Any]] = cache(TypeAdapter)


def _numbers() -> TypeAdapter[Numbers]:
    return _adapter(Numbers)


@dataclass(frozen=True, slots=True)
class CalibrationFile:
    """The keys and values of a calibration file."""

    path: Path
    tree: Mapping[str, Any]

    def has(self, key: str) -> bool:
        """Whether the file has a top-level key with a value other than null."""
        return self.tree.get(key) is not None

    def checked(self, kind: type[Model], section: str = "") -> Model:
        """The file, or one of its sections, as an instance of the dataclass `kind`. Keys that it lacks are ignored.

        Raises InputError with the file, the key, the wrong value and what would be right.
        """
        if section and not self.has(section):
            raise self.missing(section, self.tree)
        keys = self.tree[section] if section else self.tree
        try:
            checked: Model = _adapter(kind).validate_python(keys)
        except ValidationError as error:
            raise self._complaint(error, section) from None
        return checked

    def missing(self, key: str, keys: Mapping[str, Any]) -> InputError:
        """The error about a missing key of a section, which has the given keys."""
        present = _shortened(", ".join(map(str, keys)) or "none")
        return InputError(f"{self.path}: the key {key} is missing; the keys beside it are {present}")

    def _complaint(self, error: ValidationError, section: str) -> InputError:
        """The first of pydantic's errors as one sentence: the file, the key, what would be right and the value seen."""
        first = error.errors(include_url=False)[0]
        key_path = [section, *first["loc"]] if section else first["loc"]
        key = ".".join(map(str, key_path))
        if first["type"] == "missing":
            return self.missing(key, first["input"])

        template = WORDS.get(first["type"], first["msg"])
        wanted = template.format(**first.get("ctx", {}))
        return InputError(f"{self.path}: {key} {wanted}, but is {shown(first['input'])}")


# The complaint for each of pydantic's error types. The fields in braces are filled in from the context of the error.
WORDS = {
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


def read_yaml(path: Path) -> CalibrationFile:
    """Read a YAML 1.2 file. Raises InputError with the line and column, if they are known."""
    text = OPENCV_HEAD.sub("", read_text(path), count=1)
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"a calibration should have at most {MOST_CHARACTERS} characters, not {len(text)}: {path}")
    brackets = text.count("[") + text.count("{")
    if brackets > MOST_BRACKETS:
        raise InputError(f"{path}: a calibration in YAML should have at most {MOST_BRACKETS} brackets, not {brackets}")

    try:
        _refuse_aliases(text, path)
        tree = YAML(typ="safe", pure=True).load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else str(path)
        raise InputError(f"{place}: not valid YAML: {_one_line(error.problem or error)}") from None
    except InputError:
        raise
    except Exception as error:  # the parser raises many types of errors for malformed text
        raise InputError(f"{path}: not valid YAML: {type(error).__name__} {_one_line(error)}") from None

    if not isinstance(tree, dict):
        raise InputError(f"{path}: should be keys with values, but is {shown(tree)}")
    return CalibrationFile(path, tree)


def _refuse_aliases(text: str, path: Path) -> None:
    """Raise InputError for an alias, because a few nested aliases can expand to more than fits into memory."""
    for event in YAML(typ="safe", pure=True).parse(text):
        if isinstance(event, AliasEvent):
            line = event.start_mark.line + 1
            raise InputError(f"{path}:{line}: a calibration may not use a YAML alias (*{event.anchor})")


def _one_line(error: object) -> str:
    """The text of an error as one line, shortened."""
    words = str(error).split()
    return " ".join(words)[:200]


def shown(value: Any) -> str:
    """A value as it is shown in a message, shortened."""
    return "nothing" if value is None else _shortened(repr(value))


def _shortened(text: str) -> str:
    if len(text) <= LONGEST_SHOWN:
        return text
    return f"{text[: LONGEST_SHOWN - 3]}..."
