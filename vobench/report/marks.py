"""Marks of the best estimator of each case, and of those that are not decided against it."""

from collections.abc import Sequence
from itertools import groupby
from math import inf

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.repeat_test import MIN_TRIALS, worse_than_best
from vobench.report.board_metric import COSTS, METRICS
from vobench.report.cell import Cell
from vobench.report.leaderboard import Board
from vobench.runner.folder import NOT_APPLICABLE, TRUTH_COPY

BEST = "*"
NOT_DECIDED = "~"


def marks(board: Board, metric: str) -> dict[tuple[str, str], str]:
    """The marks of a metric by case and estimator.

    The best estimator of a case has `*`, also where all others fail. An estimator without any other has no mark. Each
    estimator that is not decided against the best has `~`, and so has the best one then; with fewer than MIN_TRIALS
    trials nothing is tested, and none has it. A failed trial counts as the worst of all. Costs are not marked.
    """
    if metric in COSTS:
        return {}
    marked = {}
    for case, cells in groupby(board.cells, key=lambda cell: cell.case):
        for estimator, mark in _marks_of_case(list(cells), metric).items():
            marked[case, estimator] = mark
    return marked


def _marks_of_case(cells: Sequence[Cell], metric: str) -> dict[str, str]:
    """The marks of the estimators of one case."""
    losses = _losses_by_estimator(cells, metric)
    medians = {}
    for name, values in losses.items():
        middle = np.median(values)
        if middle < inf:
            medians[name] = float(middle)
    is_alone = len(losses) < 2
    if is_alone or not medians:
        return {}

    best = min(medians, key=lambda name: (medians[name], name))
    if len(losses[best]) < MIN_TRIALS:
        return {best: BEST}
    others = [name for name in losses if name != best]
    worse = worse_than_best(losses, best)
    tied = [name for name in others if name not in worse]
    marked = {best: BEST + NOT_DECIDED if tied else BEST}
    for name in tied:
        is_as_good = medians.get(name) == medians[best]
        marked[name] = BEST if is_as_good else NOT_DECIDED
    return marked


def _losses_by_estimator(cells: Sequence[Cell], metric: str) -> dict[str, Array]:
    """The values of trials (N,) by estimator, lower is better.

    Left out are stationary cells, truth copies, cells without a value, and cases without a sensor that the estimator
    needs.
    """
    sign = -1.0 if METRICS[metric].higher_is_better else 1.0
    losses = {}
    for cell in cells:
        values = [sign * value for value in cell.values[metric] if value is not None]
        is_compared = cell.drift_mm is None and TRUTH_COPY not in cell.claims and cell.status != NOT_APPLICABLE
        if values and is_compared:
            losses[cell.estimator] = np.array(values)
    return losses
