"""Attributes the error of an estimator to the conditions of its frames by regression, and finds divergences."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.error_permutation import make_series_design, permuted_log_means
from vobench.geometry.se3 import Array

SEGMENT_FRAMES = 5
MIN_SEGMENTS = 8  # fewer do not suffice for a regression
MIN_FAILING_LOSS = 0.005  # an error that a segment must have before anything is said to cause it
MIN_FAILING_SEGMENTS = 2
MIN_LOSS = 1e-4  # smaller errors count as this one: differences below it say nothing about causes
MIN_RELATIVE_SPREAD = 1e-6  # a condition that varies less, relative to its largest value, is constant
COLLINEAR = 0.9  # conditions with this absolute correlation cannot be told apart
RIDGE = 0.02  # times the number of segments, on standardised conditions: a few more segments without any effect
MIN_VARIANCE = 1e-12  # of the error's logarithm
LARGEST_EFFECT = 50.0  # on the logarithm of the error
PERMUTATIONS = 499
SURE_P = 0.05  # the largest corrected p-value of a sure cause
INTERVAL_PERCENT = 95.0
# On a single drive, a condition of the drive can agree with the errors once by chance. So it has to recur: its slope in
# each half of the drive must be at least this share of its slope on the whole drive.
MIN_RECURRING_SHARE = 1 / 3
MAX_CASE_SHARE = 0.1  # a condition belongs to the drive if cases differ in at most this share of its variance
TIME = "since_start"  # the condition that cannot recur
MIN_EXPLAINED = 0.4  # where the conditions explain less of the error, most of it has a cause outside of the list
USUAL_RANGE_PERCENT = (5.0, 95.0)  # from a low to a high value of a condition

# A trial diverges where the error of a frame exceeds this multiple of the trial's median, within these limits.
DIVERGENCE_FACTOR = 8.0
MAX_DIVERGENCE_LOSS = 0.5


@dataclass(frozen=True, slots=True)
class ErrorSeries:
    """The errors of a trial: the error (N,) since the previous frame, and the conditions (N,) of frames by name.

    The error of the first frame is 0. `place` and `drive` are those of the case; an empty name means that no other
    case shares it.
    """

    case: str
    repeat: int
    conditions: Mapping[str, Array]
    loss: Array
    place: str = ""
    drive: str = ""

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
    95 % confidence interval, and `p` is the p-value. Both are corrected for the number of conditions: an interval does
    not contain 1 if `p` is at most 5 %, except for rounding.
    `recurs` is false if all cases are on one drive, and the conditions agree with the errors in one half of it only.
    """

    conditions: tuple[str, ...]
    factor: float
    low: float
    high: float
    p: float
    recurs: bool = True

    @property
    def is_sure(self) -> bool:
        """Whether the error is significantly related to the conditions, given all others, and that more than once."""
        return self.recurs and self.p <= SURE_P


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
    do not vary. `explained` is the share of the variance of the error's logarithm that the regression explains,
    adjusted for the number of conditions.
    """

    causes: tuple[Cause, ...]
    segments: tuple[Segment, ...]
    cases: Mapping[str, tuple[tuple[Cause, float], ...]]
    constant: tuple[str, ...]
    explained: float

    @property
    def is_mostly_unexplained(self) -> bool:
        """Whether most of the error has a cause that is not one of the conditions."""
        return self.explained < MIN_EXPLAINED

    @property
    def named(self) -> tuple[Cause, ...]:
        """The sure causes that raise or lower the error; none if most of the error is unexplained."""
        if self.is_mostly_unexplained:
            return ()
        return tuple(cause for cause in self.causes if cause.is_sure)


@dataclass(frozen=True, slots=True)
class _Window:
    """The frames of one segment: the trial, its index among all trials, and the first frame."""

    trial: ErrorSeries
    trial_number: int
    first: int

    @property
    def end(self) -> int:
        return min(self.first + SEGMENT_FRAMES, len(self.trial.loss))

    @property
    def is_in_first_half(self) -> bool:
        """Whether its middle is in the first half of the trial."""
        return self.first + self.end < len(self.trial.loss)

    def mean(self, values: Array) -> float:
        """The mean over the segment of values (N,) of all frames."""
        return float(values[self.first : self.end].mean())

    def mean_loss(self) -> float:
        return self.mean(self.trial.loss)

    def mean_conditions(self, names: Sequence[str]) -> list[float]:
        return [self.mean(self.trial.conditions[name]) for name in names]


def reason_for_no_answer(trials: Sequence[ErrorSeries]) -> str:
    """Why nothing can be said about the causes of the errors of some trials; empty if something can."""
    windows = list(_windows(trials))
    if len(windows) < MIN_SEGMENTS:
        return f"{len(windows)} segments of {SEGMENT_FRAMES} frames are too few to learn causes from ({MIN_SEGMENTS})"
    failing = sum(window.mean_loss() >= MIN_FAILING_LOSS for window in windows)
    if failing < MIN_FAILING_SEGMENTS:
        return f"the error is below {MIN_FAILING_LOSS:.1%} of the path nearly everywhere, so there is little to explain"
    if not _varies(_levels(windows, tuple(trials[0].conditions))).any():
        return "no condition varies in this run"
    return ""


def attribute(trials: Sequence[ErrorSeries]) -> Attribution | None:
    """Regress the logarithm of the error on all conditions that vary; return None if there is a reason for no answer.

    Conditions whose correlation is COLLINEAR or more are merged. Significance and confidence intervals come from
    permuted errors (`error_permutation`), and are corrected for the number of conditions by the largest statistic.
    """
    if reason_for_no_answer(trials):
        return None
    windows = list(_windows(trials))

    names = tuple(trials[0].conditions)
    levels = _levels(windows, names)  # (M, C)
    varies = _varies(levels)
    varying = [names[index] for index in np.flatnonzero(varies)]
    constant = [names[index] for index in np.flatnonzero(~varies)]

    losses = np.array([window.mean_loss() for window in windows])  # (M,)
    log_losses = np.log(np.maximum(losses, MIN_LOSS))
    groups, predictors = _merge_collinear(varying, levels[:, varies])  # (M, K)
    fit = fit_ridge(predictors, log_losses[None])
    null = fit_ridge(predictors, _permuted(trials))  # of PERMUTATIONS rows
    slopes = fit.slopes[0]  # (K,)
    half_widths = np.percentile(null.t.max(1), INTERVAL_PERCENT) * fit.standard_errors[0]
    p_values = corrected_p_values(fit.t[0], null.t)
    recurs = _recurs(windows, predictors, slopes, log_losses)

    ranges = _usual_ranges(predictors)
    causes = []
    for k, group in enumerate(groups):
        slope_and_interval = np.array([slopes[k], slopes[k] - half_widths[k], slopes[k] + half_widths[k]])
        effects = slope_and_interval * ranges[k]
        factor, low, high = np.exp(effects.clip(-LARGEST_EFFECT, LARGEST_EFFECT)).tolist()
        is_time = group == (TIME,)
        causes.append(Cause(group, factor, low, high, float(p_values[k]), bool(is_time or recurs[k])))

    contributions = (predictors - np.median(predictors, axis=0)) * slopes  # (M, K), to the logarithm of the error
    return Attribution(
        causes=tuple(sorted(causes, key=_strength, reverse=True)),
        segments=_segments(windows, losses, causes, contributions),
        cases=_factors_by_case(windows, causes, contributions),
        constant=tuple(constant),
        explained=float(fit.explained[0]),
    )


def _permuted(trials: Sequence[ErrorSeries]) -> Array:
    """The logarithms (PERMUTATIONS, M) of the errors of segments if they did not depend on conditions."""
    cases = [trial.case for trial in trials]
    places = [trial.place or trial.case for trial in trials]
    drives = [trial.drive or trial.case for trial in trials]
    design = make_series_design(cases, places, drives)
    losses = [trial.loss[1:] for trial in trials]
    return permuted_log_means(losses, design, segment=SEGMENT_FRAMES, floor=MIN_LOSS, draws=PERMUTATIONS)


@dataclass(frozen=True, slots=True)
class RidgeFit:
    """Ridge regressions of R series of values on K predictors.

    `slopes` and `standard_errors` are (R, K). `explained` (R,) is the adjusted share of the variance.
    """

    slopes: Array
    standard_errors: Array
    explained: Array

    @property
    def t(self) -> Array:
        """The absolute slopes (R, K) relative to their standard errors."""
        return np.asarray(np.abs(self.slopes) / self.standard_errors)


def fit_ridge(predictors: Array, values: Array) -> RidgeFit:
    """Ridge regressions of each row of values (R, M) on predictors (M, K)."""
    rows, columns = predictors.shape
    centred = predictors - predictors.mean(0)
    deviations = values - values.mean(1, keepdims=True)  # (R, M)
    penalty = RIDGE * rows * np.eye(columns)
    inverse = np.linalg.inv(centred.T @ centred + penalty)
    slopes = deviations @ centred @ inverse  # (R, K)

    residuals = deviations - slopes @ centred.T
    degrees_of_freedom = max(rows - columns - 1, 1)
    residual_variance = np.maximum((residuals**2).sum(1) / degrees_of_freedom, MIN_VARIANCE)
    total_variance = np.maximum((deviations**2).sum(1) / (rows - 1), MIN_VARIANCE)
    standard_errors = np.sqrt(residual_variance[:, None] * np.diag(inverse))
    return RidgeFit(slopes, standard_errors, 1 - residual_variance / total_variance)


def corrected_p_values(observed: Array, null: Array) -> Array:
    """The p-values (K,) of observed statistics, corrected for their number by the largest of each draw (R, K).

    Source: Westfall and Young (1993), "Resampling-based multiple testing", the single-step maxT procedure.
    """
    largest = null.max(1)  # (R,)
    exceeding = (largest[:, None] >= observed).sum(0)
    return np.asarray((exceeding + 1) / (len(null) + 1))


def _recurs(
    windows: Sequence[_Window],
    predictors: Array,
    slopes: Array,
    log_losses: Array,
) -> NDArray[np.bool_]:
    """Which predictors (M, K) agree with the errors more than once.

    With several drives, that is every predictor. With one drive, it is those that differ between cases, and those that
    raise the error, or lower it, in each half of the drive.
    """
    drives = {window.trial.drive or window.trial.case for window in windows}
    if len(drives) > 1:
        return np.ones(len(slopes), bool)

    centred = predictors - predictors.mean(0)
    is_of_drive = _case_shares(windows, centred) <= MAX_CASE_SHARE
    explained_by_cases = centred[:, ~is_of_drive] @ slopes[~is_of_drive]
    rest = log_losses - log_losses.mean() - explained_by_cases  # (M,)
    is_early = np.array([window.is_in_first_half for window in windows])
    recurs = []
    for values, slope, belongs_to_drive in zip(centred.T, slopes, is_of_drive, strict=True):
        slopes_of_halves = np.array([_slope(values[half], rest[half]) for half in (is_early, ~is_early)])
        agrees = slopes_of_halves * np.sign(slope) >= MIN_RECURRING_SHARE * abs(slope)
        recurs.append(not belongs_to_drive or bool(agrees.all()))
    return np.array(recurs)


def _case_shares(windows: Sequence[_Window], centred: Array) -> Array:
    """The share (K,) of the variance of predictors (M, K) that is between segments at the same time on the drive."""
    firsts = np.array([window.first for window in windows])
    within_time = centred.copy()
    for first in np.unique(firsts):
        is_then = firsts == first
        within_time[is_then] -= centred[is_then].mean(0)
    return np.asarray((within_time**2).sum(0) / (centred**2).sum(0))


def _slope(predictor: Array, values: Array) -> float:
    """The slope of the line through values (N,) over a predictor (N,); 0 if the predictor does not vary."""
    deviations = predictor - predictor.mean()
    variance = float((deviations**2).sum())
    return float(deviations @ values) / variance if variance > 0 else 0.0


def _windows(trials: Sequence[ErrorSeries]) -> Iterator[_Window]:
    """Yield all segments of all trials. The first frame is in no segment, because it has no error."""
    for number, trial in enumerate(trials):
        for first in range(1, len(trial.loss), SEGMENT_FRAMES):
            yield _Window(trial, number, first)


def _levels(windows: Sequence[_Window], names: Sequence[str]) -> Array:
    """The square root of the mean of each condition over each segment (M, C).

    Conditions are 0 or more, and many have a few values that are far larger than the others. The root keeps these from
    deciding the regression alone.
    """
    means = np.array([window.mean_conditions(names) for window in windows])
    return np.asarray(np.sqrt(means))


def _varies(levels: Array) -> NDArray[np.bool_]:
    """Which levels (M, C) are not constant."""
    largest = np.maximum(levels.max(0), MIN_RELATIVE_SPREAD)
    return np.asarray(levels.std(0) > MIN_RELATIVE_SPREAD * largest)


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

    Returns the names in each group, and the predictors (M, K), one for each group. A condition that correlates
    negatively with the first of its group is negated before the mean is taken.
    """
    standardised = (levels - levels.mean(0)) / levels.std(0)
    correlation = standardised.T @ standardised / len(standardised)

    merged_names = []
    predictors = []
    for members in _collinear_groups(correlation):
        signs = np.sign(correlation[members[0], members])
        predictors.append((standardised[:, members] * signs).mean(1))
        merged_names.append(tuple(names[member] for member in members))
    return merged_names, np.stack(predictors, 1)


def _collinear_groups(correlation: Array) -> list[list[int]]:
    """The indices of conditions that are connected by collinear pairs, by their correlation (C, C).

    Groups are transitive: two conditions that both correlate with a third one are in one group with it.
    """
    group = np.arange(len(correlation))  # of each condition; each begins as a group of its own
    is_collinear_pair = np.triu(np.abs(correlation) >= COLLINEAR, 1)
    for first, second in np.argwhere(is_collinear_pair).tolist():
        is_in_second = group == group[second]
        group[is_in_second] = group[first]
    return [np.flatnonzero(group == number).tolist() for number in dict.fromkeys(group.tolist())]
