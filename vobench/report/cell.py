"""A cell of a board: all trials of one estimator on one case."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, nan
from statistics import fmean, median

from vobench.metric import ranking
from vobench.report.board_metric import FAIL_RATIO, METRICS, MM_PER_M, PERCENT, lost_aware
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.runner.consistency import CovarianceConsistency
from vobench.runner.folder import NOT_DETERMINISTIC, STATUSES, SURVIVED, TrialScore, seen_by, value_of

ONLY_ITS_OWN = "only its own files"
LEAST_ERROR_M = 1e-3
LOSS_OF_ERROR = 0.5 / FAIL_RATIO  # the loss of a survivor whose error is this share of the path everywhere


@dataclass(frozen=True, slots=True)
class CaseFacts:
    """Facts from the file of a case: its calibration group, scenario and severity, place and drive, and truth noise.

    `repeat_of` names the case that this one repeats with new noise; it is empty for that case itself.
    `place` and `drive` are empty if they are unknown; a drive is told apart from others by its text.
    `place_seed` is that of a generator's place, and `drive_seed` that of a body that wanders. `lighting` is the name of
    the lighting, and `noise_seed` the seed of noise and of all else that the simulation draws.
    `truth_noise_m` is the standard deviation of the position of the ground truth that scores are computed with.
    """

    group: str = ""
    scenario: str = ""
    severity: int | None = None
    place: str = ""
    drive: str = ""
    place_seed: int | None = None
    drive_seed: int | None = None
    lighting: str = ""
    noise_seed: int | None = None
    repeat_of: str = ""
    truth_noise: str = ""
    truth_noise_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Cell:
    """All trials of one estimator on one case.

    failures: whether each trial failed.
    status, reason, claims, sensors: of the trial with the most severe status.
    values: each metric by name, with a value per trial: infinite if the trial failed, None if it has no such value.
    losses: 1 minus the lost-aware score of each trial; NaN if it has none.
    errors: the position error of each trial as a share of the path; NaN if it failed or has none.
    answered: statistics of the frames of all trials.
    consistency, scale_gap, revised_…, scale_drift_…: from the trials that did not fail.
    saw: which files the estimator could access.
    """

    case: str
    estimator: str
    facts: CaseFacts
    failures: tuple[bool, ...]
    status: str
    reason: str
    values: Mapping[str, tuple[float | None, ...]]
    losses: tuple[float, ...]
    errors: tuple[float, ...]
    answered: EstimatorStatistics
    claims: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
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


def trials_by_cell(
    trials: Iterable[TrialScore], facts: Mapping[str, CaseFacts]
) -> dict[tuple[str, str], list[TrialScore]]:
    """The trials of each cell, by its case and estimator, in order of their names and of the repeats.

    The repeats of a case with new noise are in the cell of the first one. Equal answers of a deterministic estimator to
    one sequence count once.
    """
    groups: dict[tuple[str, str], list[TrialScore]] = {}
    for trial in sorted(trials, key=lambda trial: (trial.repeat, trial.case)):
        case = facts.get(trial.case, CaseFacts()).repeat_of or trial.case
        members = groups.setdefault((case, trial.estimator), [])
        if not any(_is_equal_answer(trial, member) for member in members):
            members.append(trial)
    return dict(sorted(groups.items()))


def _is_equal_answer(one: TrialScore, other: TrialScore) -> bool:
    """Whether two trials of a deterministic estimator are on the same sequence and have the same score."""
    if one.case != other.case or NOT_DETERMINISTIC in one.claims:
        return False
    return (one.status, one.score) == (other.status, other.score)


def make_cell(case: str, trials: Sequence[TrialScore], answered: EstimatorStatistics, facts: CaseFacts) -> Cell:
    """The cell of the trials of one estimator on one case, of which some may be repeats under other names."""
    survivors = [trial for trial in trials if trial.status in SURVIVED]
    moving = [trial for trial in survivors if trial.drift_m is None]
    most_severe = max(trials, key=lambda trial: STATUSES.index(trial.status))
    drifts_mm = [MM_PER_M * trial.drift_m for trial in trials if trial.drift_m is not None]
    saw = {seen_by(trial) or ONLY_ITS_OWN for trial in trials}
    consistency = _median_consistency(survivors)
    return Cell(
        case=case,
        estimator=most_severe.estimator,
        facts=facts,
        failures=tuple(trial.status not in SURVIVED for trial in trials),
        status=most_severe.status,
        reason=most_severe.reason,
        values=_values(trials, answered),
        losses=tuple(_loss(trial, facts) for trial in trials),
        errors=tuple(_error(trial, facts) for trial in trials),
        answered=answered,
        claims=most_severe.claims,
        sensors=most_severe.sensors,
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


def _loss(trial: TrialScore, facts: CaseFacts) -> float:
    """The loss of a trial, 1 minus its lost-aware score; NaN if it has none."""
    score = lost_aware(trial)
    if score is None:
        return nan
    least_loss = LOSS_OF_ERROR * _least_error(trial, facts)
    return min(max(1.0 - score, least_loss, ranking.MIN_LOSS), 1.0)


def _error(trial: TrialScore, facts: CaseFacts) -> float:
    """The position error of a trial as a share of the path; NaN if it failed or has none."""
    percent = METRICS["ate"].value(trial)
    if percent is None or percent == inf:
        return nan
    return max(percent / PERCENT, _least_error(trial, facts))


def _least_error(trial: TrialScore, facts: CaseFacts) -> float:
    """The error as a share of the path below which estimators are alike: a millimetre, or the noise of the truth."""
    if trial.path_m <= 0:
        return 0.0
    return max(LEAST_ERROR_M, facts.truth_noise_m) / trial.path_m


def _median_consistency(trials: Sequence[TrialScore]) -> CovarianceConsistency | None:
    """The covariance consistency of the trial with the median scale gap.

    Trials are not pooled: errors along one path are correlated.
    """
    known = [trial.consistency for trial in trials if trial.consistency]
    if not known:
        return None
    by_gap = sorted(known, key=lambda consistency: consistency.scale_gap)
    return by_gap[len(by_gap) // 2]


def _mean(
    trials: Sequence[TrialScore], metric: str, statistic: str, scale: float, *, is_revised: bool = False
) -> float | None:
    """The mean of a statistic over the trials that have it, times `scale`; None if no trial has it."""
    values = []
    for trial in trials:
        score = trial.revised if is_revised else trial.score
        value = value_of(score, metric, statistic)
        if value is not None:
            values.append(value)
    return scale * fmean(values) if values else None
