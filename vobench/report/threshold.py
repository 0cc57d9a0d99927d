"""Thresholds on results, as in `vobench run --fail-if`: 'ate_trans.rmse > 0.2', 'score < 0.9', 'failed > 0'."""

import operator
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from vobench.errors import InputError, unknown_name_sentence
from vobench.metric.definitions import DEFINITIONS
from vobench.report.board_metric import COSTS, METRICS
from vobench.report.division import is_ranked
from vobench.report.leaderboard import Board
from vobench.runner.folder import SURVIVED, TrialScore, with_sequence

STATISTICS = ("rmse", "mean", "median", "std", "min", "max", "p95", "p99")
COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}
FORM = re.compile(r"\s*(\w+)(?:\.(\w+))?\s*(>=|<=|>|<)\s*([-+.\w]+)\s*")
FAILED = "failed"
# The metrics of poses that every run measures; others take `vobench score --full`.
MEASURED = tuple(name for name, metric in DEFINITIONS.items() if metric.measure and not metric.full)


@dataclass(frozen=True, slots=True)
class Threshold:
    """A range that a result must not be in.

    `metric` is a metric of poses with a `statistic`, in its unit; or, with an empty statistic, a metric of the board,
    or `failed`, the number of failed trials of an estimator.
    """

    metric: str
    statistic: str
    comparison: str
    value: float

    def broken_by(self, scores: Sequence[TrialScore], board: Board) -> Iterator[str]:
        """A sentence for each trial, cell or estimator that is beyond the threshold or has no value.

        A trial without a sequence is no result of its estimator, and breaks no threshold. Baselines and oracles count
        only if nothing else was run.
        """
        trials = with_sequence(scores)
        competitors = [trial for trial in trials if is_ranked(trial)]
        counted = competitors or trials
        if self.metric == FAILED:
            yield from self._broken_by_failures(counted)
        elif self.metric in COSTS:
            yield from self._broken_by_costs(counted, board)
        else:
            yield from self._broken_by_trials(counted)

    def _broken_by_trials(self, trials: Sequence[TrialScore]) -> Iterator[str]:
        includes_failures = self.metric in METRICS and METRICS[self.metric].includes_failures
        for trial in trials:
            name = f"{trial.estimator} on {trial.case}"
            value = self._value(trial)
            has_failed = trial.status not in SURVIVED and not includes_failures
            if has_failed or value is None:
                yield f"{name}: {trial.status}, so it has no {self}"
            else:
                yield from self._broken_by_value(name, value)

    def _broken_by_failures(self, trials: Sequence[TrialScore]) -> Iterator[str]:
        failures = Counter(trial.estimator for trial in trials if trial.status not in SURVIVED)
        for estimator in sorted({trial.estimator for trial in trials}):
            yield from self._broken_by_value(estimator, failures[estimator])

    def _broken_by_costs(self, trials: Sequence[TrialScore], board: Board) -> Iterator[str]:
        estimators = {trial.estimator for trial in trials}
        for cell in board.cells:
            if cell.estimator not in estimators:
                continue
            name = f"{cell.estimator} on {cell.case}"
            spread = cell.spread(self.metric)
            if spread is None:
                yield f"{name}: no {self} was measured"
            else:
                yield from self._broken_by_value(name, spread[0])

    def _broken_by_value(self, name: str, value: float) -> Iterator[str]:
        if COMPARISONS[self.comparison](value, self.value):
            yield f"{name}: {self} is {value:.4g}, which is {self.comparison} {self.value:g}"

    def _value(self, trial: TrialScore) -> float | None:
        if self.metric in METRICS:
            return METRICS[self.metric].read(trial)
        return trial.value(self.metric, self.statistic)

    def __str__(self) -> str:
        return f"{self.metric}.{self.statistic}" if self.statistic else self.metric


def parse_threshold(text: str) -> Threshold:
    """The threshold in a text; a metric of poses without a statistic is one on its main statistic.

    Raises InputError or UnknownNameError, also for a metric that a run does not measure.
    """
    match = FORM.fullmatch(text)
    if not match:
        raise InputError(f"should be a metric, a comparison and a number, as in 'ate_trans.rmse > 0.2', got {text!r}")
    metric, stated_statistic, comparison, number = match.groups()
    try:
        limit = float(number)
    except ValueError:
        raise InputError(f"should be compared with a number, got {number!r} in {text!r}") from None
    return Threshold(metric, _statistic(metric, stated_statistic), comparison, limit)


def _statistic(metric: str, stated: str | None) -> str:
    """The statistic of a metric of poses, by default its main one; empty for a metric that has none."""
    of_board = [*METRICS, FAILED]
    if metric in DEFINITIONS and metric not in (*MEASURED, *of_board):
        raise InputError(f"a run does not measure {metric}; it measures {', '.join([*of_board, *MEASURED])}")
    _require_known("metric", metric, [*of_board, *MEASURED])
    if metric in of_board:
        if stated:
            raise InputError(f"{metric} has no statistics; write '{metric}' without '.{stated}'")
        return ""
    statistic = stated or DEFINITIONS[metric].headline
    _require_known("statistic", statistic, STATISTICS)
    return statistic


def _require_known(kind: str, name: str, known: Sequence[str]) -> None:
    if name not in known:
        raise InputError(unknown_name_sentence(kind, name, list(known)))
