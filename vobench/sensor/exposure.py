"""Exposure: time, gain, auto-exposure, and the shutter's rows. Pure."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from vobench.errors import InputError, SettingError
from vobench.geometry.se3 import Array
from vobench.sensor.response import FULL_SCALE_DN, Grey
from vobench.setting import NonNegative, Positive, settings
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps

MS_PER_S = 1e3


@dataclass(frozen=True, slots=True)
class RowStrip:
    """Rows that are exposed together, and the M parts of their exposure: [start_ns, end_ns), each (M,)."""

    rows: slice
    start_ns: Stamps
    end_ns: Stamps

    @property
    def mid_ns(self) -> Stamps:
        """The middle of each part (M,), for which its rows are rendered."""
        length_ns = self.end_ns - self.start_ns
        return self.start_ns + length_ns // 2


def strips(
    height: int,
    readout_s: float,
    t_ns: int,
    exposure_s: float,
    *,
    row_strips: int,
    sub_frames: int,
) -> list[RowStrip]:
    """The exposure of a picture, strip by strip from the top; t_ns is the middle of its middle row's exposure.

    `readout_s` is the time from the first row to the one that would follow the last, 0 for a global shutter.
    Strips tile the rows, parts tile the exposure. A strip has the time of its middle row, so its outer rows are off by
    readout / (2 · row_strips); a global shutter needs and gets one strip.
    Raises InputError for fewer than one part or strip, or more than there are nanoseconds or rows.
    Source: Kalibr, row v is v · line delay late.
    """
    exposure_ns = round(exposure_s * NS_PER_S)
    readout_ns = round(readout_s * NS_PER_S)
    if exposure_ns < sub_frames or sub_frames < 1:
        raise InputError(f"an exposure of {exposure_ns} ns cannot be divided into {sub_frames} sub-frames")
    if not 1 <= row_strips <= height:
        raise InputError(f"{height} rows cannot be divided into {row_strips} strips")
    count = row_strips if readout_ns else 1
    borders = [height * index // count for index in range(count + 1)]  # rows
    offsets_ns = np.arange(sub_frames + 1, dtype=np.int64) * exposure_ns // sub_frames  # since the exposure's start

    all_strips = []
    for first, end in pairwise(borders):
        start_ns = t_ns + _delay_ns(first, end, height, readout_ns) - exposure_ns // 2
        edges_ns = start_ns + offsets_ns
        all_strips.append(RowStrip(slice(first, end), edges_ns[:-1], edges_ns[1:]))
    return all_strips


def row_stamps(height: int, readout_s: float, t_ns: int) -> Stamps:
    """The middle of each row's exposure (H,) in a picture stamped t_ns."""
    readout_ns = round(readout_s * NS_PER_S)
    stamps = [t_ns + _delay_ns(row, row + 1, height, readout_ns) for row in range(height)]
    return np.array(stamps, np.int64)


def _delay_ns(
    first: int,
    end: int,
    height: int,
    readout_ns: int,
) -> int:
    """The delay of the middle of rows [first, end) after the picture's middle, rounded.

    It is odd about the middle: rows of the lower half are as late as their mirror images are early.
    """
    rows_twice = first + end - height
    rounded = (abs(rows_twice) * readout_ns + height) // (2 * height)
    return rounded if rows_twice >= 0 else -rounded


# Errors of the exposure (logarithm) up to this are not corrected, so that noise and flicker don't change it.
DEAD_BAND = 0.02


@settings(kw_only=False)
class Exposure:
    """The exposure of one picture: the time that the shutter is open and the analogue gain."""

    time_s: Positive
    gain_db: NonNegative = 0.0

    @property
    def amplification(self) -> float:
        """Analogue gain as a factor."""
        return float(10 ** (self.gain_db / 20))


