"""The metrics that a board shows: the heading of each, and how it is read from the score of a trial."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from vobench.metric import ranking
from vobench.metric.lost_aware import lost_aware_score
from vobench.runner.folder import SURVIVED, TrialScore

FAIL_RATIO = 0.1  # of the path length; the error that counts as failed, for scores without a lost-aware score
LEAST_PATH_M = 1e-9
PERCENT = 100.0
MM_PER_M = 1e3

ReadTrial = Callable[[TrialScore], float | None]


@dataclass(frozen=True, slots=True)
class BoardMetric:
    """A metric that a board shows: its heading, and how it is read from the score of a trial."""

    heading: str
    read: ReadTrial
    higher_is_better: bool = False
    includes_failures: bool = False  # failed trials have a value, too

    def value(self, trial: TrialScore) -> float | None:
        """The value of a trial, infinite if the trial failed and None if it has no such value."""
        if trial.status in SURVIVED or self.includes_failures:
            return self.read(trial)
        is_stationary = trial.drift_m is not None
        return None if is_stationary else inf


def _statistic(metric: str, statistic: str, scale: float) -> ReadTrial:
    """A function that reads a statistic of a metric, times `scale`, from the score of a trial that moves."""

    def read(trial: TrialScore) -> float | None:
        if trial.drift_m is not None:
            return None
        value = trial.value(metric, statistic)
        return None if value is None else scale * value

    return read


def _ate_percent(trial: TrialScore) -> float | None:
    """The RMSE of position in percent of the path length."""
    ate_m = _statistic("ate_trans", "rmse", 1.0)(trial)
    if ate_m is None or trial.path_m <= 0:
        return None
    return PERCENT * ate_m / trial.path_m


def lost_aware(trial: TrialScore) -> float | None:
    """The lost-aware score of a trial, below 1/2 if it failed; None if the ground truth is stationary."""
    if trial.drift_m is not None:
        return None

    survived = trial.status in SURVIVED
    trial_score = trial.score or {}
    failure = trial_score.get("failure") or {}
    score = failure.get("lost_aware")
    if score is None:
        score = _lost_aware_from_ate(trial, survived=survived)
    return 1.0 - ranking.trial_loss(score, survived=survived)


def _lost_aware_from_ate(trial: TrialScore, *, survived: bool) -> float | None:
    """The lost-aware score of a trial of whose errors only the position RMSE is known."""
    ate_m = trial.value("ate_trans", "rmse")
    if ate_m is None:
        return None
    limit_m = FAIL_RATIO * max(trial.path_m, LEAST_PATH_M)
    return lost_aware_score(np.array([ate_m]), trial.coverage, survived=survived, fail_m=limit_m)


def _coverage(trial: TrialScore) -> float | None:
    return trial.coverage


def _not_in_score(_: TrialScore) -> float | None:
    """No value: costs are measured per frame, and are not part of a score."""
    return None


METRICS: dict[str, BoardMetric] = {
    "ate": BoardMetric("ATE % of path", _ate_percent),
    "ate_mm": BoardMetric("ATE mm", _statistic("ate_trans", "rmse", MM_PER_M)),
    "segments": BoardMetric("segments %", _statistic("kitti_t_rel", "mean", PERCENT)),
    "rpe_mm": BoardMetric("RPE mm/frame", _statistic("rpe_trans", "rmse", MM_PER_M)),
    "rpe_deg": BoardMetric("RPE °/frame", _statistic("rpe_rot", "rmse", 1.0)),
    "score": BoardMetric("lost-aware score", lost_aware, higher_is_better=True, includes_failures=True),
    "coverage": BoardMetric("coverage", _coverage, higher_is_better=True, includes_failures=True),
    "cpu_ms": BoardMetric("CPU ms/frame", _not_in_score, includes_failures=True),
    "memory_mib": BoardMetric("MiB", _not_in_score, includes_failures=True),
}
COSTS = ("cpu_ms", "memory_mib")
