"""Two runs compared: whether each estimator, and each of its cells, got better or worse, and by how much.

An estimator that states that it is deterministic gives the same answer to the same sequence, so every change is one of
the code, and only its size is judged. If the machine changed, too, so may the last digits of pictures and estimates,
and what follows from them. An estimator that is not deterministic is judged by tests on its repeats and cases.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, isnan

import numpy as np
from scipy import stats

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.metric.repeat_test import ALPHA, MIN_TRIALS, difference_p
from vobench.metric.significance import ROUNDING, PairedDifference, holm, paired_difference
from vobench.report.cell import Cell
from vobench.report.leaderboard import Board
from vobench.runner.environment import differences
from vobench.runner.folder import NOT_DETERMINISTIC

SAME = "same"
ALIKE = "alike"  # differs by less than the limit
OTHER_MACHINE = "as another machine may"
BETTER = "better"
WORSE = "worse"
UNDECIDED = "not decided"
FAILS = "fails now"
RECOVERED = "no longer fails"
NEW = "new"
GONE = "gone"
NOT_MADE = "no sequence"  # the case could not be simulated or imported in one of the runs
REGRESSIONS = (WORSE, FAILS)
MOST_NAMED = 3  # estimators and cases in a message
LIMIT = 1.05  # ratio of losses of a deterministic estimator beyond which it is better or worse
MACHINE_LIMIT = 3.0  # the same if the machine changed: processors alone change single cells by up to 2.6 times
MIN_CASES = 4  # for a test over cases

CellKey = tuple[str, str]


@dataclass(frozen=True, slots=True)
class ScoreChange:
    """The change of an estimator on a case, or over all cases if `case` is empty.

    `ratio` is the new loss relative to the old one, with the confidence `interval` if there are enough trials. `p` is
    the probability of such a difference by chance, corrected for the number of cells.
    """

    case: str
    estimator: str
    verdict: str
    old: str
    new: str
    ratio: float | None = None
    interval: tuple[float, float] | None = None
    p: float | None = None


@dataclass(frozen=True, slots=True)
class CellPair:
    """The cells of an estimator on a case in both runs."""

    old: Cell
    new: Cell

    @property
    def is_same(self) -> bool:
        """Whether losses and failures are equal to the last digit."""
        has_same_losses = self.old.losses == self.new.losses
        return has_same_losses and self.old.failures == self.new.failures

    @property
    def is_deterministic(self) -> bool:
        """Whether the estimator states that it is deterministic in both runs, and no repeat refutes it."""
        return NOT_DETERMINISTIC not in (*self.old.claims, *self.new.claims)

    @property
    def log_ratio(self) -> float:
        """The logarithm of the new loss relative to the old one; NaN if one of them has none."""
        old_losses = _known_losses(self.old)
        new_losses = _known_losses(self.new)
        if not old_losses or not new_losses:
            return float("nan")
        return float(np.mean(np.log(new_losses)) - np.mean(np.log(old_losses)))


def _known_losses(cell: Cell) -> list[float]:
    return [loss for loss in cell.losses if not isnan(loss)]


def _is_deterministic(pairs: Sequence[CellPair]) -> bool:
    return all(pair.is_deterministic for pair in pairs)


def compare(old: Board, new: Board, *, at_most: float | None = None) -> list[ScoreChange]:
    """The change of every estimator, then of every cell.

    `at_most` is the ratio of losses that still counts as alike, LIMIT by default. An estimator that is not
    deterministic is worse if its loss is significantly higher, and by more than `at_most` if that is given. Raises
    InputError if the two boards have no cell in common.
    """
    keys = _cell_keys(old, new)
    pairs = _pairs(keys, old, new)
    if not pairs:
        raise InputError(
            "the two runs have no estimator on the same case: "
            f"the old run has {_contents(old)}, the new run has {_contents(new)}"
        )
    is_same_machine = not environment_differences(old, new)
    judge = _Judge(at_most, is_same_machine=is_same_machine)
    random_pairs = {key: pair for key, pair in pairs.items() if not pair.is_deterministic}
    p_values = _corrected_p_values(random_pairs)
    not_made = _cases_not_made(old) | _cases_not_made(new)
    changes = []
    for key in keys:
        if key in pairs:
            changes.append(judge.cell(pairs[key], p_values.get(key)))
        else:
            case, estimator = key
            change = _unpaired_change(case, estimator, old.cell(case, estimator), new.cell(case, estimator))
            changes.append(replace(change, verdict=NOT_MADE) if case in not_made else change)

    pairs_of: dict[str, list[CellPair]] = {}
    for (_, estimator), pair in sorted(pairs.items(), key=lambda item: item[0][1]):
        pairs_of.setdefault(estimator, []).append(pair)
    random_count = sum(not _is_deterministic(of_estimator) for of_estimator in pairs_of.values())
    totals = [judge.total(name, of_estimator, tests=random_count) for name, of_estimator in pairs_of.items()]
    return totals + changes


def environment_differences(old: Board, new: Board) -> list[str]:
    """The differences between the origins of two boards that can change scores, with both values.

    Empty if there are none, or if one of the runs does not state its origin.
    """
    if old.environment is None or new.environment is None:
        return []
    return differences(old.environment, new.environment)


def _cell_keys(old: Board, new: Board) -> list[CellKey]:
    """Case and estimator of every cell of either board."""
    cells = [*old.cells, *new.cells]
    return list(dict.fromkeys((cell.case, cell.estimator) for cell in cells))


def _pairs(keys: Sequence[CellKey], old: Board, new: Board) -> dict[CellKey, CellPair]:
    """The cells that both boards have."""
    pairs = {}
    for case, estimator in keys:
        old_cell = old.cell(case, estimator)
        new_cell = new.cell(case, estimator)
        if old_cell and new_cell:
            pairs[case, estimator] = CellPair(old_cell, new_cell)
    return pairs


def _contents(board: Board) -> str:
    """The first estimators and cases of a board."""
    return f"{', '.join(board.estimators[:MOST_NAMED])} on {', '.join(board.cases[:MOST_NAMED])}"


def _cases_not_made(board: Board) -> set[str]:
    return {case for group in board.unmade for case in group.cases}


def _corrected_p_values(pairs: dict[CellKey, CellPair]) -> dict[CellKey, float]:
    """The probability of each difference by chance, after Holm's correction."""
    p_values = [difference_p(_ranked_losses(pair.old), _ranked_losses(pair.new)) for pair in pairs.values()]
    return dict(zip(pairs, holm(p_values), strict=True))


