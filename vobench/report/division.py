"""Divisions of a board: the estimators and cases that are ranked together."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from vobench.metric.truth_copy import FLOOR_M, FLOOR_RAD
from vobench.report.cell import Cell
from vobench.runner.folder import ORACLE, TRUTH_COPY, TrialScore
from vobench.runner.score import NO_SCALE

BASELINE = "baseline"
UNRANKED = (BASELINE, ORACLE, TRUTH_COPY)  # claims of estimators that are shown beside a ranking, not in it
METRIC = "SE(3)"
MICRO = 1e6  # micrometres in a metre, microradians in a radian


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
    """Whether the estimator of a cell or trial has a rank: a baseline, an oracle or a truth copy has none."""
    return not set(of_estimator.claims) & set(UNRANKED)


def with_truth_copies(trials: Sequence[TrialScore]) -> list[TrialScore]:
    """The same trials, with TRUTH_COPY as a claim of all trials of an estimator that has it in one of them."""
    copies = {trial.estimator for trial in trials if TRUTH_COPY in trial.claims}
    marked = []
    for trial in trials:
        if trial.estimator in copies and TRUTH_COPY not in trial.claims:
            claims = (*trial.claims, TRUTH_COPY)
            marked.append(trial.model_copy(update={"claims": claims}))
        else:
            marked.append(trial)
    return marked


def truth_copy_remarks(trials: Iterable[TrialScore]) -> list[str]:
    """One sentence for each estimator that is not ranked because its estimate equals the truth, with its first case."""
    cases_of: dict[str, list[str]] = {}
    for trial in trials:
        if TRUTH_COPY in trial.claims:
            cases_of.setdefault(trial.estimator, []).append(trial.case)
    sentences = []
    for estimator, cases in sorted(cases_of.items()):
        first = min(cases)
        sentences.append(
            f"{estimator} is not ranked: on {first}, its motion equals the ground truth to rounding "
            f"({FLOOR_M * MICRO:.0f} µm and {FLOOR_RAD * MICRO:.0f} µrad a frame), which cannot be measured"
        )
    return sentences


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
