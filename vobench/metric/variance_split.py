"""The split of a variance among factors: how much of the differences between trials each choice of a case explains.

Each factor has the variance that no other factor explains, estimated by the method of moments: its sum of squares,
less what noise alone would give it. So a factor without an effect has about none, however many levels it has.
Source: Searle, Casella, McCulloch (1992), Variance Components, chapters 4 and 5 (sums of squares of nested models).
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.errors import InputError
from vobench.geometry.se3 import Array

REST = "rest"


@dataclass(frozen=True, slots=True)
class Factor:
    """A factor: the level of each of N values, as hashable labels.

    `within` are the names of the factors in whose levels these are nested: drives are within places, and the
    interaction of estimator and place is within both.
    """

    name: str
    levels: Sequence[Hashable]
    within: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Fit:
    """A least-squares fit: the residual sum of squares, and the rank of the model."""

    residual: float
    rank: int


def variance_split(values: Array, factors: Sequence[Factor]) -> dict[str, float]:
    """The share of the variance of values (N,) that each factor explains, and of the rest; the shares add up to 1.

    Raises InputError if the values are all equal, or if the factors leave nothing to estimate the rest from.
    """
    whole = _fit(values, factors)
    free = len(values) - whole.rank
    if free <= 0:
        raise InputError(f"{len(values)} values are too few to tell {len(factors)} factors from noise")
    noise = whole.residual / free

    variances = {factor.name: _variance(values, factor, factors, noise) for factor in factors}
    variances[REST] = noise
    total = sum(variances.values())
    if total <= 0:
        raise InputError("all values are equal, so there is no variance to split")
    return {name: variance / total for name, variance in variances.items()}


def _variance(values: Array, factor: Factor, factors: Sequence[Factor], noise: float) -> float:
    """The variance that a factor alone explains. A negative estimate counts as 0, so that few levels are overrated."""
    nested = [other for other in factors if factor.name in other.within]
    others = [other for other in factors if other is not factor and other not in nested]
    squares, freedom = _gain(values, others, [*others, factor])
    if not freedom:
        return 0.0

    # Drives differ within a place. What they add to the differences of places is no effect of the place.
    expected = noise
    if nested:
        nested_squares, nested_freedom = _gain(values, [*others, factor], [*others, factor, *nested])
        expected = nested_squares / nested_freedom if nested_freedom else noise
    return max((squares - freedom * expected) / len(values), 0.0)


def _gain(values: Array, smaller: Sequence[Factor], larger: Sequence[Factor]) -> tuple[float, int]:
    """The sum of squares that a larger model explains beyond a smaller one, and its degrees of freedom."""
    before = _fit(values, smaller)
    after = _fit(values, larger)
    return before.residual - after.residual, after.rank - before.rank


def _fit(values: Array, factors: Sequence[Factor]) -> _Fit:
    """The fit of a mean and an effect for each level of each factor."""
    columns = [np.ones((len(values), 1))]
    for factor in factors:
        number_of_level = {level: number for number, level in enumerate(dict.fromkeys(factor.levels))}
        numbers = [number_of_level[level] for level in factor.levels]
        columns.append(np.eye(len(number_of_level))[numbers])
    model = np.concatenate(columns, axis=1)
    effects, _, rank, _ = np.linalg.lstsq(model, values, rcond=None)
    residuals = values - model @ effects
    return _Fit(float(residuals @ residuals), int(rank))
