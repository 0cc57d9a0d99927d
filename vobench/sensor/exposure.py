"""Exposure time and gain, and auto-exposure."""

import math
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from vobench.errors import SettingError
from vobench.geometry.se3 import Array
from vobench.sensor.response import FULL_SCALE_DN, Grey
from vobench.setting import NonNegative, Positive, settings

MS_PER_S = 1e3
# An error of the exposure (natural logarithm) below this is not corrected, so that noise and flicker do not change the
# exposure. The value is an assumption.
DEAD_BAND = 0.02


@settings(kw_only=False)
class Exposure:
    """The exposure time and the analogue gain of one picture."""

    time_s: Positive
    gain_db: NonNegative = 0.0

    @property
    def amplification(self) -> float:
        """The analogue gain as a factor."""
        return float(10 ** (self.gain_db / 20))


@settings()
class AutoExposure:
    """A first-order control loop on the logarithm of exposure time × gain.

    The loop raises the exposure time up to its limit before it raises the gain.
    `target_share` is the linear brightness that a picture should have, as a share of full scale.
    `percentile` is the percentile of brightness that is measured; None measures the mean.
    `lag_frames` is the number of pictures from a measurement to the first picture with the new exposure.
    `damping` is the share of the error that remains after one correction.
    Source: onsemi MT9V034 data sheet (exposure before gain; settings take effect in the picture after the next).
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


# The exposures of the next `lag_frames` pictures, which can no longer change.
PendingExposures = tuple[Exposure, ...]


def initial_exposures(loop: AutoExposure, exposure: Exposure) -> PendingExposures:
    """The pending exposures of a loop that starts at an exposure, clipped to the loop's limits."""
    clipped = _exposure_of_level(loop, _level_s(exposure))
    return (clipped,) * loop.lag_frames


def next_exposures(
    loop: AutoExposure,
    pending: PendingExposures,
    grey: Grey,
    linear_of_grey: Array,
) -> PendingExposures:
    """The pending exposures after a picture `grey` (H, W) that was taken with the first of `pending`.

    `linear_of_grey` (256,) is the signal at each grey value, without the black level, as a share of full scale.
    The target follows from the exposure with which the picture was taken, not from the newest one. The loop therefore
    does not oscillate for any lag.
    """
    measured = max(_brightness(loop, grey, linear_of_grey), _black_share(linear_of_grey))
    target = _exposure_of_level(loop, _level_s(pending[0]) * loop.target_share / measured)

    newest = pending[-1]
    error = math.log(_level_s(target) / _level_s(newest))
    if abs(error) <= _dead_band(loop, linear_of_grey):
        return (*pending[1:], newest)
    correction = math.exp((1 - loop.damping) * error)
    corrected = _exposure_of_level(loop, _level_s(newest) * correction)
    return (*pending[1:], corrected)


def _level_s(exposure: Exposure) -> float:
    """The exposure's level: the product of its time and gain, which is the equivalent time at unit gain."""
    return exposure.time_s * exposure.amplification


def _exposure_of_level(loop: AutoExposure, level_s: float) -> Exposure:
    """The exposure with a level, clipped to the loop's limits; the gain is raised only at the longest time."""
    shortest_s = loop.t_min_ms / MS_PER_S
    longest_s = loop.t_max_ms / MS_PER_S
    time_s = min(max(level_s, shortest_s), longest_s)
    gain_db = 20 * math.log10(level_s / time_s)
    return Exposure(time_s, min(max(gain_db, 0.0), loop.gain_max_db))


def _black_share(linear_of_grey: Array) -> float:
    """The largest signal that can look black, as a share of full scale.

    It is half of the signal at the smallest grey value whose signal is positive.
    """
    positive_shares = linear_of_grey[linear_of_grey > 0]
    return float(positive_shares[0]) / 2


def _brightness(loop: AutoExposure, grey: Grey, linear_of_grey: Array) -> float:
    """The mean of a picture, or the loop's percentile, as a linear share of full scale."""
    counts = np.bincount(grey.ravel(), minlength=FULL_SCALE_DN + 1)
    if loop.percentile is None:
        return float(counts @ linear_of_grey) / grey.size
    # A grey value represents the signals from half a step below to half a step above it.
    edges_dn = np.arange(FULL_SCALE_DN + 2) - 0.5
    shares_below_edges = np.concatenate([[0.0], np.cumsum(counts) / grey.size])
    percentile_dn = np.interp(loop.percentile / 100, shares_below_edges, edges_dn)
    return float(np.interp(percentile_dn, np.arange(FULL_SCALE_DN + 1), linear_of_grey))


def _dead_band(loop: AutoExposure, linear_of_grey: Array) -> float:
    """The largest error that is not corrected: DEAD_BAND, or half a grey step at the target if that is larger.

    A picture cannot show an error of less than half a grey step.
    """
    first_brighter_dn = int(np.searchsorted(linear_of_grey, loop.target_share))
    upper_dn = min(max(first_brighter_dn, 1), FULL_SCALE_DN)
    step_share = linear_of_grey[upper_dn] - linear_of_grey[upper_dn - 1]
    relative_step = step_share / loop.target_share
    return float(max(DEAD_BAND, relative_step / 2))
