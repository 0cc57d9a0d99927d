"""Breakdown curves: the score of an estimator as a scenario grows more severe, and where it falls too low."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isnan
from statistics import median
from typing import NamedTuple

from vobench.report.cell import Cell

# The lost-aware score of an estimator that survives with half of the error that counts as failed.
BREAKDOWN_SCORE = 0.75


class CurveKey(NamedTuple):
    """What a breakdown curve is of."""

    group: str
    scenario: str
    estimator: str


@dataclass(frozen=True, slots=True)
class BreakdownCurve:
    """The median lost-aware score of an estimator by severity; `breaks_at` is the first severity that is too much."""

    group: str
    scenario: str
    estimator: str
    severities: tuple[int, ...]
    scores: tuple[float, ...]
    breaks_at: int | None

    @property
    def sentence(self) -> str:
        """Whether and where the estimator breaks down, in a sentence."""
        group = f"{self.group}, " if self.group else ""
        scenario = f"{self.scenario}, severity {self.severities[0]} to {self.severities[-1]}"
        breakdown = "does not break down" if self.breaks_at is None else f"breaks down at {self.breaks_at}"
        scores = ", ".join(f"{score:.2f}" for score in self.scores)
        return f"{group}{scenario}: {self.estimator} {breakdown} (scores {scores})"


def scores_by_severity(cells: Iterable[Cell]) -> dict[CurveKey, dict[int, list[float]]]:
    """The lost-aware scores of all trials by severity, for each group, scenario and estimator, in sorted order."""
    scores: dict[CurveKey, dict[int, list[float]]] = {}
    for cell in cells:
        facts = cell.facts
        if not facts.scenario or facts.severity is None:
            continue
        curve_key = CurveKey(facts.group, facts.scenario, cell.estimator)
        severities = scores.setdefault(curve_key, {})
        known = [1.0 - loss for loss in cell.losses if not isnan(loss)]
        severities.setdefault(facts.severity, []).extend(known)

    complete = {}
    for curve_key in sorted(scores):
        by_severity = scores[curve_key]
        complete[curve_key] = {severity: by_severity[severity] for severity in sorted(by_severity)}
    return complete


def breakdown_curves(cells: Iterable[Cell]) -> list[BreakdownCurve]:
    """The curve of each estimator on each scenario of which it has at least two severities."""
    curves = []
    for curve_key, by_severity in scores_by_severity(cells).items():
        severities_with_score = [severity for severity, scores in by_severity.items() if scores]
        medians = [median(by_severity[severity]) for severity in severities_with_score]
        if len(medians) > 1:
            breaks_at = _first_below(severities_with_score, medians)
            curves.append(BreakdownCurve(*curve_key, tuple(severities_with_score), tuple(medians), breaks_at))
    return curves


def _first_below(severities: Iterable[int], scores: Iterable[float]) -> int | None:
    """The first severity with a score below BREAKDOWN_SCORE, None if there is none."""
    for severity, score in zip(severities, scores, strict=True):
        if score < BREAKDOWN_SCORE:
            return severity
    return None
