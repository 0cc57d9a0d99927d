"""The numbers in the rows of a text file, with file and line in every message."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vobench.errors import TrajectoryError
from vobench.geometry.se3 import Array

# Stricter than float(), which also accepts 1_000, nan, infinity and the digits of other scripts.
NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
NUMERIC_LINE = re.compile(r"[0-9eE+\-., \t\r\n]*")  # a line in which only numbers and separators can occur


class Line(NamedTuple):
    """A line of a text file: its number, from 1, and its text."""

    number: int
    text: str


def content_lines(text: str) -> list[Line]:
    """The lines that have content, without byte order mark, comments (#) and surrounding white space."""
    lines = []
    for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        content = line.partition("#")[0].strip()
        if content:
            lines.append(Line(number, content))
    return lines


@dataclass(frozen=True, slots=True)
class TextTable:
    """The numbers in the rows of a text file.

    `file_name` is used in messages.
    `line_numbers` (N) are those of the rows, from 1.
    `first_fields` (N) are the first fields as text, because a stamp can have more digits than a float.
    `values` (N, columns) are the numbers.
    """

    file_name: str
    line_numbers: Sequence[int]
    first_fields: Sequence[str]
    values: Array

    def place(self, row: int) -> str:
        """The file and line of a row, for messages."""
        return f"{self.file_name}:{self.line_numbers[row]}"


def read_table(
    lines: Sequence[Line],
    *,
    name: str,
    columns: Sequence[str],
    separator: str | None = None,
    row: str = "a pose",
) -> TextTable:
    """The numbers in lines of a file, one row per line.

    `name` is the file's name, for messages.
    A line must have one field per column. With a `separator`, additional fields are ignored.
    `row` is the noun for one row in error messages.
    Raises TrajectoryError with file, line and value for a field that is not a finite number.
    """
    texts = [line.text for line in lines]
    values = _read_fast(texts, len(columns), separator)
    if values is None:
        values = _read_checked(lines, name=name, columns=columns, separator=separator, row_noun=row)
    first_fields = [text.split(separator, 1)[0] for text in texts]
    return TextTable(
        file_name=name,
        line_numbers=[line.number for line in lines],
        first_fields=[field.strip() for field in first_fields],
        values=values,
    )


def _read_fast(texts: list[str], column_count: int, separator: str | None) -> Array | None:
    """The numbers (N, columns), read by NumPy in one call; None if a line has another format or a number overflows."""
    if not texts or not all(map(NUMERIC_LINE.fullmatch, texts)):
        return None
    used_columns = range(column_count) if separator else None
    try:
        values = np.loadtxt(texts, comments=None, delimiter=separator, usecols=used_columns, ndmin=2)
    except ValueError:
        return None
    is_valid = values.shape[1] == column_count and np.isfinite(values).all()
    return values if is_valid else None


def _read_checked(
    lines: Sequence[Line],
    *,
    name: str,
    columns: Sequence[str],
    separator: str | None,
    row_noun: str,
) -> Array:
    """The numbers (N, columns), read field by field. Raises TrajectoryError for the first wrong line or field."""
    values = np.empty((len(lines), len(columns)))
    for row, line in enumerate(lines):
        place = f"{name}:{line.number}"
        fields = [field.strip() for field in line.text.split(separator)]
        has_too_few = len(fields) < len(columns)
        has_too_many = len(fields) > len(columns) and not separator
        if has_too_few or has_too_many:
            is_last_of_several = row > 0 and row == len(lines) - 1
            hint = " (the last row: was the file cut off?)" if is_last_of_several else ""
            raise TrajectoryError(
                f"{place}: {row_noun} has {len(columns)} columns ({' '.join(columns)}), "
                f"this line has {len(fields)}{hint}"
            )
        values[row] = [_number(field, column, place) for field, column in zip(fields, columns, strict=False)]
    return values


def _number(field: str, column: str, place: str) -> float:
    """The number in a field. Raises TrajectoryError if it is not finite."""
    if not NUMBER.fullmatch(field):
        raise TrajectoryError(f"{place}: {column} should be a finite number, but is {field!r}")
    value = float(field)
    if not np.isfinite(value):
        raise TrajectoryError(f"{place}: {column} should be a finite number, but {field} overflows")
    return value
