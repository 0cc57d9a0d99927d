"""A board in Markdown."""

from collections.abc import Sequence

from vobench.report.board_metric import METRICS
from vobench.report.board_table import DEFAULT_METRIC, LEGEND, board_notes, matrix, origin, totals
from vobench.report.leaderboard import Board
from vobench.report.markdown_table import escaped, markdown_table


def markdown(board: Board, metric: str = DEFAULT_METRIC) -> str:
    """The matrix of a metric, the totals of each calibration group, and remarks, as Markdown."""
    rows = [_escaped_row(["case", *board.estimators])]
    for case, cells in matrix(board, metric):
        rows.append(_escaped_row([case, *map(str, cells)]))
    lines = [f"## {METRICS[metric].heading}", "", *markdown_table(rows, words=1), ""]

    for scope, table in totals(board):
        rows = [_escaped_row(row) for row in table]
        lines += [f"## Totals: {escaped(scope)}", "", *markdown_table(rows, words=2), ""]

    lines += [f"- {escaped(sentence)}" for sentence in board_notes(board)]
    lines += ["", LEGEND.replace("~", "\\~"), ""]
    for sentence in (board.visible, origin(board)):
        if sentence:
            lines += [escaped(sentence), ""]
    return "\n".join(lines)


def _escaped_row(row: Sequence[str]) -> list[str]:
    return [escaped(text) for text in row]
