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
    """A table with a bold title. Columns of numbers are aligned to the right, all others to the left."""
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
    return rich_table
