"""Tables and text in Markdown."""

import re
from collections.abc import Sequence

from vobench.errors import printable

# Not by pandas' to_markdown: it needs the package tabulate, and does not escape text.


def markdown_table(rows: Sequence[Sequence[str]], *, words: int) -> list[str]:
    """The lines of a table whose first row is the headings; after `words` columns of text come columns of numbers."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    rule = "|" + "---|" * words + "---:|" * (len(rows[0]) - words)
    return [lines[0], rule, *lines[1:]]


def escaped(text: str) -> str:
    """Text that Markdown shows as it is, in one line."""
    line = printable(text).replace("\n", " ").replace("&", "&amp;").replace("<", "&lt;")
    return re.sub(r"([\\|*~`])", r"\\\1", line)
