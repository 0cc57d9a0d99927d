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
from vobench.runner.folder import NOT_APPLICABLE

NO_VALUE = "–"
DEFAULT_METRIC = "ate"
SIGNIFICANT_DIGITS = 3
MAX_DECIMALS = 5
MIN_SCORE_DECIMALS = 3
MAX_SCORE_DECIMALS = 7
MIN_MAGNITUDE = 1e-9  # smaller numbers have the exponent of this one, because log10(0) is undefined
LEGEND = (
    "* best in its case; ~ not significantly worse than the best in this case (tested only with four or more trials "
    "per cell). Cells with several trials show their median and range. ATE: RMSE of position after SE(3) alignment, or "
    "Sim(3) alignment where marked; the totals show the median over cases. × best: error relative to the first-ranked "
    "estimator, on cases where neither fails, with the 95 % confidence interval for other places and drives of this "
    "kind. Lost: failed trials. Estimators are ordered by the score (1 is perfect), in which a failed trial loses at "
    "least 1/2. The 95 % confidence interval of a rank is in brackets. Decided: whether the difference to the "
    "estimator above is significant, by a t test over places (2 %, Holm). Baselines, oracles and estimates that equal "
    "the ground truth have no rank."
)


# A shorter legend, for terminals.
SHORT_LEGEND = (
    "* best in its case; ~ not significantly worse (tested only with four or more trials per cell). × best: error "
    "relative to the first, on cases where neither fails. ◆ no estimator with a better score is cheaper. "
    "leaderboard.html explains the rest."
)


@dataclass(frozen=True, slots=True)
class ShownCell:
    """A cell as it is printed.

    `text` is the median of the trials, or their status if all of them failed.
    `range` gives the lowest and the highest value, and the number of failed trials. It is empty if all values are equal
    and no trial failed.
    `mark` is `*`, `~` or empty. LEGEND explains the marks.
    `failed` is whether any trial failed, although its recording had all sensors that the estimator needs.
    `failures` is the number of failed trials, in words, if some trials failed and others did not.
    """

    text: str
    range: str = ""
    mark: str = ""
    failed: bool = False
    failures: str = ""

    def __str__(self) -> str:
        spread = f" ({self.range})" if self.range else ""
        return f"{self.text}{self.mark}{spread}"


def matrix(board: Board, metric: str) -> list[tuple[str, list[ShownCell]]]:
    """The rows of the matrix of a metric: the name of each case, and its cells, one per estimator, the best first."""
    marked = marks(board, metric)
    rows = []
    for case in board.cases:
        shown = []
        for estimator in board.estimators:
            cell = board.cell(case, estimator)
            mark = marked.get((case, estimator), "")
            shown_cell = _shown(cell, metric, mark) if cell else ShownCell("")
            shown.append(shown_cell)
        rows.append((case, shown))
    return rows


def _shown(cell: Cell, metric: str, mark: str) -> ShownCell:
    """The text of a cell for a metric. A cell whose trials all failed shows their status, but for costs its value."""
    failures = f"{cell.failed}/{cell.trials} {cell.status}"
    all_failed = cell.failed == cell.trials
    if all_failed and metric not in COSTS:
        if cell.status == NOT_APPLICABLE:
            return ShownCell(cell.status)
        text = cell.status if cell.trials == 1 else failures
        return ShownCell(text, failed=True)

    spread = cell.spread(metric)
    if spread is None:
        return ShownCell(NO_VALUE)

    format_value = _score_text if METRICS[metric].higher_is_better else number
    median, lowest, highest = map(format_value, spread)
    remarks_in_brackets = []
    if lowest != highest:
        remarks_in_brackets.append(f"{lowest}–{highest}")
    if cell.failed:
        remarks_in_brackets.append(failures)
    return ShownCell(
        median,
        ", ".join(remarks_in_brackets),
        mark,
        failed=cell.failed > 0,
        failures=failures if cell.failed else "",
    )


def _score_text(value: float) -> str:
    return f"{value:.4f}"


def number(value: float | None) -> str:
    """A number with three significant digits and at most five decimals; a dash for None."""
    if value is None:
        return NO_VALUE
    if value == 0:
        return "0"
    wanted_decimals = SIGNIFICANT_DIGITS - 1 - _exponent(value)
    decimals = min(max(wanted_decimals, 0), MAX_DECIMALS)
    return f"{value:.{decimals}f}"


