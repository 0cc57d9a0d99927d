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

REDIRECTED_WIDTH = 200  # columns, where standard output is not a terminal
# Headings of columns of words; all other columns hold numbers.
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
    """The name, if it is known. Raises UnknownNameError if it is not."""
    require_known(kind, name, names)
    return name


def print_json(content: Any) -> None:
    """Print one JSON object to standard output."""
    print(json_module.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))


def warn(sentence: str) -> None:
    """Print a line to standard error."""
    print(printable(f"vobench: {sentence}"), file=sys.stderr)


def warn_about_hidden(entries: "Iterable[CatalogEntry]") -> None:
    """Warn about each estimator that replaces a built-in one of the same name; one given by its path replaces none."""
    from vobench.suite.catalog import builtin_root

    for entry in entries:
        if entry.kind != "estimator" or entry.origin == "path":
            continue
        builtin = builtin_root() / "estimators" / entry.name
        if builtin.is_dir() and entry.path.resolve() != builtin.resolve():
            warn(f"{entry.name} is {entry.path}, not the estimator included with vobench")


def console() -> "Console":
    """Standard output without markup. If it is not a terminal, lines have a fixed width."""
    from rich.console import Console

    plain = Console(markup=False, highlight=False)
    if plain.is_terminal:
        return plain
    return Console(markup=False, highlight=False, width=REDIRECTED_WIDTH)


def table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> "Table":
    """A table with a bold title; words are aligned to the left, numbers to the right."""
    from rich import box
    from rich.table import Table

    result = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE, pad_edge=False)
    for heading in headings:
        justify: Literal["left", "right"] = "left" if heading in LEFT_ALIGNED else "right"
        result.add_column(heading, justify=justify, overflow="fold")
    for row in rows:
        result.add_row(*map(printable, row))
    return result
