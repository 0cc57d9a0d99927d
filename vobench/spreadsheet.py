"""The cells of CSV files, which people open in spreadsheets.

A spreadsheet executes a text that begins like a formula, such as `=cmd|...`. In all CSV files of vobench, an apostrophe
precedes such a text, so that it is shown as it is.
"""

from typing import Any

from vobench.errors import printable

FORMULA_BEGINNINGS = ("=", "+", "-", "@", "|")
APOSTROPHE = "'"


def cell(value: Any) -> Any:
    """A value as a cell of a CSV file: text is printable and no formula, and other values are not changed."""
    if not isinstance(value, str):
        return value
    text = value if value.isprintable() else printable(value)
    return f"{APOSTROPHE}{text}" if _is_formula(text) else text


def value_in(cell: str) -> str:
    """The text in a cell of a CSV file that was written with `cell`."""
    text = cell.removeprefix(APOSTROPHE)
    return text if _is_formula(text) else cell


def _is_formula(text: str) -> bool:
    """Whether a spreadsheet takes a text for a formula. A negative number is none."""
    return text.lstrip().startswith(FORMULA_BEGINNINGS) and not _is_number(text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