@settings()
class AutoExposure:
    """A first-order loop in the logarithm of time × gain: first time, up to its limit, then gain.

    `target_share` of full scale, linear, is what the mean (or the `percentile`) of a picture should be; a picture
    sets the exposure `lag_frames` later; `damping` is the share of the error that one picture leaves.
    Source: onsemi MT9V034 data sheet: exposure before gain, new settings reach the picture after the next.
    """

    target_share: Annotated[float, Gt(0), Lt(1)] = 0.18
    percentile: Annotated[float, Gt(0), Le(100)] | None = None
    lag_frames: Annotated[int, Ge(1), Le(10)] = 2
    damping: Annotated[float, Ge(0), Lt(1)] = 0.2
    t_min_ms: Positive = 0.05
    t_max_ms: Positive = 20.0
    gain_max_db: Annotated[float, Ge(0), Le(48)] = 12.0

    def __post_init__(self) -> None:
        if self.t_min_ms > self.t_max_ms:
            raise SettingError(
                f"should be at most t_max_ms, but is {self.t_min_ms:g} against {self.t_max_ms:g}", "t_min_ms"
            )


# The exposures of the next `lag_frames` pictures, which are decided already.
PendingExposures = tuple[Exposure, ...]


def initial_exposures(loop: AutoExposure, exposure: Exposure) -> PendingExposures:
    """The loop at rest on an exposure, clipped to its limits."""
    settled = _within(loop, _level(exposure))
    return (settled,) * loop.lag_frames


def next_exposures(
    loop: AutoExposure,
    pending: PendingExposures,
    grey: Grey,
    linear_of_grey: Array,
) -> PendingExposures:
    """The pending exposures after a picture (H, W) that was taken with the first of `pending`.

    `linear_of_grey` (256,) is the signal of each grey value in shares of full scale, without the black level. The
    error is that of the exposure that the picture had, not of the newest one, so that no lag makes the loop oscillate.
    """
    darkest = float(linear_of_grey[linear_of_grey > 0][0]) / 2  # black may be up to half a grey value bright
    metered = max(_meter(loop, grey, linear_of_grey), darkest)
    target = _within(loop, _level(pending[0]) * loop.target_share / metered)
    newest = pending[-1]
    error = math.log(_level(target) / _level(newest))
    if abs(error) > _dead_band(loop, linear_of_grey):
        correction = math.exp((1 - loop.damping) * error)
        newest = _within(loop, _level(newest) * correction)
    return (*pending[1:], newest)


def _level(exposure: Exposure) -> float:
    """Time × gain, in seconds at unit gain."""
    return exposure.time_s * exposure.amplification


def _within(loop: AutoExposure, level_s: float) -> Exposure:
    """The exposure of a level: as much time as allowed, the rest by gain."""
    shortest_s = loop.t_min_ms / MS_PER_S
    longest_s = loop.t_max_ms / MS_PER_S
    time_s = min(max(level_s, shortest_s), longest_s)
    gain_db = 20 * math.log10(level_s / time_s)
    return Exposure(time_s, min(max(gain_db, 0.0), loop.gain_max_db))


def _meter(loop: AutoExposure, grey: Grey, linear_of_grey: Array) -> float:
    """The picture's mean, or its percentile, in linear shares of full scale."""
    counts = np.bincount(grey.ravel(), minlength=FULL_SCALE_DN + 1)
    if loop.percentile is None:
        return float(counts @ linear_of_grey) / grey.size
    # A grey value stands for signals half a step below and above it.
    edges_dn = np.arange(FULL_SCALE_DN + 2) - 0.5
    share_below = np.concatenate([[0.0], np.cumsum(counts) / grey.size])
    percentile_dn = np.interp(loop.percentile / 100, share_below, edges_dn)
    return float(np.interp(percentile_dn, np.arange(FULL_SCALE_DN + 1), linear_of_grey))


def _dead_band(loop: AutoExposure, linear_of_grey: Array) -> float:
    """DEAD_BAND, or half the grey step at the target if that is larger, as smaller errors can't be seen."""
    place = int(np.searchsorted(linear_of_grey, loop.target_share))
    above = min(max(place, 1), FULL_SCALE_DN)
    step_share = (linear_of_grey[above] - linear_of_grey[above - 1]) / loop.target_share
    return float(max(DEAD_BAND, step_share / 2))
