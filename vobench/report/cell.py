"""A cell of a board: all trials of one estimator on one case."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, nan
from statistics import fmean, median

from vobench.metric import ranking
from vobench.report.board_metric import METRICS, MM_PER_M, PERCENT, lost_aware
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.runner.consistency import CovarianceConsistency
from vobench.runner.folder import STATUSES, SURVIVED, TrialScore, seen_by, value_of

ONLY_ITS_OWN = "only its own files"


@dataclass(frozen=True, slots=True)
class CaseFacts:
    """What the file of a case states: calibration group, scenario with its severity, and the ground truth's noise."""

    group: str = ""
    scenario: str = ""
    severity: int | None = None
    truth_noise: str = ""


@dataclass(frozen=True, slots=True)
class Cell:
    """All trials of one estimator on one case.

    `values` holds each metric of every trial: infinite if the trial failed, None if it has no such value. `status` and
    `reason` are those of the gravest trial. `consistency`, `revised_…` and `scale_drift_…` are of the trials that
    survived. `saw` states what the estimator could access.
    """

    case: str
    estimator: str
    facts: CaseFacts
    failures: tuple[bool, ...]
    status: str
    reason: str
    values: Mapping[str, tuple[float | None, ...]]
    losses: tuple[float, ...]
    answered: EstimatorStatistics
    claims: tuple[str, ...] = ()
    drift_mm: float | None = None
    scale_gap: float | None = None
    consistency: str = ""
    revised_ate_mm: float | None = None
    revised_segment_percent: float | None = None
    scale_drift_percent_per_m: float | None = None
    saw: str = ""

    @property
    def trials(self) -> int:
        """The number of trials."""
        return len(self.failures)

    @property
    def failed(self) -> int:
        """The number of failed trials."""
        return sum(self.failures)

    def spread(self, metric: str) -> tuple[float, float, float] | None:
        """The median, minimum and maximum of a metric over the trials that have it, None if no trial has."""
        present = [value for value in self.values[metric] if value is not None]
        known = [value for value in present if abs(value) < inf]
        if not known:
            return None
        return median(known), min(known), max(known)


def make_cell(trials: Sequence[TrialScore], answered: EstimatorStatistics, facts: CaseFacts) -> Cell:
    """The cell of the trials of one estimator on one case."""
    survivors = [trial for trial in trials if trial.status in SURVIVED]
    moving = [trial for trial in survivors if trial.drift_m is None]
    gravest = max(trials, key=lambda trial: STATUSES.index(trial.status))
    drifts_mm = [MM_PER_M * trial.drift_m for trial in trials if trial.drift_m is not None]
    saw = {seen_by(trial) or ONLY_ITS_OWN for trial in trials}
    consistency = _median_consistency(survivors)
    return Cell(
        case=gravest.case,
        estimator=gravest.estimator,
        facts=facts,
        failures=tuple(trial.status not in SURVIVED for trial in trials),
        status=gravest.status,
        reason=gravest.reason,
        values=_values(trials, answered),
        losses=tuple(_loss(trial) for trial in trials),
        answered=answered,
        claims=gravest.claims,
        drift_mm=max(drifts_mm, default=None),
        scale_gap=consistency.scale_gap if consistency else None,
        consistency=consistency.sentence if consistency else "",
        revised_ate_mm=_mean(moving, "ate_trans", "rmse", MM_PER_M, is_revised=True),
        revised_segment_percent=_mean(moving, "kitti_t_rel", "mean", PERCENT, is_revised=True),
        scale_drift_percent_per_m=_mean(moving, "scale_drift", "mean", PERCENT),
        saw="; ".join(sorted(saw)),
    )


def _values(trials: Sequence[TrialScore], answered: EstimatorStatistics) -> dict[str, tuple[float | None, ...]]:
    """Each metric of every trial; costs are one value for all trials."""
    values: dict[str, tuple[float | None, ...]] = {}
    for name, metric in METRICS.items():
        values[name] = tuple(metric.value(trial) for trial in trials)
    values["cpu_ms"] = (answered.ms_per_frame or None,)
    values["memory_mib"] = (answered.memory_mib,)
    return values


def _loss(trial: TrialScore) -> float:
    """The loss of a trial, 1 minus its lost-aware score; NaN if it has none."""
    score = lost_aware(trial)
    return nan if score is None else max(1.0 - score, ranking.MIN_LOSS)


def _median_consistency(trials: Sequence[TrialScore]) -> CovarianceConsistency | None:
    """The consistency of the covariances of the median trial, as the errors of one path are correlated."""
    known = [trial.consistency for trial in trials if trial.consistency]
    if not known:
        return None
    return sorted(known, key=lambda consistency: consistency.scale_gap)[len(known) // 2]


def _mean(
    trials: Sequence[TrialScore], metric: str, statistic: str, scale: float, *, is_revised: bool = False
) -> float | None:
    """The mean of a statistic over trials, times `scale`; of the revised estimates if asked for."""
    values = []
    for trial in trials:
        value = value_of(trial.revised if is_revised else trial.score, metric, statistic)
        if value is not None:
            values.append(value)
    return scale * fmean(values) if values else None
