"""Exposure: time, gain, auto-exposure, and the shutter's rows. Pure."""

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.sensor.response import FULL_SCALE_DN, Grey
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


# Settings this near to the wanted ones (logarithm) stay: noise and flicker don't make the picture breathe.
DEAD_BAND = 0.02


@dataclass(frozen=True, slots=True)
class Exposure:
    """The exposure of one picture: the time that the shutter is open and the analogue gain."""

    time_s: float
    gain_db: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.time_s < math.inf:
            raise InputError(f"an exposure should last more than 0 s, got {self.time_s}")
        if not 0 <= self.gain_db < math.inf:
            raise InputError(f"gain_db should be 0 or more, got {self.gain_db}")

    @property
    def amplification(self) -> float:
        """Analogue gain as a factor."""
        return float(10 ** (self.gain_db / 20))


@dataclass(frozen=True, slots=True)
class AutoExposure:
    """A first-order loop in the logarithm of time × gain: first time, up to its limit, then gain.

    `target_share` of full scale, linear, is what the mean (or the `percentile`) of a picture should be; a picture
    sets the exposure `lag_frames` later; `damping` is the share of the error that one picture leaves.
    Source: onsemi MT9V034 data sheet: exposure before gain, new settings reach the picture after the next.
    """

    target_share: float = 0.18
    percentile: float | None = None
    lag_frames: int = 2
    damping: float = 0.2
    t_min_s: float = 50e-6
    t_max_s: float = 20e-3
    gain_max_db: float = 12.0

    def __post_init__(self) -> None:
        if not 0 < self.target_share < 1:
            raise InputError(f"target_share should be between 0 and 1, got {self.target_share}")
        if self.percentile is not None and not 0 < self.percentile <= 100:
            raise InputError(f"percentile should be more than 0 and at most 100, got {self.percentile}")
        if self.lag_frames < 1:
            raise InputError(f"lag_frames should be 1 or more, as a picture is first taken, got {self.lag_frames}")
        if not 0 <= self.damping < 1:
            raise InputError(f"damping should be 0 or more and less than 1, got {self.damping}")
        if not 0 < self.t_min_s <= self.t_max_s:
            raise InputError(f"exposure limits should rise, got {self.t_min_s} s to {self.t_max_s} s")
        if not 0 <= self.gain_max_db < math.inf:
            raise InputError(f"gain_max_db should be 0 or more, got {self.gain_max_db}")


@dataclass(frozen=True, slots=True)
class ExposureState:
    """The exposures of the next `lag_frames` pictures, which are settled already."""

    coming: tuple[Exposure, ...]

    @property
    def now(self) -> Exposure:
        """The exposure of the next picture."""
        return self.coming[0]


def start(loop: AutoExposure, exposure: Exposure) -> ExposureState:
    """The loop at rest on an exposure, brought within its limits."""
    return ExposureState((_within(loop, _level(exposure)),) * loop.lag_frames)


def step(loop: AutoExposure, state: ExposureState, grey: Grey, linear_of_grey: Array) -> ExposureState:
    """The state after a picture (H, W) that was taken with `state.now`.

    `linear_of_grey` (256,) is the signal of each grey value in shares of full scale, black level taken off. What is
    wanted is counted from the exposure that the picture had, not from the newest: so no lag makes the loop oscillate.
    """
    metered = max(_meter(loop, grey, linear_of_grey), _darkest(linear_of_grey))
    wanted = _within(loop, _level(state.now) * loop.target_share / metered)
    newest = state.coming[-1]
    error = math.log(_level(wanted) / _level(newest))
    if abs(error) > _dead_band(loop, linear_of_grey):
        newest = _within(loop, _level(newest) * math.exp((1 - loop.damping) * error))
    return ExposureState((*state.coming[1:], newest))


def _level(exposure: Exposure) -> float:
    """Time × gain, in seconds at unit gain."""
    return exposure.time_s * exposure.amplification


def _within(loop: AutoExposure, level_s: float) -> Exposure:
    """The exposure of this level: as much time as allowed, the rest by gain."""
    time_s = min(max(level_s, loop.t_min_s), loop.t_max_s)
    return Exposure(time_s, min(max(20 * math.log10(level_s / time_s), 0.0), loop.gain_max_db))


def _meter(loop: AutoExposure, grey: Grey, linear_of_grey: Array) -> float:
    """The picture's mean, or its percentile, in linear shares of full scale."""
    counts = np.bincount(grey.ravel(), minlength=FULL_SCALE_DN + 1)
    if loop.percentile is None:
        return float(counts @ linear_of_grey) / grey.size
    below = np.cumsum(counts) / grey.size
    # A grey value stands for signals half a step around it.
    level = np.interp(loop.percentile / 100, np.concatenate([[0.0], below]), np.arange(FULL_SCALE_DN + 2) - 0.5)
    return float(np.interp(level, np.arange(FULL_SCALE_DN + 1), linear_of_grey))


def _darkest(linear_of_grey: Array) -> float:
    """The least that a picture can prove: black may be up to half a grey value bright."""
    return float(linear_of_grey[linear_of_grey > 0][0]) / 2


def _dead_band(loop: AutoExposure, linear_of_grey: Array) -> float:
    """Half the grey step at the target, where that is coarser than DEAD_BAND: finer errors can't be seen."""
    above = min(max(int(np.searchsorted(linear_of_grey, loop.target_share)), 1), FULL_SCALE_DN)
    step_share = (linear_of_grey[above] - linear_of_grey[above - 1]) / loop.target_share
    return float(max(DEAD_BAND, step_share / 2))
