"""Breakdown curves: the score of an estimator as a scenario grows more severe, and where it falls too low."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isnan
from statistics import median

from vobench.report.cell import Cell

# The lost-aware score of an estimator that survives with half of the error that counts as failed.
BREAKDOWN_SCORE = 0.75


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


def breakdown_curves(cells: Iterable[Cell]) -> list[BreakdownCurve]:
    """The curve of each estimator on each scenario of which it has at least two severities."""
    scores_by_severity: dict[tuple[str, str, str], dict[int, list[float]]] = {}
    for cell in cells:
        facts = cell.facts
        if not facts.scenario or facts.severity is None:
            continue
        curve_key = facts.group, facts.scenario, cell.estimator
        severities = scores_by_severity.setdefault(curve_key, {})
        known = [1.0 - loss for loss in cell.losses if not isnan(loss)]
        severities.setdefault(facts.severity, []).extend(known)

    curves = []
    for (group, scenario, estimator), by_severity in sorted(scores_by_severity.items()):
        severities_with_score = sorted(severity for severity, scores in by_severity.items() if scores)
        medians = [median(by_severity[severity]) for severity in severities_with_score]
        if len(medians) > 1:
            breaks_at = _first_below(severities_with_score, medians)
            severity_axis = tuple(severities_with_score)
            curves.append(BreakdownCurve(group, scenario, estimator, severity_axis, tuple(medians), breaks_at))
    return curves


def _first_below(severities: Iterable[int], scores: Iterable[float]) -> int | None:
    """The first severity with a score below BREAKDOWN_SCORE, None if there is none."""
    for severity, score in zip(severities, scores, strict=True):
        if score < BREAKDOWN_SCORE:
            return severity
    return None
