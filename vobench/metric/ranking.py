"""Ranks of estimators and their significance: paired tests over places, and intervals of ranks and of ratios.

A trial counts by its loss, 1 minus the lost-aware score, which is about half its error relative to a tenth of the path;
a failed trial has a loss of at least 1/2. Estimators are ordered by the geometric mean of the loss, in which no case
outweighs another. What a test decides holds for other places and drives of the same kind: see `unit`.

Symbols: E estimators, C cases, R repeats, P places.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric import sequential
from vobench.metric.significance import PairedDifference, holm, paired_difference, paired_p_values
from vobench.metric.unit import Design, mean_of_known

ALPHA = 0.05  # of the intervals of ranks and ratios, for all of a board together
DECIDED = 0.02  # of the tests of neighbours, for all of a board together
MIN_DRIVES = 7  # with fewer nothing is tested
MIN_PLACES = 4
MIN_LOSS = 1e-9
DIGITS = 12  # decimals at which means count as equal


@dataclass(frozen=True, slots=True)
class Standing:
    """The rank of one estimator and its uncertainty. Values for which there are too few places are None.

    `index` is the row of the estimator in the table of trials.
    `rank` is its rank, which counts from 1.
    `rank_interval` is the 95 % confidence interval of the rank.
    `loss` is the geometric mean of the loss.
    `error_ratio` is the error relative to that of the first-ranked estimator, on cases where neither fails.
    `error_interval` is the confidence interval of `error_ratio`.
    `above` is the difference of log losses to the estimator ranked above. It is also None in a sequential run.
    `p_above` is the p-value of the test against the estimator above, corrected for the number of such tests.
    `level` is the significance level of one such test without correction: DECIDED divided by the number of tests.
    """

    index: int
    rank: int
    rank_interval: tuple[int, int] | None
    loss: float
    error_ratio: float | None
    error_interval: tuple[float, float] | None
    above: PairedDifference | None
    p_above: float | None
    level: float

    @property
    def decided_above(self) -> bool | None:
        """Whether the difference to the estimator ranked above is significant."""
        return None if self.p_above is None else self.p_above < DECIDED

    @property
    def smallest_ratio(self) -> float | None:
        """The smallest ratio of the losses of the two that 95 of 100 boards like this one decide."""
        effect = self.above.detectable(self.level) if self.above else None
        return None if effect is None else float(np.exp(effect))

    def places_needed(self, ratio: float) -> int | None:
        """The number of places that decide a ratio of the losses of the two."""
        return self.above.units_needed(float(np.log(ratio)), self.level) if self.above else None


@dataclass(frozen=True, slots=True)
class TrialTable:
    """Trials (E, C, R): the loss of each, and its error as a share of the path.

    The loss is NaN where there is no such trial or it has none, as in a case whose ground truth is stationary; so is
    the error, and that of a failed trial. All estimators have trials on all cases.
    `is_sequential` states that the number of units depends on what they showed: tests and intervals are then those of
    `sequential`, which hold whenever one stops.
    """

    loss: Array
    error: Array
    design: Design
    is_sequential: bool = False

    @property
    def is_tested(self) -> bool:
        """Whether there are enough drives and places to test any difference."""
        return self.design.drives >= MIN_DRIVES and self.design.places >= MIN_PLACES

    def log_losses_by_case(self) -> Array:
        """The mean logarithm of the loss by estimator and case (E, C)."""
        return mean_of_known(np.log(np.maximum(self.loss, MIN_LOSS)))

    def log_losses(self) -> Array:
        """The mean logarithm of the loss by estimator and place (E, P)."""
        return self.design.means(self.log_losses_by_case())

    def p(self, differences: Array) -> float:
        """The p-value of the differences (P,) between two of the estimators; NaN marks a place without one."""
        if not self.is_sequential:
            return paired_difference(differences).p
        known = sequential.known_differences(differences)
        bounded_mean = float(np.clip(known, -sequential.BOUND, sequential.BOUND).sum())
        if known.sum() * bounded_mean <= 0:
            return 1.0  # a few places beyond the bound turn the order, of which nothing is known then
        return min(1.0, 1.0 / sequential.e_value(known))

    def interval(self, differences: Array, alpha: float) -> tuple[float, float] | None:
        """The confidence interval of the mean of differences (P,) at the level 1 - alpha, None for too few units."""
        if not self.is_sequential:
            return paired_difference(differences).interval(alpha)
        known = sequential.known_differences(differences)
        return sequential.interval(known, alpha) if len(known) >= sequential.MIN_UNITS else None

    def pair_p_values(self) -> Array:
        """The p-values (E, E) of all pairs of estimators over places; the diagonal is 1."""
        log_losses = self.log_losses()
        if not self.is_sequential:
            return paired_p_values(log_losses)
        p_values = np.ones((len(log_losses), len(log_losses)))
        for a, b in combinations(range(len(log_losses)), 2):
            p_values[a, b] = self.p(log_losses[b] - log_losses[a])
            p_values[b, a] = p_values[a, b]
        return p_values

    def log_errors_by_case(self) -> Array:
        """The mean logarithm of the error by estimator and case (E, C), NaN where every trial failed."""
        return mean_of_known(np.log(np.maximum(self.error, MIN_LOSS)))


def trial_loss(lost_aware: float | None, *, survived: bool) -> float:
    """A trial's loss in (0, 1], 1 minus its lost-aware score; at least 1/2 for a failed trial, whatever its score."""
    score = lost_aware if lost_aware is not None else 0.5 * survived
    if not survived and score >= 0.5:
        score -= 0.5  # the score of its poses counted it as survived
    return max(1.0 - score, MIN_LOSS)


