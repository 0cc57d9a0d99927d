"""Thresholds on scores, as in `vobench run --fail-if`: 'ate_trans.rmse > 0.2', 'coverage < 0.9'."""

import operator
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from vobench.errors import InputError, unknown_name_sentence
from vobench.metric.definitions import DEFINITIONS
from vobench.runner.folder import SURVIVED, TrialScore, with_sequence

DEFAULT_STATISTIC = "rmse"
STATISTICS = (DEFAULT_STATISTIC, "mean", "median", "std", "min", "max")
COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}
FORM = re.compile(r"\s*(\w+)(?:\.(\w+))?\s*(>=|<=|>|<)\s*([-+.\w]+)\s*")
COVERAGE = "coverage"


@dataclass(frozen=True, slots=True)
class Threshold:
    """A range that a statistic of a metric, in the unit of the metric, must not be in."""

    metric: str
    statistic: str
    comparison: str
    value: float

    def broken_by(self, scores: Sequence[TrialScore]) -> Iterator[str]:
        """A sentence for each trial that is beyond the threshold or has no value.

        A trial without a sequence is no result of its estimator, and breaks no threshold.
        """
        is_beyond = COMPARISONS[self.comparison]
        for score in with_sequence(scores):
            trial = f"{score.estimator} on {score.case}"
            value = self._value(score)
            if score.status not in SURVIVED or value is None:
                yield f"{trial}: {score.status}, so it has no {self}"
            elif is_beyond(value, self.value):
                yield f"{trial}: {self.name} is {value:.4g}, which is {self.comparison} {self.value:g}"

    def _value(self, score: TrialScore) -> float | None:
        if self.metric == COVERAGE:
            return score.coverage
        return score.value(self.metric, self.statistic)

    @property
    def name(self) -> str:
        """The metric and its statistic."""
        return self.metric if self.metric == COVERAGE else f"{self.metric}.{self.statistic}"

    def __str__(self) -> str:
        return self.name


def parse_threshold(text: str) -> Threshold:
    """The threshold in a text; without a statistic it is on the RMSE. Raises InputError or UnknownNameError."""
    match = FORM.fullmatch(text)
    if not match:
        raise InputError(f"should be a metric, a comparison and a number, as in 'ate_trans.rmse > 0.2', got {text!r}")
    metric, stated_statistic, comparison, number = match.groups()
    statistic = stated_statistic or DEFAULT_STATISTIC
    _require_known("metric", metric, [COVERAGE, *DEFINITIONS])
    _require_known("statistic", statistic, STATISTICS)
    try:
        limit = float(number)
    except ValueError:
        raise InputError(f"should be compared with a number, got {number!r} in {text!r}") from None
    return Threshold(metric, statistic, comparison, limit)


def _require_known(kind: str, name: str, known: Sequence[str]) -> None:
    if name not in known:
        raise InputError(unknown_name_sentence(kind, name, list(known)))
