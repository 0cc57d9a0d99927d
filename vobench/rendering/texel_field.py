"""Values at texels that are computed at some of them, from coarse to fine, and interpolated between these."""

from dataclasses import dataclass

import numpy as np

from vobench.rendering.array_types import Floats, Mask, Rows
from vobench.rendering.level_kernels import (
    KNOWN,
    UNKNOWN,
    States,
    fill_between,
    find_extremes,
    mark_bends,
    next_to_marked,
    smooth_along,
)
from vobench.rendering.texel_layout import TexelLayout


@dataclass(frozen=True, slots=True)
class TexelField:
    """Values (P,) of points on the map, and the state (P,) that says at which of them they are known."""

    layout: TexelLayout
    values: Floats
    state: States

    @classmethod
    def unknown(cls, layout: TexelLayout, count: int) -> "TexelField":
        """A field of `count` points at which nothing is known."""
        return cls(layout, np.zeros(count, np.float32), np.full(count, UNKNOWN, np.uint8))

    def copy(self) -> "TexelField":
        """A field with the same values, which can be changed without changing this one."""
        return TexelField(self.layout, self.values.copy(), self.state.copy())

    def set(self, rows: Rows, values: Floats) -> None:
        """Set the values (N,) of the points at rows (N,), which are known from now on."""
        self.values[rows] = values
        self.state[rows] = KNOWN

    def bends(self, rows: Rows, *, steps: int, tolerance: float) -> Mask:
        """Which points (P,) of those at rows (N,) differ from the mean of known ones `steps` away on opposite sides.

        The tolerance is relative to the value.
        """
        left, right, above, below = self.layout.neighbours
        is_bend = np.zeros(len(self.values), bool)
        for before, after in ((left, right), (above, below)):
            mark_bends(rows, before, after, steps, tolerance, self.state, self.values, is_bend)
        return is_bend

    def refine(
        self,
        rows: Rows,
        *,
        stride: int,
        tolerance: float,
        is_relative: bool = False,
        marked: Mask | None = None,
    ) -> Rows:
        """Interpolate unknown values between points of the next coarser grid; which rows must be computed instead.

        `rows` (N,) are points of the grid of a stride. Those must be computed that are not between two known points, or
        that are next to a difference of more than the tolerance, which may be relative, or next to points that are
        marked (P,). Known ones may be among them.
        """
        left, right, above, below = self.layout.neighbours
        is_steep = np.zeros(len(self.values), bool) if marked is None else marked.copy()
        limits = (stride, tolerance, is_relative)
        fill_between(rows, left, right, *limits, self.state, self.values, is_steep)
        fill_between(rows, above, below, *limits, self.state, self.values, is_steep)
        is_asked = np.empty(len(rows), bool)
        next_to_marked(rows, self.layout.neighbours, is_steep, is_asked)
        return np.asarray(rows[is_asked | (self.state[rows] != KNOWN)])

    def extremes(self, rows: Rows, *, steps: int) -> tuple[Floats, Floats]:
        """The least and the greatest value (N,) among those at rows (N,) and on four sides at most `steps` away."""
        low = np.empty(len(rows), np.float32)
        high = np.empty(len(rows), np.float32)
        find_extremes(rows, self.layout.neighbours, steps, self.state, self.values, low, high)
        return low, high

    def smooth(self, rows: Rows, *, steps: int) -> None:
        """Average the values of the points at rows (N,) with those of each other at most `steps` away.

        Even values stay even.
        """
        is_member = np.full(len(self.values), UNKNOWN, np.uint8)
        is_member[rows] = KNOWN
        left, right, above, below = self.layout.neighbours
        for before, after in ((left, right), (above, below)):
            result = np.empty(len(rows), np.float32)
            smooth_along(rows, before, after, steps, is_member, self.values, result)
            self.values[rows] = result
