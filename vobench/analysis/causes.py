"""Attributes the error of an estimator to the conditions of its frames by regression, and finds divergences."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array

SEGMENT_FRAMES = 5
MIN_SEGMENTS = 8  # fewer do not suffice for a regression
MIN_LOSS = 1e-4  # smaller errors count as this one: differences below it say nothing about causes
MIN_RELATIVE_SPREAD = 1e-6  # a condition that varies less, relative to its largest value, is constant
COLLINEAR = 0.9  # conditions with this absolute correlation cannot be told apart
RIDGE = 0.02  # times the number of segments, on standardised conditions: a few more segments without any effect
RESAMPLES = 400
INTERVAL_PERCENT = (2.5, 97.5)
USUAL_RANGE_PERCENT = (5.0, 95.0)  # from a low to a high value of a condition

# A trial diverges where the error of a frame exceeds this multiple of the trial's median, within these limits.
DIVERGENCE_FACTOR = 8.0
MAX_DIVERGENCE_LOSS = 0.5


@dataclass(frozen=True, slots=True)
class ErrorSeries:
    """The errors of a trial: the error (N,) since the previous frame, and the conditions (N,) of frames by name.

    The error of the first frame is 0.
    """

    case: str
    repeat: int
    conditions: Mapping[str, Array]
    loss: Array

    @property
    def first_divergence(self) -> int | None:
        """The first frame whose error is far above the trial's median, or that has no pose; None if there is none."""
        median = np.median(self.loss[1:])
        threshold = np.clip(DIVERGENCE_FACTOR * median, MIN_LOSS, MAX_DIVERGENCE_LOSS)
        outliers = np.flatnonzero(self.loss > threshold)
        return int(outliers[0]) if len(outliers) else None


@dataclass(frozen=True, slots=True)
class Cause:
    """One or several collinear conditions, and the factor by which they multiply the error.

    The factor compares the 95th with the 5th percentile of the condition over all segments. `low` and `high` are its
    95 % confidence interval.
    """

    conditions: tuple[str, ...]
    factor: float
    low: float
    high: float

    @property
    def is_sure(self) -> bool:
        """Whether the confidence interval excludes 1, which stands for no effect."""
        return self.low > 1 or self.high < 1


@dataclass(frozen=True, slots=True)
class Segment:
    """Several successive frames of a trial, their mean error, and the factors of its causes, the largest first."""

    case: str
    repeat: int
    first: int
    end: int
    loss: float
    factors: tuple[tuple[Cause, float], ...]


@dataclass(frozen=True, slots=True)
class Attribution:
    """The causes of an estimator's errors, the strongest first.

    `segments` have the largest error first. `cases` are the mean factors of each case. `constant` are conditions that
    do not vary. `explained` is the share of the variance of the error's logarithm that the regression explains.
    """

    causes: tuple[Cause, ...]
    segments: tuple[Segment, ...]
    cases: Mapping[str, tuple[tuple[Cause, float], ...]]
    constant: tuple[str, ...]
    explained: float


@dataclass(frozen=True, slots=True)
class _Window:
    """The frames of one segment: the trial, its index among all trials, and the first frame."""

    trial: ErrorSeries
    trial_number: int
    first: int

    @property
    def end(self) -> int:
        return min(self.first + SEGMENT_FRAMES, len(self.trial.loss))

    def mean(self, values: Array) -> float:
        """The mean over the segment of values (N,) of all frames."""
        return float(values[self.first : self.end].mean())

    def mean_loss(self) -> float:
        return self.mean(self.trial.loss)

    def mean_conditions(self, names: Sequence[str]) -> list[float]:
        return [self.mean(self.trial.conditions[name]) for name in names]


def attribute(courses: Sequence[ErrorSeries]) -> Attribution | None:
    """Regress the logarithm of the error on all conditions that vary; return None if there are too few segments.

    Conditions whose correlation is COLLINEAR or more are merged. The confidence intervals come from resampling the
    segments of each trial: they cover other frames of the same scenes, not other scenes.
    """
    windows = list(_windows(courses))
    if len(windows) < MIN_SEGMENTS:
        return None

    names = tuple(courses[0].conditions)
    levels = np.sqrt(_mean_conditions(windows, names))  # (M, C)
    largest = np.maximum(levels.max(0), MIN_RELATIVE_SPREAD)
    varies = levels.std(0) > MIN_RELATIVE_SPREAD * largest
    if not varies.any():
        return None
    varying = [names[index] for index in np.flatnonzero(varies)]
    constant = [names[index] for index in np.flatnonzero(~varies)]

    losses = np.array([window.mean_loss() for window in windows])  # (M,)
    log_losses = np.log(np.maximum(losses, MIN_LOSS))
    groups, predictors = _merge_collinear(varying, levels[:, varies])  # (M, K)
    slopes = _ridge_slopes(predictors, log_losses)  # (K,)

    resampled_slopes = _resampled_slopes(windows, predictors, log_losses)  # (RESAMPLES, K)
    ranges = _usual_ranges(predictors)
    causes = []
    for k, group in enumerate(groups):
        interval = np.percentile(resampled_slopes[:, k] * ranges[k], INTERVAL_PERCENT)
        effect = slopes[k] * ranges[k]
        factor, low, high = np.exp([effect, *interval]).tolist()
        causes.append(Cause(group, factor, low, high))

    contributions = (predictors - np.median(predictors, axis=0)) * slopes  # (M, K), to the logarithm of the error
    predicted = (predictors - predictors.mean(0)) @ slopes
    residual = log_losses - log_losses.mean() - predicted
    return Attribution(
        causes=tuple(sorted(causes, key=_strength, reverse=True)),
        segments=_segments(windows, losses, causes, contributions),
        cases=_factors_by_case(windows, causes, contributions),
        constant=tuple(constant),
        explained=float(1 - residual.var() / max(log_losses.var(), 1e-12)),
    )


