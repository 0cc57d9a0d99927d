"""When each row of a picture is exposed: strips of rows and sub-frames of the exposure, to the nanosecond. Pure."""

from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from vobench.errors import InputError
from vobench.trajectory.trajectory import Stamps

NS_PER_S = 1_000_000_000


class ShutterKind(StrEnum):
    """Whether all rows are exposed together or one after the other."""

    GLOBAL = "global"
    ROLLING = "rolling"


@dataclass(frozen=True, slots=True)
class Shutter:
    """`readout_s` is the time from the first row to the one that would follow the last: height × line delay."""

    kind: ShutterKind = ShutterKind.GLOBAL
    readout_s: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.readout_s < 10:
            raise InputError(f"a picture should be read out within 0 to 10 s, got {self.readout_s}")
        if self.kind is ShutterKind.GLOBAL and self.readout_s:
            raise InputError(f"a global shutter reads all rows at once, got a readout of {self.readout_s} s")


@dataclass(frozen=True, slots=True)
class Strip:
    """Rows that are exposed together, and the M parts of their exposure: [start_ns, end_ns), each (M,)."""

    rows: slice
    start_ns: Stamps
    end_ns: Stamps

    @property
    def mid_ns(self) -> Stamps:
        """Where to look from in each part (M,): stratified, so that their mean is the exposure's."""
        return self.start_ns + (self.end_ns - self.start_ns) // 2


def strips(
    height: int, shutter: Shutter, t_ns: int, exposure_s: float, *, row_strips: int, sub_frames: int
) -> list[Strip]:
    """The exposure of a picture stamped t_ns, the middle of the exposure of its middle row, top strip first.

    Strips tile the rows, parts tile the exposure. A strip is timed by its middle row, so its outer rows are off by
    readout / (2 · row_strips); a global shutter needs and gets one strip. Source: Kalibr, row v is v · line delay late.
    """
    exposure_ns, readout_ns = round(exposure_s * NS_PER_S), round(shutter.readout_s * NS_PER_S)
    if exposure_ns < sub_frames or sub_frames < 1:
        raise InputError(f"an exposure of {exposure_ns} ns cannot be cut into {sub_frames} sub-frames")
    if not 1 <= row_strips <= height:
        raise InputError(f"{height} rows cannot be cut into {row_strips} strips")
    count = row_strips if shutter.kind is ShutterKind.ROLLING else 1
    borders = [height * index // count for index in range(count + 1)]
    parts = np.arange(sub_frames + 1, dtype=np.int64) * exposure_ns // sub_frames
    cut = []
    for first, end in pairwise(borders):
        edges = t_ns + _late_ns(first, end, height, readout_ns) - exposure_ns // 2 + parts
        cut.append(Strip(slice(first, end), edges[:-1], edges[1:]))
    return cut


def row_stamps(height: int, shutter: Shutter, t_ns: int) -> Stamps:
    """The middle of each row's exposure (H,) in a picture stamped t_ns."""
    readout_ns = round(shutter.readout_s * NS_PER_S)
    return np.array([t_ns + _late_ns(row, row + 1, height, readout_ns) for row in range(height)], np.int64)


def _late_ns(first: int, end: int, height: int, readout_ns: int) -> int:
    """How much later than the picture's middle row the middle one of rows [first, end) is read, rounded.

    Rows of the lower half are as late as their mirror images are early.
    """
    rows_twice = first + end - height
    rounded = (abs(rows_twice) * readout_ns + height) // (2 * height)
    return rounded if rows_twice >= 0 else -rounded
