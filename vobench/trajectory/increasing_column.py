"""First columns that increase from row to row: stamps and frame numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.errors import TrajectoryError
from vobench.trajectory.text_table import TextTable
from vobench.trajectory.trajectory import Stamps


@dataclass(frozen=True, slots=True)
class DistinctRows:
    """The rows of a table after repeated stamps or frame numbers have been removed.

    `numbers` (K,) are the stamps or frame numbers of the remaining rows.
    `rows` (K,) are the indices of the remaining rows in the table.
    `notes` has a sentence about the removed rows; it is empty if no row was removed.
    """

    numbers: Stamps
    rows: NDArray[np.intp]
    notes: tuple[str, ...]


def distinct_rows(table: TextTable, numbers: Stamps, noun: str) -> DistinctRows:
    """The first row of each run of rows with the same number, given the number (N,) of each row.

    `noun` is the name of these numbers in messages.
    Raises TrajectoryError if a number is smaller than the one before it.
    """
    require_steps(table, numbers, least_step=0, demand=f"{noun}s must increase")
    repeated_rows = np.flatnonzero(np.diff(numbers) == 0) + 1
    if not repeated_rows.size:
        return DistinctRows(numbers, np.arange(len(numbers)), ())

    rows = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 1))
    note = (
        f"rows that repeat the {noun} of the row before were left out: {repeated_rows.size} of {len(numbers)}, "
        f"the first at {table.place(repeated_rows[0])}"
    )
    return DistinctRows(numbers[rows], rows, (note,))


def require_steps(table: TextTable, numbers: Stamps, *, least_step: int, demand: str) -> None:
    """Raise TrajectoryError unless each of the numbers (N,) exceeds the one before it by at least `least_step`.

    `demand` is the part of the message that states this requirement.
    """
    wrong_rows = np.flatnonzero(np.diff(numbers) < least_step) + 1
    if not wrong_rows.size:
        return
    row = wrong_rows[0]
    text = table.first_fields[row]
    text_before = table.first_fields[row - 1]
    raise TrajectoryError(f"{table.place(row)}: {demand}, but {text} follows {text_before}")
