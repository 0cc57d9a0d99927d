"""Predicts the errors of estimators on a recording, and their order, from their errors in placements of its twin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import scipy

from vobench.geometry.se3 import Array

COVERAGE = 0.95  # of the intervals
LEAST_ERROR_PERCENT = 1e-3  # smaller errors count as this one

# The usual standard deviations of the logarithm of an error between twins, and of what remains for one estimator, and
# the degrees of freedom that they count as: two twins alone say little of how twins differ. Chosen by the differences
# between eight simulated recordings and their twins in other places (benchmarks/hidden_twins.py, seed 1).
USUAL_TWIN_SD = 0.35
USUAL_REMAINING_SD = 0.3
USUAL_FREEDOM = 4


@dataclass(frozen=True, slots=True)
class PredictedError:
    """The expected error of an estimator in percent of length; the interval is None with a single placement."""

    estimator: str
    error: float
    interval: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class TwinPrediction:
    """The expected errors of estimators, the best one first, from their errors in placements of a twin.

    `taus` are Kendall's tau between the orders in each two placements. `basis` says on what the prediction rests.
    """

    errors: tuple[PredictedError, ...]
    taus: tuple[float, ...]
    placements: int
    basis: str = ""

    def sentences(self) -> list[str]:
        """On what the prediction rests, and how far its order is to be trusted."""
        sentences = [self.basis] if self.basis else []
        if self.taus:
            mean = float(np.mean(self.taus))
            sentences.append(
                f"The orders in {self.placements} placements agree by a tau of {mean:.2f} "
                f"({min(self.taus):.2f} … {max(self.taus):.2f})."
            )
        else:
            sentences.append("With a single placement there are no intervals.")
        return sentences

    def covered(self, errors: Mapping[str, float]) -> tuple[int, int]:
        """How many of these errors are in their intervals, and how many have one."""
        are_covered = []
        for predicted in self.errors:
            if predicted.interval and predicted.estimator in errors:
                low, high = predicted.interval
                are_covered.append(low <= errors[predicted.estimator] <= high)
        return sum(are_covered), len(are_covered)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        rows = []
        for predicted in self.errors:
            interval = None if predicted.interval is None else list(predicted.interval)
            rows.append({"estimator": predicted.estimator, "error": predicted.error, "interval": interval})
        return {"estimators": rows, "taus": list(self.taus), "placements": self.placements, "says": self.sentences()}


def predict(
    placements: Sequence[Mapping[str, Array]], *, expects_first: bool = False, basis: str = ""
) -> TwinPrediction:
    """The prediction from the errors of segments, by estimator, in each placement of a twin.

    Only estimators that ran in all placements are predicted. The logarithm of a mean error is taken to be the sum of
    the effects of the estimator, of the placement, and of both together. The interval is that of an error in a further
    placement. With `expects_first`, the expected errors are those in the first placement, because the others have
    errors of calibration that were drawn around the most likely ones; otherwise they are geometric means.
    """
    names = common_names(placements)
    means = np.array([_means(errors, names) for errors in placements])  # (placements, names)
    logs = np.log(np.maximum(means, LEAST_ERROR_PERCENT))
    expected = logs[0] if expects_first else logs.mean(0)
    averaged = 1 if expects_first else len(placements)
    half_width = _half_width(logs, averaged)
    rows = []
    for name, log in zip(names, expected.tolist(), strict=True):
        interval = None
        if half_width is not None:
            interval = (float(np.exp(log - half_width)), float(np.exp(log + half_width)))
        rows.append(PredictedError(name, float(np.exp(log)), interval))
    rows.sort(key=lambda row: row.error)
    return TwinPrediction(tuple(rows), _taus(means), len(placements), basis)


def common_names(placements: Sequence[Mapping[str, Array]]) -> list[str]:
    """The estimators that ran in all placements."""
    first, *others = placements
    names = list(first)
    for errors in others:
        names = [name for name in names if name in errors]
    return names


def _means(errors: Mapping[str, Array], names: Sequence[str]) -> list[float]:
    """The mean errors of some estimators."""
    return [float(np.nanmean(errors[name])) for name in names]


def _half_width(logs: Array, averaged: int) -> float | None:
    """Half of the width of the prediction interval of a logarithm; None if there are too few (placements, names).

    `averaged` is the number of placements whose mean is expected.
    """
    placements, names = logs.shape
    if placements < 2 or names < 2:
        return None
    of_placements = logs.mean(1) - logs.mean()
    remaining = logs - logs.mean(0) - of_placements[:, None]
    placement_freedom = placements - 1
    remaining_freedom = placement_freedom * (names - 1)
    # The two parts of the variance of one logarithm around the mean of its estimator, each with its own quantile: a
    # common one would be too small where two placements are alike by chance.
    placement_part = _squared_half_width(float((of_placements**2).sum()), placement_freedom, USUAL_TWIN_SD)
    remaining_part = _squared_half_width(float((remaining**2).sum()), remaining_freedom, USUAL_REMAINING_SD)
    return float(np.sqrt((placement_part + remaining_part * (1 - 1 / names)) * (1 + 1 / averaged)))


def _squared_half_width(sum_of_squares: float, freedom: int, usual_sd: float) -> float:
    """The square of half of the interval of a part: its variance, combined with the usual one, times a quantile.

    Source: Gelman et al. (2013), Bayesian Data Analysis, the conjugate prior of a variance.
    """
    total_freedom = freedom + USUAL_FREEDOM
    variance = (sum_of_squares + USUAL_FREEDOM * usual_sd**2) / total_freedom
    return variance * float(scipy.stats.t.ppf((1 + COVERAGE) / 2, total_freedom)) ** 2


def _taus(means: Array) -> tuple[float, ...]:
    """Kendall's tau between each two rows of mean errors (placements, names); undefined ones are left out."""
    taus = []
    for one, other in combinations(means, 2):
        tau = float(scipy.stats.kendalltau(one, other).statistic)
        if np.isfinite(tau):
            taus.append(tau)
    return tuple(taus)
