"""Divisions of a board: the estimators and cases that are ranked together."""

from collections.abc import Sequence
from dataclasses import dataclass

from vobench.report.cell import Cell
from vobench.runner.folder import ORACLE, TrialScore
from vobench.runner.score import NO_SCALE

BASELINE = "baseline"
UNRANKED = (BASELINE, ORACLE)  # claims of estimators that are shown beside a ranking, not in it
METRIC = "SE(3)"


@dataclass(frozen=True, slots=True, order=True)
class Division:
    """What estimators and cases have in common that are ranked together: calibration, sensors and alignment.

    A trajectory that is aligned with a scale has one error less, and an estimator that reads wheels or an IMU knows
    more than one that only sees.
    """

    calibration: str
    sensors: str
    alignment: str

    def label(self, others: Sequence["Division"]) -> str:
        """The division in words: what distinguishes it from the other divisions of the board."""
        parts = []
        if len({other.sensors for other in others}) > 1:
            parts.append(self.sensors or "no sensors")
        if len({other.alignment for other in others}) > 1:
            parts.append(self.alignment)
        if len({other.calibration for other in others}) > 1:
            parts.append(f"calibration {self.calibration or 'none'}")
        return ", ".join(parts)


def is_ranked(of_estimator: Cell | TrialScore) -> bool:
    """Whether the estimator of a cell or trial has a rank: a baseline or an oracle has none."""
    return not set(of_estimator.claims) & set(UNRANKED)


def divisions(cells: Sequence[Cell]) -> dict[Division, list[Cell]]:
    """The cells of each division in the order of their names, with those of the unranked estimators beside each.

    A calibration with unranked estimators only is a division of its own, without sensors.
    """
    groups: dict[Division, list[Cell]] = {}
    for cell in cells:
        if is_ranked(cell):
            groups.setdefault(_division(cell), []).append(cell)

    for calibration in sorted({cell.facts.group for cell in cells}):
        beside = [cell for cell in cells if cell.facts.group == calibration and not is_ranked(cell)]
        members = [division for division in groups if division.calibration == calibration]
        if beside and not members:
            groups[Division(calibration, "", METRIC)] = beside
        for division in members:
            groups[division] += beside
    return dict(sorted(groups.items()))


def _division(cell: Cell) -> Division:
    sensors = " + ".join(cell.sensors)
    alignment = NO_SCALE if NO_SCALE in cell.claims else METRIC
    return Division(cell.facts.group, sensors, alignment)
