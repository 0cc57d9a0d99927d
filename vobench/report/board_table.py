"""The tables of a board as plain text: the matrix of a metric, the totals, and remarks on both."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import floor, log10

from vobench.errors import counted
from vobench.report.board_metric import COSTS, METRICS
from vobench.report.cell import Cell
from vobench.report.cell_notes import notes
from vobench.report.leaderboard import Board
from vobench.report.marks import marks
from vobench.report.total import CHOSEN_RATIO, Total

NO_VALUE = "–"
DEFAULT_METRIC = "ate"
SIGNIFICANT_DIGITS = 3
MOST_DECIMALS = 5
LEAST_SCORE_DECIMALS = 3
MOST_SCORE_DECIMALS = 7
LEAST_MAGNITUDE = 1e-9  # smaller numbers are printed like this one, as log10(0) does not exist
LEGEND = (
    "* best of its case; ~ not decided against the best on this very case, which takes at least four trials per cell. "
    "With several trials: median and range. ATE: RMSE of position after SE(3) alignment, or Sim(3) alignment where "
    "marked; the median over cases. × best: error relative to the first-ranked estimator where both survive, with its "
    "95 % interval for other places and drives of this kind. Lost: failed trials. Estimators are ordered by the score "
    "(1 is perfect), in which a failed trial loses at least 1/2. Ranks in brackets: their 95 % interval. Decided: "
    "against the estimator above, by a t test over places (2 %, Holm). Baselines, oracles and estimates that equal the "
    "truth have no rank."
)


# The same for a terminal.
SHORT_LEGEND = (
    "* best of its case; ~ not decided against it. × best: error relative to the first, where both survive. "
    "◆ nothing better is cheaper. leaderboard.html explains the rest."
)


@dataclass(frozen=True, slots=True)
class ShownCell:
    """The text of a cell.

    text: the median of its trials, or the status if all of them failed. range: lowest and highest value, and how many
    trials failed. mark: `*` or `~`, see LEGEND.
    """

    text: str
    range: str = ""
    mark: str = ""
    failed: bool = False

    def __str__(self) -> str:
        spread = f" ({self.range})" if self.range else ""
        return f"{self.text}{self.mark}{spread}"


def matrix(board: Board, metric: str) -> list[tuple[str, list[ShownCell]]]:
    """Each case with its cells, one per estimator; the best estimator comes first."""
    marked = marks(board, metric)
    rows = []
    for case in board.cases:
        shown = []
        for estimator in board.estimators:
            cell = board.cell(case, estimator)
            mark = marked.get((case, estimator), "")
            shown.append(_shown(cell, metric, mark) if cell else ShownCell(""))
        rows.append((case, shown))
    return rows


def _shown(cell: Cell, metric: str, mark: str) -> ShownCell:
    failures = f"{cell.failed}/{cell.trials} {cell.status}"
    all_failed = cell.failed == cell.trials
    if all_failed and metric not in COSTS:
        text = cell.status if cell.trials == 1 else failures
        return ShownCell(text, failed=True)

    spread = cell.spread(metric)
    if spread is None:
        return ShownCell(NO_VALUE)

    format_value = _score_text if METRICS[metric].higher_is_better else number
    median, lowest, highest = (format_value(value) for value in spread)
    remarks_in_brackets = []
    if lowest != highest:
        remarks_in_brackets.append(f"{lowest}–{highest}")
    if cell.failed:
        remarks_in_brackets.append(failures)
    return ShownCell(median, ", ".join(remarks_in_brackets), mark, failed=cell.failed > 0)


def _score_text(value: float) -> str:
    return f"{value:.4f}"


def number(value: float | None) -> str:
    """A number with three significant digits and at most five decimals."""
    if value is None:
        return NO_VALUE
    if value == 0:
        return "0"
    decimals = min(max(SIGNIFICANT_DIGITS - 1 - _exponent(value), 0), MOST_DECIMALS)
    return f"{value:.{decimals}f}"


def named(estimator: str, claims: Sequence[str]) -> str:
    """The name of an estimator, with the claims of its manifest in brackets."""
    return f"{estimator} [{', '.join(claims)}]" if claims else estimator


def rank(total: Total) -> str:
    """The rank of an estimator, with its interval if there is one wider than one rank; empty if it has no rank."""
    if total.rank is None:
        return ""
    low, high = total.ranks or (total.rank, total.rank)
    return f"{total.rank}" if low == high else f"{total.rank} ({low}–{high})"


def total_score(total: Total) -> str:
    """The score of an estimator, with as many decimals as its loss needs for two digits."""
    loss = 1 - total.score
    decimals = min(max(1 - _exponent(loss), LEAST_SCORE_DECIMALS), MOST_SCORE_DECIMALS)
    return f"{total.score:.{decimals}f}"


def _exponent(value: float) -> int:
    """The decimal exponent of a number's magnitude, -2 of 0.05."""
    return floor(log10(max(abs(value), LEAST_MAGNITUDE)))