def _ranked_losses(cell: Cell) -> Array:
    """The losses of trials (N,) as they are ranked: infinite for failures, and 0 where there is no score."""
    losses = np.array(cell.losses)
    losses[np.isnan(losses)] = 0.0
    losses[np.array(cell.failures)] = np.inf
    return losses


def _summary(cell: Cell | None) -> str:
    """The error of a cell, and its failures."""
    if cell is None:
        return "–"
    parts = []
    ate = cell.spread("ate")
    if ate:
        parts.append(f"{ate[0]:.3g} %")
    if cell.failed:
        parts.append(f"{cell.failed}/{cell.trials} {cell.status}")
    return ", ".join(parts) or cell.status


def _unpaired_change(case: str, estimator: str, old: Cell | None, new: Cell | None) -> ScoreChange:
    """The change of a cell that one run lacks."""
    verdict = NEW if new else GONE
    return ScoreChange(case, estimator, verdict, _summary(old), _summary(new))


@dataclass(frozen=True, slots=True)
class _Judge:
    """Gives verdicts on changes, by the largest ratio of losses that still counts as alike."""

    at_most: float | None
    is_same_machine: bool

    def cell(self, pair: CellPair, p: float | None) -> ScoreChange:
        """The change of a cell; `p` is the corrected p-value of its repeats if the estimator is not deterministic."""
        log_ratio = pair.log_ratio
        ratio = None if isnan(log_ratio) else exp(log_ratio)
        verdict = self._of_deterministic_cell(pair, ratio) if p is None else self._of_random_cell(pair, p, ratio)
        return ScoreChange(
            case=pair.old.case,
            estimator=pair.old.estimator,
            verdict=verdict,
            old=_summary(pair.old),
            new=_summary(pair.new),
            ratio=ratio,
            interval=None if verdict == SAME else _repeat_interval(pair),
            p=p,
        )

    def total(self, name: str, pairs: Sequence[CellPair], *, tests: int) -> ScoreChange:
        """The change of an estimator over all cases; `tests` estimators are tested."""
        log_ratios = np.array([pair.log_ratio for pair in pairs])
        over_cases = paired_difference(log_ratios)
        ratio = exp(over_cases.mean) if over_cases.units else None
        p = None
        interval = None
        if all(pair.is_same for pair in pairs):
            verdict = SAME
        elif _is_deterministic(pairs):
            verdict = self._of_ratio(ratio)
        else:
            difference = _difference_on_these_cases(pairs, over_cases)
            p = min(1.0, tests * difference.p) if difference else None
            verdict = self._of_random_total(pairs, p, ratio, tests)
            ends = difference.interval(ALPHA) if difference else None
            interval = (exp(ends[0]), exp(ends[1])) if ends else None
        old_score = _total_score([pair.old for pair in pairs])
        new_score = _total_score([pair.new for pair in pairs])
        return ScoreChange("", name, verdict, old_score, new_score, ratio, interval, p)

    def _of_ratio(self, ratio: float | None) -> str:
        """The verdict on a deterministic estimator, by the ratio of its losses."""
        if ratio is None:
            return ALIKE
        size = max(ratio, 1 / ratio)
        if size <= (self.at_most or LIMIT):
            return ALIKE
        if not self.is_same_machine and size <= MACHINE_LIMIT:
            return OTHER_MACHINE
        return _direction(is_worse=ratio > 1)

    def _of_deterministic_cell(self, pair: CellPair, ratio: float | None) -> str:
        if pair.is_same:
            return SAME
        old_share = pair.old.failed / pair.old.trials
        new_share = pair.new.failed / pair.new.trials
        if old_share < new_share:
            return FAILS
        if old_share > new_share:
            return RECOVERED
        return self._of_ratio(ratio)

    def _of_random_cell(self, pair: CellPair, p: float, ratio: float | None) -> str:
        if pair.is_same:
            return SAME
        if p >= ALPHA:
            return UNDECIDED
        old_median = float(np.median(_ranked_losses(pair.old)))
        new_median = float(np.median(_ranked_losses(pair.new)))
        if new_median == np.inf and old_median < np.inf:
            return FAILS
        return self._of_significant(ratio, is_worse=new_median > old_median)

    def _of_random_total(self, pairs: Sequence[CellPair], p: float | None, ratio: float | None, tests: int) -> str:
        if tests * _failure_p(pairs) < ALPHA:
            return FAILS
        if p is None or ratio is None or p >= ALPHA:
            return UNDECIDED
        return self._of_significant(ratio, is_worse=ratio > 1)

    def _of_significant(self, ratio: float | None, *, is_worse: bool) -> str:
        """The verdict on a significant change, which counts if it is larger than the limit that was given."""
        if self.at_most and ratio and max(ratio, 1 / ratio) <= self.at_most:
            return ALIKE
        return _direction(is_worse=is_worse)


