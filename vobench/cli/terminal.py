"""Output of commands: JSON and tables on standard output, warnings on standard error."""

import json as json_module
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

from vobench.errors import printable, require_known

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from vobench.suite.catalog import CatalogEntry

REDIRECTED_WIDTH = 200  # the number of characters in a line, if standard output is not a terminal
# The headings of columns that contain text. All other columns contain numbers, which are aligned to the right.
LEFT_ALIGNED = frozenset(
    {
        "case",
        "changed by",
        "check",
        "condition",
        "contributing conditions",
        "estimator",
        "headline",
        "instead",
        "is",
        "kind",
        "metric",
        "name",
        "origin",
        "path",
        "result",
        "sequence",
        "statistic",
        "status",
        "summary",
        "trajectory",
        "tried",
        "unit",
        "with",
        "without",
    }
)


def known(kind: str, name: str, names: Iterable[str]) -> str:
    """Return the name if it is known. Raises UnknownNameError otherwise."""
    require_known(kind, name, names)
    return name


def print_json(content: Any) -> None:
    """Print a value to standard output as one JSON document."""
    print(json_module.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))


def warn(sentence: str) -> None:
    """Print a sentence to standard error, as one line that begins with "vobench: "."""
    print(printable(f"vobench: {sentence}"), file=sys.stderr)


def warn_about_hidden(entries: "Iterable[CatalogEntry]") -> None:
    """Warn about each estimator that hides the built-in estimator of the same name.

    An estimator that is given by its path hides none.
    """
    from vobench.suite.catalog import builtin_root

    for entry in entries:
        if entry.kind != "estimator" or entry.origin == "path":
            continue
        builtin = builtin_root() / "estimators" / entry.name
        if builtin.is_dir() and entry.path.resolve() != builtin.resolve():
            warn(f"{entry.name} is {entry.path}, not the estimator included with vobench")


def console() -> "Console":
    """A console that prints to standard output without markup. Lines have a fixed width if that is not a terminal."""
    from rich.console import Console

    plain = Console(markup=False, highlight=False)
    if plain.is_terminal:
        return plain
    return Console(markup=False, highlight=False, width=REDIRECTED_WIDTH)


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> "Table":
    """A table with a bold title. Text is aligned to the left, and numbers are aligned to the right."""
    from rich import box
    from rich.table import Table

    result = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE, pad_edge=False)
    for heading in headings:
        justify: Literal["left", "right"] = "left" if heading in LEFT_ALIGNED else "right"
        result.add_column(heading, justify=justify, overflow="fold")
    for row in rows:
        result.add_row(*map(printable, row))
    return result
