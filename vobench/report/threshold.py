"""Thresholds on scores, as `vobench run --fail-if` takes them: 'ate_trans.rmse > 0.2', 'coverage < 0.9'."""

import operator
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from vobench.errors import InputError, unknown
from vobench.metric.definitions import DEFINITIONS
from vobench.runner.folder import SURVIVED, TrialScore, with_sequence

STATISTICS = ("rmse", "mean", "median", "std", "min", "max")
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
    """What a metric's statistic, in the metric's unit, must not be."""

    metric: str
    statistic: str
    comparison: str
    value: float

    def broken_by(self, scores: Sequence[TrialScore]) -> Iterator[str]:
        """A sentence for each trial that is beyond it or has no value.

        A trial without a sequence says nothing about its estimator, and breaks no threshold.
        """
        for score in with_sequence(scores):
            on = f"{score.estimator} on {score.case}"
            value = score.coverage if self.metric == COVERAGE else score.value(self.metric, self.statistic)
            if score.status not in SURVIVED or value is None:
                yield f"{on}: {score.status}, so it has no {self}"
            elif COMPARISONS[self.comparison](value, self.value):
                yield f"{on}: {self.name} is {value:.4g}, which is {self.comparison} {self.value:g}"

    @property
    def name(self) -> str:
        """The metric and its statistic."""
        return self.metric if self.metric == COVERAGE else f"{self.metric}.{self.statistic}"

    def __str__(self) -> str:
        return self.name


def parse_threshold(text: str) -> Threshold:
    """A threshold of its text; without a statistic it is the RMSE. Raises InputError or UnknownNameError."""
    match = FORM.fullmatch(text)
    if not match:
        raise InputError(f"should be a metric, a comparison and a number, as in 'ate_trans.rmse > 0.2', got {text!r}")
    metric, statistic, comparison, number = match.groups()
    known = (COVERAGE, *DEFINITIONS)
    for kind, name, names in (("metric", metric, known), ("statistic", statistic or "rmse", STATISTICS)):
        if name not in names:
            raise InputError(unknown(kind, name, list(names)))
    try:
        return Threshold(metric, statistic or "rmse", comparison, float(number))
    except ValueError:
        raise InputError(f"should be compared with a number, got {number!r} in {text!r}") from None
