"""A board as a LaTeX table."""

import re
from collections.abc import Sequence

from vobench.errors import printable
from vobench.report.board_metric import METRICS
from vobench.report.board_table import (
    DEFAULT_METRIC,
    ShownCell,
    matrix,
    named,
    origin,
    rank,
    total_score,
    totals,
)
from vobench.report.leaderboard import Board

# Not by pandas' to_latex: it draws no rule above the totals, and leaves characters such as ° and × to the encoding.

ESCAPED = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "–": "--",
    "×": r"$\times$",
    "°": r"$^\circ$",
    "<": "$<$",
    ">": "$>$",
    "|": "$|$",
    **{letter: f"\\{letter}" for letter in "&%$#_{}"},
}
UNDECIDED = r"$^{\sim}$"  # beside an error that is not significantly worse than the best
COLUMN_LETTERS = 58  # of \footnotesize text fit in one of a paper's two columns (252 pt)
PAGE_LETTERS = 119  # fit in both (516 pt)
READABLE_SHRINKAGE = 1.1  # a table may be this many times as wide as a column, and is shrunk
SEPARATION_LETTERS = 2  # about as wide as the space between two columns of the table
COMMAND = re.compile(r"\\[a-z]+|[\\{}$^]")
MOST_RANGED_COLUMNS = 3  # that fit a page with the range of each cell
SHRUNK_BOX = r"\ifdim\wd0>\linewidth\resizebox{\linewidth}{!}{\usebox0}\else\usebox0\fi"

Row = list[str]


def latex(board: Board, metric: str = DEFAULT_METRIC) -> str:
    """The matrix and the totals as a table with booktabs' rules: the best in bold, numbers right-aligned.

    The columns are the cases or the estimators, whichever are fewer. Their names are rotated if the table would be
    wider than one of a paper's two columns otherwise. A table that is wider even then spans both columns. LaTeX shrinks
    it if it does not fit after all, since the widths here are estimates and papers differ.
    """
    has_ranges = min(len(board.estimators), len(board.cases)) <= MOST_RANGED_COLUMNS
    head, body, foot = _rows(board, metric, has_ranges=has_ranges)
    if len(board.cases) < len(board.estimators):
        head, *body = _transposed([head, *body, *foot])
        foot = []
    columns = len(head) - 1
    upright_letters = _width_letters([head, *body, *foot])
    rotated_letters = _width_letters([*body, *foot])
    spans_page = rotated_letters > READABLE_SHRINKAGE * COLUMN_LETTERS
    width_letters = PAGE_LETTERS if spans_page else COLUMN_LETTERS
    if upright_letters > width_letters:
        head = [head[0], *(rf"\rotatebox{{90}}{{{name}}}" for name in head[1:])]

    environment = "table*" if spans_page else "table"
    lines = [
        r"% Needs \usepackage{booktabs} and \usepackage{graphicx}.",
        rf"\begin{{{environment}}}",
        r"\centering",
        r"\setlength{\belowcaptionskip}{4pt}",
        rf"\caption{{{_caption(board, metric, body, has_ranges=has_ranges)}}}",
        rf"\label{{tab:{_label(board.title)}}}",
        r"\footnotesize\setlength{\tabcolsep}{4pt}",
        r"\sbox0{%",
        r"\begin{tabular}{l" + "r" * columns + "}",
        r"\toprule",
        _line(head),
        r"\midrule",
        *(_line(row) for row in body),
    ]
    if foot:
        lines += [r"\midrule", *(_line(row) for row in foot)]
    lines += [r"\bottomrule", r"\end{tabular}}%", SHRUNK_BOX, rf"\end{{{environment}}}"]
    if board.visible:
        lines.append(f"% {_escaped(board.visible)}")
    if origin(board):
        lines.append(f"% {printable(origin(board))}")
    return "\n".join([*lines, ""])


def _rows(board: Board, metric: str, *, has_ranges: bool) -> tuple[Row, list[Row], list[Row]]:
    """The head, the rows of cases, and the rows of totals, if all cases are of one calibration group."""
    head = ["", *_names(board)]
    body = []
    for case, cells in matrix(board, metric):
        body.append([_escaped(case), *(_cell(cell, has_range=has_ranges) for cell in cells)])
    total_of = {total.estimator: total for total in board.totals}
    ranked = [total_of[name] for name in board.estimators if name in total_of]
    if len(totals(board)) != 1 or len(ranked) < len(board.estimators):
        return head, body, []
    scores = [_escaped(total_score(total)) for total in ranked]
    ranks = [_escaped(rank(total)) for total in ranked]
    return head, body, [["score", *scores], ["rank", *ranks]]


def _names(board: Board) -> Row:
    """The estimators with their claims."""
    claims_of = {cell.estimator: cell.claims for cell in board.cells}
    return [_escaped(named(name, claims_of[name])) for name in board.estimators]


def _width_letters(table: Sequence[Row]) -> int:
    """The approximate width of a table, in letters."""
    width = 0
    for column in _transposed(table):
        widest = max(len(COMMAND.sub("", cell)) for cell in column)
        width += widest + SEPARATION_LETTERS
    return width


def _transposed(table: Sequence[Row]) -> list[Row]:
    return [list(column) for column in zip(*table, strict=True)]


def _caption(board: Board, metric: str, body: Sequence[Row], *, has_ranges: bool) -> str:
    statistics = "median and range" if has_ranges else "median"
    most_trials = max((cell.trials for cell in board.cells), default=1)
    trials = f", {statistics} of its trials" if most_trials > 1 else ""
    heading = _escaped(METRICS[metric].heading)
    is_marked = any(UNDECIDED in cell for row in body for cell in row)
    mark = rf"; {UNDECIDED}: not significantly worse" if is_marked else ""
    return rf"{heading}, by case{trials}. Bold: best{mark}."


def _label(title: str) -> str:
    return re.sub(r"[^A-Za-z0-9-]+", "-", title or "board")


def _line(row: Row) -> str:
    return rf"{' & '.join(row)} \\"


def _cell(shown: ShownCell, *, has_range: bool) -> str:
    text = _escaped(shown.text)
    if "*" in shown.mark:
        text = rf"\textbf{{{text}}}"
    elif shown.failed:
        text = rf"\textit{{{text}}}"
    if "~" in shown.mark:
        text += UNDECIDED
    remark = shown.range if has_range else shown.failures
    if remark:
        text += rf" {{\tiny {_escaped(remark)}}}"
    return text


def _escaped(text: str) -> str:
    """Text that LaTeX shows as it is, in one line; a question mark stands for a character that it may not have."""
    line = printable(text).replace("\n", " ")
    return "".join(_escaped_letter(letter) for letter in line)


def _escaped_letter(letter: str) -> str:
    return ESCAPED.get(letter, letter if letter.isascii() else "?")