def _direction(*, is_worse: bool) -> str:
    return WORSE if is_worse else BETTER


def _difference_on_these_cases(pairs: Sequence[CellPair], over_cases: PairedDifference) -> PairedDifference | None:
    """The mean difference of log losses and its uncertainty by chance alone; None if there are too few trials.

    With repeats, the variance within each cell tells what chance does. Without, the differences on several cases do.
    """
    if over_cases.units >= MIN_CASES:
        return over_cases
    variances = []
    degrees_of_freedom = 0
    for pair in pairs:
        for cell in (pair.old, pair.new):
            log_losses = np.log(_known_losses(cell))
            if len(log_losses) < MIN_TRIALS:
                return None
            variances.append(float(np.var(log_losses, ddof=1)) / len(log_losses))
            degrees_of_freedom += len(log_losses) - 1
    standard_error = float(np.sqrt(sum(variances))) / len(pairs)
    units = degrees_of_freedom + 1
    return PairedDifference(units, over_cases.mean, standard_error * float(np.sqrt(units)))


def _failure_p(pairs: Sequence[CellPair]) -> float:
    """The p-value of more failed trials in the new run, by Fisher's exact test over all cells."""
    old_failed = sum(pair.old.failed for pair in pairs)
    new_failed = sum(pair.new.failed for pair in pairs)
    old_trials = sum(pair.old.trials for pair in pairs)
    new_trials = sum(pair.new.trials for pair in pairs)
    table = [[new_failed, new_trials - new_failed], [old_failed, old_trials - old_failed]]
    return float(stats.fisher_exact(table, alternative="greater").pvalue)


def _repeat_interval(pair: CellPair) -> tuple[float, float] | None:
    """The confidence interval of the ratio of losses on a case, by its repeats; None with fewer than four of either.

    None, too, if the repeats of both are all alike. Source: Welch (1947).
    """
    old_losses = np.log(_known_losses(pair.old))
    new_losses = np.log(_known_losses(pair.new))
    if min(len(old_losses), len(new_losses)) < MIN_TRIALS:
        return None
    variances = np.array([np.var(losses, ddof=1) / len(losses) for losses in (old_losses, new_losses)])
    if variances.sum() <= ROUNDING**2:
        return None
    difference = float(new_losses.mean() - old_losses.mean())
    degrees_of_freedom = variances.sum() ** 2 / np.sum(variances**2 / [len(old_losses) - 1, len(new_losses) - 1])
    half_width = float(stats.t.isf(ALPHA / 2, degrees_of_freedom) * np.sqrt(variances.sum()))
    return exp(difference - half_width), exp(difference + half_width)


def _total_score(cells: Sequence[Cell]) -> str:
    """The lost-aware score over cells, 1 minus the geometric mean of the losses."""
    log_losses = [float(np.mean(np.log(_known_losses(cell)))) for cell in cells if _known_losses(cell)]
    if not log_losses:
        return "–"
    return f"{1 - exp(float(np.mean(log_losses))):.4f}"
