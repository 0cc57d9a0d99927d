"""Units of inference: means of trials over repeats, over the cases of one drive, and over the drives in one place.

Estimators differ from place to place far more than from one repeat to the next, and cases that share a place share
that difference. What a board concludes should hold for other places and drives of the same kind, so all that one
place contributes is a single value, however many cases and repeats it consists of.

Symbols: E estimators, C cases, R repeats, P places.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Design:
    """Where the cases of a board take place.

    drive_of_case (C,) numbers the drive of each case, place_of_drive (D,) the place of each drive.
    """

    drive_of_case: Indices
    place_of_drive: Indices

    @property
    def drives(self) -> int:
        """The number of drives."""
        return len(self.place_of_drive)

    @property
    def places(self) -> int:
        """The number of places."""
        return int(self.place_of_drive.max(initial=-1)) + 1

    def means(self, values: Array) -> Array:
        """The means (..., P) over places of values (..., C) by case; a drive counts as much as any other in its place.

        NaN marks a missing value. A drive is the mean of the cases that have one, and a place that of its drives.
        """
        by_drive = _group_means(values, self.drive_of_case, self.drives)
        return _group_means(by_drive, self.place_of_drive, self.places)


def make_design(places: Sequence[Hashable], drives: Sequence[Hashable]) -> Design:
    """The design of cases, by the place and the drive of each; drives of the same name in two places are two."""
    place_numbers = dict[Hashable, int]()
    drive_numbers = dict[tuple[Hashable, Hashable], int]()
    drive_of_case = list[int]()
    place_of_drive = list[int]()
    for place, drive in zip(places, drives, strict=True):
        unit = place, drive
        if unit not in drive_numbers:
            drive_numbers[unit] = len(drive_numbers)
            place_of_drive.append(place_numbers.setdefault(place, len(place_numbers)))
        drive_of_case.append(drive_numbers[unit])
    return Design(np.array(drive_of_case, np.intp), np.array(place_of_drive, np.intp))


def separate_places(cases: int) -> Design:
    """The design of cases that have nothing in common: each is a place of its own."""
    numbers = np.arange(cases)
    return Design(numbers, numbers)


def mean_of_known(values: Array) -> Array:
    """The means (...) of values (..., N), of repeats or places, over the known ones; NaN where none is known."""
    is_known = ~np.isnan(values)
    counts = is_known.sum(axis=-1)
    sums = np.where(is_known, values, 0.0).sum(axis=-1)
    means = np.full(sums.shape, np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means


def _group_means(values: Array, group: Indices, groups: int) -> Array:
    """The means (..., G) of the known among values (..., N) whose groups (N,) are given, NaN where none is known."""
    rows = values.reshape(-1, values.shape[-1])
    means = np.full((len(rows), groups), np.nan)
    for row, mean in zip(rows, means, strict=True):
        is_known = ~np.isnan(row)
        counts = np.bincount(group[is_known], minlength=groups)
        sums = np.bincount(group[is_known], row[is_known], minlength=groups)
        np.divide(sums, counts, out=mean, where=counts > 0)
    return means.reshape(*values.shape[:-1], groups)
