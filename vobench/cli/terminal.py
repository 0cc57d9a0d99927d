"""Output of commands: JSON and tables on standard output, warnings on standard error."""

import json
import os
import re
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

from vobench.errors import printable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

REDIRECTED_WIDTH = 200  # the number of characters in a line, if standard output is not a terminal
COLUMN_GAP = 3  # the number of characters between two columns of a table
TABLE_EDGES = 2  # the number of characters left and right of a table
# The beginning of a number, such as "-0.5", "+3 %", "≥ 2", "×1.3", "[0.9" or ".7"; or a cell without a value.
NUMBER_OR_EMPTY = re.compile(
    r"""
    [-+−±<>≤≥~≈×\[(]* \s* \.? \d  # signs, then a digit
    | [-–—]? $                     # nothing, or a dash
    """,
    re.VERBOSE,
)


def print_json(content: Any) -> None:
    """Print a value to standard output as one JSON document."""
    print(json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))


def warn(sentence: str) -> None:
    """Print a sentence to standard error, as one line that begins with "vobench: "."""
    print(printable(f"vobench: {sentence}"), file=sys.stderr)


def console() -> "Console":
    """A console that prints to standard output without markup.

    If that is not a terminal, lines have the width that the environment variable COLUMNS states, or a fixed one.
    """
    from rich.console import Console

    rich_console = Console(markup=False, highlight=False)
    if not rich_console.is_terminal and not os.environ.get("COLUMNS", "").isdigit():
        rich_console.width = REDIRECTED_WIDTH
    return rich_console


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> "Table":
    """A table with a bold title. Columns of numbers are aligned to the right, all others to the left.

    If it is wider than the console, text and headings are broken between words. A word is broken only if the longest
    words of all columns do not fit.
    """
    from rich import box
    from rich.table import Table

    cells = [list(map(printable, row)) for row in rows]
    rich_table = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE, pad_edge=False)
    for column, heading in enumerate(headings):
        has_numbers = all(NUMBER_OR_EMPTY.match(row[column]) for row in cells)
        justify: Literal["left", "right"] = "right" if has_numbers else "left"
        rich_table.add_column(heading, justify=justify, overflow="fold")
    for row in cells:
        rich_table.add_row(*row)

    widths = _column_widths(headings, cells, available=console().width)
    for rich_column, width in zip(rich_table.columns, widths, strict=True):
        rich_column.width = width
    return rich_table


def _column_widths(
    headings: Sequence[str], cells: Sequence[Sequence[str]], *, available: int
) -> Sequence[int] | Sequence[None]:
    """The widths of the columns of a table, in characters; None if the available width suffices or is hopeless.

    Every column gets the width of its longest word. What remains goes to cells of several words, the narrowest first.
    """
    from rich.cells import cell_len

    natural_widths = list[int]()
    cell_widths = list[int]()
    word_widths = list[int]()
    for heading, *column in zip(headings, *cells, strict=True):
        words = [word for text in (heading, *column) for word in text.split()]
        lines = [line for text in column for line in text.splitlines()]
        word_width = max(map(cell_len, words), default=0)
        cell_width = max(map(cell_len, lines), default=0)
        heading_width = max(map(cell_len, heading.splitlines()), default=0)
        word_widths.append(word_width)
        cell_widths.append(max(cell_width, word_width))
        natural_widths.append(max(cell_width, heading_width))

    unset = [None] * len(headings)
    available -= TABLE_EDGES + COLUMN_GAP * (len(headings) - 1)
    remaining = available - sum(word_widths)
    if sum(natural_widths) <= available or remaining < 0:
        return unset

    widths = word_widths.copy()
    for _ in range(remaining):
        growing = [index for index, width in enumerate(widths) if width < cell_widths[index]]
        if not growing:
            break
        narrowest = min(growing, key=lambda index: widths[index])
        widths[narrowest] += 1
    return widths
