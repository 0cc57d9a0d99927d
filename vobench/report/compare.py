"""Two runs compared: whether each estimator, and each of its cells, got better or worse, and by how much."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, isnan, log

import numpy as np

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.metric import ranking
from vobench.metric.ranking import ALPHA, difference_p, holm
from vobench.report.cell import Cell
from vobench.report.leaderboard import Board
from vobench.runner.environment import differences

SAME = "same"
BETTER = "better"
WORSE = "worse"
UNDECIDED = "not decided"
FAILS = "fails now"
MENDED = "mended"
NEW = "new"
GONE = "gone"
NOT_MADE = "no sequence"  # the case could not be simulated or imported in one of the runs
REGRESSIONS = (WORSE, FAILS)
MOST_NAMED = 3  # estimators and cases in a message
LEAST_INTERVAL = 1e-9  # a narrower interval comes from trials that are all alike

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


def compare(old: Board, new: Board, *, at_most: float | None = None) -> list[ScoreChange]:
    """The change of every estimator, then of every cell; a ratio above `at_most` is worse, decided or not.

    Raises InputError if the two boards have no cell in common.
    """
    keys = _cell_keys(old, new)
    pairs = _pairs(keys, old, new)
    if not pairs:
        raise InputError(
            "the two runs have no estimator on the same case: "
            f"the old run has {_contents(old)}, the new run has {_contents(new)}"
        )
    p_values = _corrected_p_values(pairs)
    not_made = _cases_not_made(old) | _cases_not_made(new)
    changes = []
    for key in keys:
        if key in pairs:
            changes.append(_cell_change(pairs[key], p_values[key], at_most))
        else:
            case, estimator = key
            change = _unpaired_change(case, estimator, old.cell(case, estimator), new.cell(case, estimator))
            changes.append(replace(change, verdict=NOT_MADE) if case in not_made else change)

    totals = []
    for name in sorted({estimator for _, estimator in pairs}):
        of_estimator = [pair for (_, estimator), pair in pairs.items() if estimator == name]
        totals.append(_total_change(name, of_estimator, at_most))
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


def _cell_change(pair: CellPair, p: float, at_most: float | None) -> ScoreChange:
    old_losses = [loss for loss in pair.old.losses if not isnan(loss)]
    new_losses = [loss for loss in pair.new.losses if not isnan(loss)]
    ratio = None
    if old_losses and new_losses:
        log_ratio = np.mean(np.log(new_losses)) - np.mean(np.log(old_losses))
        ratio = exp(float(log_ratio))
    verdict = _cell_verdict(pair, p, is_beyond_limit=_exceeds(ratio, at_most))

    interval = None
    fewest_trials = min(len(old_losses), len(new_losses))
    if verdict != SAME and fewest_trials >= ranking.MIN_TRIALS:
        interval = _ratio_interval(old_losses, new_losses)
    return ScoreChange(
        pair.old.case,
        pair.old.estimator,
        verdict,
        _summary(pair.old),
        _summary(pair.new),
        ratio,
        interval,
        p,
    )


def _exceeds(ratio: float | None, at_most: float | None) -> bool:
    return bool(ratio and at_most and ratio > at_most)


def _cell_verdict(pair: CellPair, p: float, *, is_beyond_limit: bool) -> str:
    old = pair.old
    new = pair.new
    if pair.is_same:
        return SAME
    if not old.failed and new.failed == new.trials:
        return FAILS
    if old.failed == old.trials and not new.failed:
        return MENDED
    if p < ALPHA:
        old_median = float(np.median(_ranked_losses(old)))
        new_median = float(np.median(_ranked_losses(new)))
        return _direction(is_worse=new_median > old_median)
    return WORSE if is_beyond_limit else UNDECIDED


def _direction(*, is_worse: bool) -> str:
    return WORSE if is_worse else BETTER


def _ratio_interval(old: Sequence[float], new: Sequence[float]) -> tuple[float, float] | None:
    """The bootstrap confidence interval of the ratio of mean losses; trials of both are drawn with replacement."""
    rng = np.random.default_rng(1)
    old_means = _resampled_log_means(old, rng)
    new_means = _resampled_log_means(new, rng)
    tail = ALPHA / 2
    quantiles = np.quantile(new_means - old_means, [tail, 1 - tail])
    low, high = np.exp(quantiles).tolist()
    return (low, high) if high - low > LEAST_INTERVAL else None


def _resampled_log_means(losses: Sequence[float], rng: np.random.Generator) -> Array:
    """The mean logarithms (RESAMPLES,) of losses drawn with replacement."""
    drawn = rng.choice(np.log(losses), (ranking.RESAMPLES, len(losses)))
    means: Array = drawn.mean(1)
    return means


def _total_change(name: str, pairs: Sequence[CellPair], at_most: float | None) -> ScoreChange:
    """The change of an estimator over all cases: the old and the new one are ranked as two estimators of a board."""
    losses, failures = _trial_arrays(pairs)
    first, second = ranking.rank(losses, failures)
    is_worse = second.index == 1
    sign = 1 if is_worse else -1  # the ratios are of the second to the first
    ratio = second.loss_ratio**sign
    verdict = UNDECIDED
    if all(pair.is_same for pair in pairs):
        verdict = SAME
    elif second.decided_above:
        verdict = _direction(is_worse=is_worse)
    elif _exceeds(ratio, at_most):
        verdict = WORSE

    interval = None
    if second.ratio_interval and verdict != SAME:
        low, high = sorted(exp(sign * log(end)) for end in second.ratio_interval)
        interval = low, high
    score_of = {standing.index: f"{1 - standing.loss:.4f}" for standing in (first, second)}
    return ScoreChange("", name, verdict, score_of[0], score_of[1], ratio, interval, second.p_above)


def _trial_arrays(pairs: Sequence[CellPair]) -> tuple[Array, Array]:
    """Losses and failures of the old and the new trials, both (2, cases, repeats), NaN for no trial."""
    most_old = max(pair.old.trials for pair in pairs)
    most_new = max(pair.new.trials for pair in pairs)
    repeats = max(most_old, most_new)
    losses = np.full((2, len(pairs), repeats), np.nan)
    failures = losses.copy()
    for case, pair in enumerate(pairs):
        for run, cell in enumerate((pair.old, pair.new)):
            losses[run, case, : cell.trials] = cell.losses
            failures[run, case, : cell.trials] = cell.failures
    return losses, failures