def _windows(courses: Sequence[ErrorSeries]) -> Iterator[_Window]:
    """Yield all segments of all trials. The first frame is in no segment, because it has no error."""
    for number, course in enumerate(courses):
        for first in range(1, len(course.loss), SEGMENT_FRAMES):
            yield _Window(course, number, first)


def _mean_conditions(windows: Sequence[_Window], names: Sequence[str]) -> Array:
    """The mean of each condition over each segment (M, C)."""
    return np.array([window.mean_conditions(names) for window in windows])


def _usual_ranges(predictors: Array) -> Array:
    """The range (K,) of each predictor (M, K) between two percentiles, or its whole range if these are equal."""
    low, high = np.percentile(predictors, USUAL_RANGE_PERCENT, axis=0)
    full_range = np.ptp(predictors, axis=0)
    return np.asarray(np.where(high > low, high - low, full_range))


def _strength(cause: Cause) -> float:
    """How far a factor is from 1, in either direction."""
    return float(abs(np.log(cause.factor)))


def _segments(
    windows: Sequence[_Window],
    losses: Array,
    causes: Sequence[Cause],
    contributions: Array,
) -> tuple[Segment, ...]:
    """The segments with their errors (M,) and factors, the largest error first."""
    segments = []
    for window, loss, contribution in zip(windows, losses.tolist(), contributions, strict=True):
        factors = _factors(causes, contribution)
        trial = window.trial
        segments.append(Segment(trial.case, trial.repeat, window.first, window.end, loss, factors))
    return tuple(sorted(segments, key=lambda segment: segment.loss, reverse=True))


def _factors_by_case(
    windows: Sequence[_Window],
    causes: Sequence[Cause],
    contributions: Array,
) -> dict[str, tuple[tuple[Cause, float], ...]]:
    """The mean factors of each case."""
    case_of_window = np.array([window.trial.case for window in windows])
    factors = {}
    for case in dict.fromkeys(case_of_window.tolist()):
        factors[case] = _factors(causes, contributions[case_of_window == case].mean(0))
    return factors


def _factors(causes: Sequence[Cause], contributions: Array) -> tuple[tuple[Cause, float], ...]:
    """Each cause with the factor of its contribution (K,) to the logarithm of the error, the largest first."""
    largest_first = np.argsort(-contributions)
    return tuple((causes[k], float(np.exp(contributions[k]))) for k in largest_first)


def _merge_collinear(names: Sequence[str], levels: Array) -> tuple[list[tuple[str, ...]], Array]:
    """Standardise conditions (M, C), and replace those that correlate by their mean.

    Returns the names in each group, and the predictors (M, K). A condition that correlates negatively with the first
    of its group is negated before the mean is taken.
    """
    standardised = (levels - levels.mean(0)) / levels.std(0)
    correlation = standardised.T @ standardised / len(standardised)

    group = np.arange(len(names))
    is_collinear_pair = np.triu(np.abs(correlation) >= COLLINEAR, 1)
    for first, second in np.argwhere(is_collinear_pair).tolist():
        group[group == group[second]] = group[first]

    merged_names = []
    columns = []
    for number in dict.fromkeys(group.tolist()):
        members = np.flatnonzero(group == number).tolist()
        signs = np.sign(correlation[members[0], members])
        merged_names.append(tuple(names[member] for member in members))
        columns.append((standardised[:, members] * signs).mean(1))
    return merged_names, np.stack(columns, 1)


def _ridge_slopes(predictors: Array, values: Array) -> Array:
    """Slopes (K,) of the ridge regression of values (M,) on predictors (M, K)."""
    centred = predictors - predictors.mean(0)
    penalty = RIDGE * len(predictors) * np.eye(predictors.shape[1])
    normal_matrix = centred.T @ centred + penalty
    right_side = centred.T @ (values - values.mean())
    return np.asarray(np.linalg.solve(normal_matrix, right_side))


def _resampled_slopes(windows: Sequence[_Window], predictors: Array, values: Array) -> Array:
    """Slopes (RESAMPLES, K) of regressions on segments that are drawn with replacement within each trial."""
    rng = np.random.default_rng(0)
    trial_of_window = np.array([window.trial_number for window in windows])
    rows_of_trials = [np.flatnonzero(trial_of_window == trial) for trial in np.unique(trial_of_window)]

    slopes = []
    for _ in range(RESAMPLES):
        rows = _resampled_rows(rows_of_trials, rng)
        slopes.append(_ridge_slopes(predictors[rows], values[rows]))
    return np.array(slopes)


def _resampled_rows(
    rows_of_trials: Sequence[NDArray[np.intp]],
    rng: np.random.Generator,
) -> NDArray[np.intp]:
    """As many rows of each trial as it has, drawn with replacement."""
    return np.concatenate([rng.choice(rows, len(rows)) for rows in rows_of_trials])
