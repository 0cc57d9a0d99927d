"""Two runs compared: whether each estimator, and each cell of it, got better or worse, and by how much."""

from collections.abc import Collection
from dataclasses import dataclass
from math import exp, isnan, log

import numpy as np

from vobench.errors import InputError
from vobench.metric import ranking
from vobench.metric.ranking import ALPHA, difference_p, holm
from vobench.report.leaderboard import Board, Cell
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


@dataclass(frozen=True, slots=True)
class Change:
    """What became of an estimator on a case, or over all of them where `case` is empty.

    `ratio` is of the new loss to the old, within `interval` where there are trials enough to tell; `p` the chance of
    such a difference by luck, corrected for the number of cells.
    """

    case: str
    estimator: str
    verdict: str
    old: str
    new: str
    ratio: float | None = None
    interval: tuple[float, float] | None = None
    p: float | None = None


def compare(old: Board, new: Board, *, at_most: float | None = None) -> list[Change]:
    """The change of every estimator, then of every cell; a ratio beyond `at_most` is worse, decided or not.

    Raises InputError where the two have no cell in common.
    """
    keys = dict.fromkeys((cell.case, cell.estimator) for made in (old, new) for cell in made.cells)
    both = {key: (old.cell(*key), new.cell(*key)) for key in keys}
    common = {key: (a, b) for key, (a, b) in both.items() if a and b}
    if not common:
        told = [f"{', '.join(made.estimators[:3])} on {', '.join(made.cases[:3])}" for made in (old, new)]
        raise InputError(f"no estimator has a case in both runs: {told[0]} in the old one, {told[1]} in the new one")
    not_made = {case for made in (old, new) for group in made.unmade for case in group.cases}
    chances = {key: difference_p(*(_ordered(cell) for cell in cells)) for key, cells in common.items()}
    corrected = dict(zip(chances, holm(list(chances.values())), strict=True))
    cells = [
        _cell_change(*common[key], corrected[key], at_most) if key in common else _alone(key, *both[key], not_made)
        for key in keys
    ]
    names = sorted({estimator for _, estimator in common})
    return [_total(name, [pair for (_, e), pair in common.items() if e == name], at_most) for name in names] + cells


def environment_differences(old: Board, new: Board) -> list[str]:
    """What differs between where two boards come from and can change scores, both values named.

    Empty where nothing does, or where one of the runs does not state it.
    """
    if old.environment is None or new.environment is None:
        return []
    return differences(old.environment, new.environment)


def _ordered(cell: Cell) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Its trials as they are ordered: by loss, a failed one the worst."""
    losses = [0.0 if isnan(loss) else loss for loss in cell.losses]
    ordered = [np.inf if failed else loss for loss, failed in zip(losses, cell.failures, strict=True)]
    return np.array(ordered)


def _said(cell: Cell | None) -> str:
    if cell is None:
        return "–"
    ate = cell.spread("ate")
    lost = f"{cell.failed}/{cell.trials} {cell.status}" if cell.failed else ""
    return ", ".join(filter(None, [f"{ate[0]:.3g} %" if ate else "", lost])) or cell.status


def _alone(key: tuple[str, str], old: Cell | None, new: Cell | None, not_made: Collection[str]) -> Change:
    """The change of a cell that one run lacks; `not_made` are cases that one of the runs could not make."""
    case, _ = key
    verdict = NEW if new else GONE
    if case in not_made:
        verdict = NOT_MADE
    return Change(*key, verdict, _said(old), _said(new))


def _cell_change(old: Cell, new: Cell, p: float, at_most: float | None) -> Change:
    losses = [[loss for loss in cell.losses if not isnan(loss)] for cell in (old, new)]
    ratio = exp(float(np.mean(np.log(losses[1])) - np.mean(np.log(losses[0])))) if all(losses) else None
    is_worse = float(np.median(_ordered(new))) > float(np.median(_ordered(old)))
    if (old.losses, old.failures) == (new.losses, new.failures):
        verdict = SAME
    elif not old.failed and new.failed == new.trials:
        verdict = FAILS
    elif old.failed == old.trials and not new.failed:
        verdict = MENDED
    elif p < ALPHA:
        verdict = WORSE if is_worse else BETTER
    else:
        verdict = WORSE if ratio and at_most and ratio > at_most else UNDECIDED
    told = verdict != SAME and min(map(len, losses)) >= ranking.MIN_TRIALS
    interval = _interval(*losses) if told else None
    return Change(old.case, old.estimator, verdict, _said(old), _said(new), ratio, interval, p)


def _interval(old: list[float], new: list[float]) -> tuple[float, float] | None:
    """The ratio's interval: trials of both drawn again and again."""
    rng = np.random.default_rng(1)
    drawn = [rng.choice(np.log(each), (ranking.RESAMPLES, len(each))).mean(1) for each in (old, new)]
    low, high = np.exp(np.quantile(drawn[1] - drawn[0], [ALPHA / 2, 1 - ALPHA / 2])).tolist()
    return (low, high) if high - low > 1e-9 else None


def _total(name: str, pairs: list[tuple[Cell, Cell]], at_most: float | None) -> Change:
    """One estimator over all cases: the old and the new as if they were two of a board."""
    most = max(cell.trials for pair in pairs for cell in pair)
    loss = np.full((2, len(pairs), most), np.nan)
    failed = loss.copy()
    for case, pair in enumerate(pairs):
        for row, cell in enumerate(pair):
            loss[row, case, : cell.trials] = cell.losses
            failed[row, case, : cell.trials] = cell.failures
    first, second = ranking.rank(loss, failed)
    is_worse = second.index == 1
    scores = {each.index: f"{1 - each.loss:.4f}" for each in (first, second)}
    sign = 1 if is_worse else -1
    ratio = second.loss_ratio**sign
    interval = second.ratio_interval
    ends = sorted(exp(sign * log(end)) for end in interval) if interval else []
    direction = WORSE if is_worse else BETTER
    verdict = direction if second.decided_above else UNDECIDED
    if all((old.losses, old.failures) == (new.losses, new.failures) for old, new in pairs):
        verdict = SAME
    elif verdict == UNDECIDED and at_most and ratio > at_most:
        verdict = WORSE
    within = (ends[0], ends[1]) if ends and verdict != SAME else None
    return Change("", name, verdict, scores[0], scores[1], ratio, within, second.p_above)