def named(estimator: str, claims: Sequence[str]) -> str:
    """The name of an estimator, with the claims of its manifest in brackets."""
    if not claims:
        return estimator
    return f"{estimator} [{', '.join(claims)}]"


def rank(total: Total) -> str:
    """The rank of an estimator, with its confidence interval if that has more than one rank.

    The text is empty if the estimator has no rank.
    """
    if total.rank is None:
        return ""
    low, high = total.ranks or (total.rank, total.rank)
    if low == high:
        return f"{total.rank}"
    return f"{total.rank} ({low}–{high})"


def total_score(total: Total) -> str:
    """The score of an estimator, with enough decimals for two significant digits of its loss."""
    loss = 1 - total.score
    wanted_decimals = 1 - _exponent(loss)
    decimals = min(max(wanted_decimals, MIN_SCORE_DECIMALS), MAX_SCORE_DECIMALS)
    return f"{total.score:.{decimals}f}"


def _exponent(value: float) -> int:
    """The decimal exponent of a number, such as -2 for 0.05."""
    magnitude = max(abs(value), MIN_MAGNITUDE)
    return floor(log10(magnitude))


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
    machine = f" ({total.machine})" if total.machine and total.cpu_ms is not None else ""
    return f"{number(total.cpu_ms)}{machine}{mark}"


def _memory(total: Total) -> str:
    return number(total.memory_mib)


COST = "CPU ms/frame"
MEMORY = "MiB"
DECIDED = "decided"
# The columns of the totals: the heading of each column, and the function that returns the text of its cells.
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
    """The tables of totals, one per division: its title, and its rows, of which the first has the headings.

    The columns of costs are omitted if no cost is known. The column of decisions is omitted if nothing is tested.
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
    """The name of a division, if it has one, and the numbers of cases, drives and places that its totals cover."""
    counts = [
        counted(total.cases, "case"),
        counted(total.drives, "drive"),
        counted(total.places, "place"),
    ]
    words = [group, *counts] if group else counts
    return ", ".join(words)


def _total_row(total: Total, headings: Sequence[str]) -> list[str]:
    return [COLUMNS[heading](total) for heading in headings]


def board_notes(board: Board) -> list[str]:
    """All sentences that follow the tables of a board, the most important first."""
    unbroken = [curve.sentence for curve in board.curves if curve.breaks_at is None]
    return [*remarks(board), *cell_notes(board), *unbroken]


def remarks(board: Board) -> list[str]:
    """Sentences about the totals, in this order.

    1. which cases the totals cover,
    2. at which severity estimators break down,
    3. which neighbours have an undecided order, and how many more places would decide it.
    """
    breaking = [curve.sentence for curve in board.curves if curve.breaks_at is not None]
    undecided = []
    for above, total in zip(board.totals, board.totals[1:], strict=False):
        if total.decided_above is False and total.smallest_ratio is not None:
            undecided.append(_undecided(above, total))
    return [*board.remarks, *breaking, *undecided]


def _undecided(above: Total, total: Total) -> str:
    """The sentence about two neighbours whose order is not decided.

    It states the ratio of losses that the test would have detected, and the number of further places that are needed to
    detect CHOSEN_RATIO.
    """
    order = f"The order of {above.estimator} and {total.estimator} is not decided (p = {total.p_above:.2g})"
    detectable = f"a ratio of losses of {number(total.smallest_ratio)} would have been"
    more_places = (total.places_needed or 0) - total.places
    if more_places <= 0:
        return f"{order}; {detectable}"
    return f"{order}; {detectable}, and {CHOSEN_RATIO:g} takes about {counted(more_places, 'more place')}"


def cell_notes(board: Board) -> list[str]:
    """The notes on all cells, each of them once.

    If the board has several cases, each note begins with the first case that it is about, and the number of the others.
    """
    cases_by_note = dict[str, list[str]]()
    for cell in board.cells:
        for note in notes(cell):
            cases_by_note.setdefault(note, []).append(cell.case)
    if len(board.cases) == 1:
        return list(cases_by_note)

    sentences = []
    for note, cases in cases_by_note.items():
        others = f" and {len(cases) - 1} more" if len(cases) > 1 else ""
        sentences.append(f"{cases[0]}{others}: {note}")
    return sentences


def origin(board: Board) -> str:
    """One line with the processor, driver and versions of the run; empty if they are unknown."""
    if not board.environment:
        return ""
    line = board.environment.line()
    return f"Made on {line}" if line else ""