def _name(total: Total) -> str:
    return named(total.estimator, total.claims)


def _error_ratio(total: Total) -> str:
    if total.error_interval is None:
        return number(total.error_ratio)
    low, high = total.error_interval
    return f"{number(total.error_ratio)} [{number(low)}, {number(high)}]"


def _decided(total: Total) -> str:
    if total.decided_above is None:
        return NO_VALUE
    return "yes" if total.decided_above else "no"


def _lost(total: Total) -> str:
    return f"{total.failed} of {total.trials}"


def _ate(total: Total) -> str:
    return number(total.ate_percent)


def _cpu(total: Total) -> str:
    mark = " ◆" if total.is_efficient else ""
    return f"{number(total.cpu_ms)}{mark}"


def _memory(total: Total) -> str:
    return number(total.memory_mib)


COST = "CPU ms/frame"
MEMORY = "MiB"
DECIDED = "decided"
# The columns of the totals: the heading of each, and the text of its cells.
COLUMNS: dict[str, Callable[[Total], str]] = {
    "#": rank,
    "estimator": _name,
    "ATE %": _ate,
    "× best": _error_ratio,
    "lost": _lost,
    DECIDED: _decided,
    "score": total_score,
    COST: _cpu,
    MEMORY: _memory,
}
HEADINGS = tuple(COLUMNS)


def totals(board: Board) -> list[tuple[str, list[list[str]]]]:
    """The title of each division, with a row of headings and the rows of its estimators.

    The columns of costs are left out if no cost is known, and that of decisions if nothing is tested.
    """
    headings = _headings_of_totals(board.totals)
    totals_by_group: dict[str, list[Total]] = {}
    for total in board.totals:
        totals_by_group.setdefault(total.group, []).append(total)

    tables = []
    for group, members in totals_by_group.items():
        rows = [_total_row(total, headings) for total in members]
        tables.append((_division_title(group, members[0]), [headings, *rows]))
    return tables


def _headings_of_totals(totals: Sequence[Total]) -> list[str]:
    """The headings of the columns in which at least one total has a value."""
    omitted = set[str]()
    if all(total.cpu_ms is None for total in totals):
        omitted |= {COST, MEMORY}
    if all(total.decided_above is None for total in totals):
        omitted.add(DECIDED)
    return [heading for heading in HEADINGS if heading not in omitted]


def _division_title(group: str, total: Total) -> str:
    """The name of a division, if it has one, and how many cases, drives and places its totals are over."""
    counts = [counted(total.cases, "case"), counted(total.drives, "drive"), counted(total.places, "place")]
    return ", ".join([group, *counts] if group else counts)


def _total_row(total: Total, headings: Sequence[str]) -> list[str]:
    return [COLUMNS[heading](total) for heading in headings]


def board_notes(board: Board) -> list[str]:
    """All sentences below the tables of a board, the most important first."""
    unbroken = [curve.sentence for curve in board.curves if curve.breaks_at is None]
    return [*remarks(board), *cell_notes(board), *unbroken]


def remarks(board: Board) -> list[str]:
    """Sentences on the totals: what they cover, who breaks down where, and how undecided orders could be decided."""
    breaking = [curve.sentence for curve in board.curves if curve.breaks_at is not None]
    undecided = []
    for above, total in zip(board.totals, board.totals[1:], strict=False):
        if total.decided_above is False and total.smallest_ratio is not None:
            undecided.append(_undecided(above, total))
    return [*board.remarks, *breaking, *undecided]


def _undecided(above: Total, total: Total) -> str:
    """A sentence on two undecided neighbours: the ratio that would have been decided, and what a chosen one takes."""
    order = f"The order of {above.estimator} and {total.estimator} is not decided (p = {total.p_above:.2g})"
    found = f"a ratio of losses of {number(total.smallest_ratio)} would have been"
    more = (total.places_needed or 0) - total.places
    if more <= 0:
        return f"{order}; {found}"
    return f"{order}; {found}, and {CHOSEN_RATIO:g} takes about {counted(more, 'more place')}"


def cell_notes(board: Board) -> list[str]:
    """The notes on all cells without duplicates; each names its first case if the board has several cases."""
    cases_of = dict[str, list[str]]()
    for cell in board.cells:
        for note in notes(cell):
            cases_of.setdefault(note, []).append(cell.case)
    if len(board.cases) == 1:
        return list(cases_of)

    sentences = []
    for note, cases in cases_of.items():
        others = f" and {len(cases) - 1} more" if len(cases) > 1 else ""
        sentences.append(f"{cases[0]}{others}: {note}")
    return sentences


def origin(board: Board) -> str:
    """The processor, driver and versions of the run in one line; empty if they are unknown."""
    line = board.environment.line() if board.environment else ""
    return f"Made on {line}" if line else ""
