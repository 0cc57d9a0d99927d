"""Draws the errors of trials as they would be if they did not depend on any condition, by restricted permutation.

Errors of successive frames resemble each other, errors on the same drive happen at the same time in several cases, and
cases in one place share what makes the place hard. None of that is a cause. So a permutation keeps it:

- The errors of a trial are rotated along time, by the same share of the duration in all trials of a drive.
- The series of whole cases are exchanged among the cases of a unit, which is a drive in a place.
- The mean levels of units are exchanged among units.

Source: Winkler, Webster, Vidaurre, Nichols and Smith (2015), "Multi-level block permutation", NeuroImage 123; Harris
(2020), "A shift test for independence in generic time series", for the rotation.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array

Indices = NDArray[np.intp]
# A rotation by fewer segments leaves errors next to the conditions that they came with.
MIN_SHIFT_SEGMENTS = 1.0
LARGEST_MIN_SHIFT = 0.25  # of the duration


@dataclass(frozen=True, slots=True)
class SeriesDesign:
    """Which series (T,) of errors belong together: numbers of the case, the unit and the drive of each."""

    case: Indices
    unit: Indices
    drive: Indices


def make_series_design(
    cases: Sequence[Hashable],
    places: Sequence[Hashable],
    drives: Sequence[Hashable],
) -> SeriesDesign:
    """The design of series by the case, the place and the drive of each."""
    units = list(zip(places, drives, strict=True))
    return SeriesDesign(_numbered(cases), _numbered(units), _numbered(drives))


def permuted_log_means(
    losses: Sequence[Array],
    design: SeriesDesign,
    *,
    segment: int,
    floor: float,
    draws: int,
    seed: int = 0,
) -> Array:
    """The logarithms of segment means (draws, M) of permuted errors.

    `losses` are the errors (N,) of each series, and M is the number of segments of `segment` frames in all of them.
    Means below `floor` count as `floor`.
    """
    rng = np.random.default_rng(seed)
    series_of_cases = _members(design.case)
    cases_of_units = _cases_of_units(design)
    levels = _unit_levels(losses, design, segment, floor)

    rows = []
    least_share = min(MIN_SHIFT_SEGMENTS * segment / max(map(len, losses)), LARGEST_MIN_SHIFT)
    for _ in range(draws):
        donors = _donors(series_of_cases, cases_of_units, rng)
        shifts = rng.uniform(least_share, 1 - least_share, int(design.drive.max()) + 1)
        level_changes = rng.permutation(levels) - levels
        parts = []
        for receiver, loss in enumerate(losses):
            donor = losses[donors[receiver]]
            rotated = rotate(donor, shifts[design.drive[receiver]])
            fitted = resample(rotated, len(loss))
            parts.append(log_means(fitted, segment, floor) + level_changes[design.unit[receiver]])
        rows.append(np.concatenate(parts))
    return np.array(rows)


def rotate(values: Array, share: float) -> Array:
    """Move values (N,) later by a share of their number; those that leave the end come in at the start."""
    return np.roll(values, round(share * len(values)))


def resample(values: Array, count: int) -> Array:
    """The values (count,) at evenly spread positions of values (N,); the same values if `count` is N."""
    if count == len(values):
        return values
    positions = (np.arange(count) * len(values)) // count
    return np.asarray(values[positions])


def log_means(values: Array, segment: int, floor: float) -> Array:
    """The logarithms of the means of successive segments of values (N,); the last segment may be shorter."""
    starts = np.arange(0, len(values), segment)
    counts = np.diff(np.append(starts, len(values)))
    means = np.add.reduceat(values, starts) / counts
    return np.asarray(np.log(np.maximum(means, floor)))


def _donors(
    series_of_cases: Sequence[Indices],
    cases_of_units: Sequence[Indices],
    rng: np.random.Generator,
) -> Indices:
    """For each series, the series whose errors it gets: of another case in its unit, or of its own."""
    donors = np.zeros(sum(map(len, series_of_cases)), np.intp)
    for cases in cases_of_units:
        for receiver, donor in zip(cases, rng.permutation(cases), strict=True):
            receiving = series_of_cases[receiver]
            giving = series_of_cases[donor]
            donors[receiving] = np.resize(giving, len(receiving))
    return donors


def _cases_of_units(design: SeriesDesign) -> list[Indices]:
    """The numbers of the cases in each unit."""
    return [np.unique(design.case[members]) for members in _members(design.unit)]


def _unit_levels(losses: Sequence[Array], design: SeriesDesign, segment: int, floor: float) -> Array:
    """The mean logarithm (U,) of the errors of each unit."""
    means = np.array([log_means(loss, segment, floor).mean() for loss in losses])
    return np.array([means[members].mean() for members in _members(design.unit)])


def _members(group: Indices) -> list[Indices]:
    """The indices of the members of each group (G,), in the order of the groups' numbers."""
    return [np.flatnonzero(group == number) for number in range(int(group.max()) + 1)]


def _numbered(names: Sequence[Hashable]) -> Indices:
    """Numbers for names, from 0 in the order in which they first appear."""
    numbers: dict[Hashable, int] = {}
    for name in names:
        numbers.setdefault(name, len(numbers))
    return np.array([numbers[name] for name in names], np.intp)
