"""A board in Markdown."""

import re
from collections.abc import Sequence

from vobench.errors import printable
from vobench.report.board_metric import METRICS
from vobench.report.board_table import DEFAULT_METRIC, LEGEND, cell_notes, matrix, origin, remarks, totals
from vobench.report.leaderboard import Board

# Not by pandas' to_markdown: it needs the package tabulate, and escapes nothing.


def markdown(board: Board, metric: str = DEFAULT_METRIC) -> str:
    """The matrix of a metric, the totals, and sentences on both."""
    rows = [["case", *board.estimators]]
    for case, cells in matrix(board, metric):
        rows.append([case, *(str(cell) for cell in cells)])
    lines = [f"## {METRICS[metric].heading}", "", *markdown_table(rows, words=1), ""]
    for scope, table in totals(board):
        lines += [f"## Totals: {_escaped(scope)}", "", *markdown_table(table, words=2), ""]
    for sentence in (*remarks(board), *cell_notes(board)):
        lines.append(f"- {_escaped(sentence)}")
    lines += ["", LEGEND.replace("~", "\\~"), ""]
    for sentence in (board.visible, origin(board)):
        if sentence:
            lines += [_escaped(sentence), ""]
    return "\n".join(lines)


def markdown_table(rows: Sequence[Sequence[str]], *, words: int) -> list[str]:
    """The lines of a table whose first row is the headings; after `words` columns of text come columns of numbers."""
    lines = []
    for row in rows:
        escaped = [_escaped(text) for text in row]
        lines.append(f"| {' | '.join(escaped)} |")
    rule = "|" + "---|" * words + "---:|" * (len(rows[0]) - words)
    return [lines[0], rule, *lines[1:]]


def _escaped(text: str) -> str:
    """Text that Markdown shows as it is, in one line."""
    line = printable(text).replace("\n", " ").replace("&", "&amp;").replace("<", "&lt;")
    return re.sub(r"([\\|*~`])", r"\\\1", line)
