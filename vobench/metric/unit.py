"""Units of inference: the mean over repeats, over the cases of a drive, and over the drives in a place.

The error of an estimator varies far more between places than between repeats, and all cases in a place share the
effect of that place, so they are not independent. The conclusions of a board should hold for other places of the same
kind. Each place therefore contributes one value, no matter how many cases and repeats it has.

In shapes, C is the number of cases, D of drives and P of places.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Design:
    """The drive and the place of each case of a board.

    `drive_of_case` (C,) is the index of the drive of each case, from 0.
    `place_of_drive` (D,) is the index of the place of each drive, from 0.
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
        """The mean value (..., P) of each place, from the values (..., C) of the cases. NaN is a missing value.

        The value of a drive is the mean over its cases, and the value of a place is the mean over its drives. All
        drives in a place therefore have the same weight. Missing values are ignored; the mean of none is NaN.
        """
        by_drive = _group_means(values, self.drive_of_case, self.drives)
        return _group_means(by_drive, self.place_of_drive, self.places)


def make_design(places: Sequence[Hashable], drives: Sequence[Hashable]) -> Design:
    """The design of cases, from the place (C,) and the drive (C,) of each case.

    Drives with the same name in different places are different drives.
    """
    place_indices = dict[Hashable, int]()
    drive_indices = dict[tuple[Hashable, Hashable], int]()
    drive_of_case = list[int]()
    place_of_drive = list[int]()
    for place, drive in zip(places, drives, strict=True):
        place_and_drive = (place, drive)
        if place not in place_indices:
            place_indices[place] = len(place_indices)
        if place_and_drive not in drive_indices:
            drive_indices[place_and_drive] = len(drive_indices)
            place_of_drive.append(place_indices[place])
        drive_of_case.append(drive_indices[place_and_drive])
    return Design(np.array(drive_of_case, np.intp), np.array(place_of_drive, np.intp))


def separate_places(cases: int) -> Design:
    """The design of a number of independent cases: each has its own drive in its own place."""
    indices = np.arange(cases)
    return Design(drive_of_case=indices, place_of_drive=indices)


def mean_of_known(values: Array) -> Array:
    """The means (...) of values (..., N) over the last axis, without NaNs. The mean is NaN if all values are NaN."""
    is_known = ~np.isnan(values)
    counts = is_known.sum(axis=-1)
    sums = np.where(is_known, values, 0.0).sum(axis=-1)
    means = np.full(sums.shape, np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means


def _group_means(values: Array, group: Indices, groups: int) -> Array:
    """The mean (..., G) of each group of values (..., N), without NaNs. It is NaN for a group without values.

    `group` (N,) is the index of the group of each value, and `groups` is the number of groups.
    """
    rows = values.reshape(-1, values.shape[-1])
    means = np.full((len(rows), groups), np.nan)
    for row, row_means in zip(rows, means, strict=True):
        is_known = ~np.isnan(row)
        known_groups = group[is_known]
        known_values = row[is_known]
        counts = np.bincount(known_groups, minlength=groups)
        sums = np.bincount(known_groups, known_values, minlength=groups)
        np.divide(sums, counts, out=row_means, where=counts > 0)
    return means.reshape(*values.shape[:-1], groups)
