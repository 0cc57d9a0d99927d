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
    rows = [_escaped_row(["case", *board.estimators])]
    for case, cells in matrix(board, metric):
        rows.append(_escaped_row([case, *(str(cell) for cell in cells)]))
    lines = [f"## {METRICS[metric].heading}", "", *plain_table(rows, words=1), ""]
    for scope, table in totals(board):
        escaped = [_escaped_row(row) for row in table]
        lines += [f"## Totals: {_escaped(scope)}", "", *plain_table(escaped, words=2), ""]
    for sentence in (*remarks(board), *cell_notes(board)):
        lines.append(f"- {_escaped(sentence)}")
    lines += ["", LEGEND.replace("~", "\\~"), ""]
    for sentence in (board.visible, origin(board)):
        if sentence:
            lines += [_escaped(sentence), ""]
    return "\n".join(lines)


def plain_table(rows: Sequence[Sequence[str]], *, words: int) -> list[str]:
    """The lines of a table whose first row is the headings; after `words` columns of text come columns of numbers."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    rule = "|" + "---|" * words + "---:|" * (len(rows[0]) - words)
    return [lines[0], rule, *lines[1:]]


def _escaped_row(row: Sequence[str]) -> list[str]:
    return [_escaped(text) for text in row]


def _escaped(text: str) -> str:
    """Text that Markdown shows as it is, in one line."""
    line = printable(text).replace("\n", " ").replace("&", "&amp;").replace("<", "&lt;")
    return re.sub(r"([\\|*~`])", r"\\\1", line)