def rank(trials: TrialTable) -> list[Standing]:
    """The standings of estimators, best first."""
    log_losses = trials.log_losses()  # (E, P)
    means = _means(log_losses)
    order: list[int] = np.argsort(means, kind="stable").tolist()
    differences = [log_losses[below] - log_losses[above] for above, below in pairwise(order)]  # (P,) each
    neighbours = [paired_difference(of_pair) for of_pair in differences]
    p_values = holm([trials.p(of_pair) for of_pair in differences])
    intervals = _rank_intervals(trials, order, p_values) if trials.is_tested else None
    error_ratios = _error_ratios(trials, order)

    standings = list[Standing]()
    ranks = _shared_ranks(means[order])
    for position, (estimator, rank_of_estimator) in enumerate(zip(order, ranks, strict=True)):
        has_test = trials.is_tested and position > 0
        error_ratio, error_interval = error_ratios[position]
        standing = Standing(
            index=estimator,
            rank=rank_of_estimator,
            rank_interval=intervals[position] if intervals else None,
            loss=float(np.exp(means[estimator])),
            error_ratio=error_ratio,
            error_interval=error_interval,
            above=neighbours[position - 1] if has_test and not trials.is_sequential else None,
            p_above=p_values[position - 1] if has_test else None,
            level=DECIDED / max(len(neighbours), 1),
        )
        standings.append(standing)
    return standings


def _means(log_losses: Array) -> Array:
    """The mean (E,) over places, rounded so that equal ones are equal; 0 where no trial has a loss."""
    means = np.nan_to_num(mean_of_known(log_losses))
    return np.asarray(np.round(means, DIGITS), float)


def beside(trials: TrialTable) -> Standing:
    """The standing of the last estimator of a table beside the first, without a rank: its loss and its error ratio."""
    last = len(trials.loss) - 1
    log_loss = float(_means(trials.log_losses())[last])
    error_ratio, error_interval = _error_ratios(trials, [0, last])[1]
    return Standing(
        index=last,
        rank=last + 1,
        rank_interval=None,
        loss=float(np.exp(log_loss)),
        error_ratio=error_ratio,
        error_interval=error_interval,
        above=None,
        p_above=None,
        level=DECIDED,
    )


def _rank_intervals(trials: TrialTable, order: Sequence[int], neighbour_p: Sequence[float]) -> list[tuple[int, int]]:
    """The first and the last rank of each ranked estimator, by how many others are significantly better and worse.

    All pairs are tested, with Holm's correction at 5 %, so that all intervals of a board hold together in 95 of 100.
    Neighbours whose order is not decided, by their corrected p-values (E - 1,), may share their ranks besides.
    Source: Mogstad, Romano, Shaikh and Wilhelm, Inference for ranks, 2024.
    """
    above, below = np.triu_indices(len(order), k=1)  # (pairs,)
    p_values = trials.pair_p_values()[np.ix_(order, order)][above, below]
    is_neighbour = below == above + 1
    is_decided = ~is_neighbour | (np.array(neighbour_p)[above.clip(max=len(order) - 2)] < DECIDED)
    is_significant = is_decided & (np.array(holm(p_values.tolist())) < ALPHA)
    better = np.bincount(below[is_significant], minlength=len(order))
    worse = np.bincount(above[is_significant], minlength=len(order))
    first_places = 1 + better
    last_places = len(order) - worse
    return list(zip(first_places.tolist(), last_places.tolist(), strict=True))


def _error_ratios(trials: TrialTable, order: Sequence[int]) -> list[tuple[float | None, tuple[float, float] | None]]:
    """The error of each ranked estimator relative to the first's, and its confidence interval.

    Only cases count where both have a trial that survived. The first estimator was chosen by the same trials, which
    makes its error look small; at the level ALPHA divided by the root of the number of ratios, an interval among
    estimators that are all alike holds in 95 of 100 boards (`benchmarks/error_rates.py`).
    """
    log_errors = trials.log_errors_by_case()
    level = ALPHA / np.sqrt(max(len(order) - 1, 1))
    ratios = list[tuple[float | None, tuple[float, float] | None]]()
    for estimator in order:
        by_case = log_errors[estimator] - log_errors[order[0]]
        by_place = trials.design.means(by_case)
        difference = paired_difference(by_place)
        ratio = float(np.exp(difference.mean)) if difference.units else None
        ends = trials.interval(by_place, level) if trials.is_tested and estimator != order[0] else None
        interval = (float(np.exp(ends[0])), float(np.exp(ends[1]))) if ends else None
        ratios.append((ratio, interval))
    return ratios


def _shared_ranks(means: Array) -> list[int]:
    """The ranks of estimators, from 1, given their mean losses (E,) in order. Equal losses share the first rank."""
    ranks = list[int]()
    for position, mean in enumerate(means.tolist()):
        is_tied = position > 0 and mean == means[position - 1]
        ranks.append(ranks[-1] if is_tied else position + 1)
    return ranks
