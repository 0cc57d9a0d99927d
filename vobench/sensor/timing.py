"""Errors of timing: lost and repeated frames, jitter of stamps, delays of the right camera or the IMU. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from vobench.setting import Share, settings
from vobench.trajectory.nanoseconds import NS_PER_MS
from vobench.trajectory.trajectory import Stamps

STREAMS = ("drop", "repeat", "jitter")
WIDEST_JITTER = 3.0  # standard deviations; larger draws are clipped


@settings()
class Timing:
    """Delays, losses and repetitions of pictures and readings between the sensors and their stamps.

    Of all frames `drop_share` are lost, `drop_burst` in a row; `repeat_share` of them show the picture before again.
    A picture is taken `jitter_ms` (standard deviation) beside its stamp, the right one `right_delay_ms` later still.
    A reading of the IMU is stamped `imu_delay_ms` after it was taken, by the clock of the pictures.
    """

    drop_share: Annotated[Share, Le(0.9)] = 0.0
    drop_burst: Annotated[int, Ge(1), Le(1000)] = 1
    repeat_share: Annotated[Share, Le(0.9)] = 0.0
    jitter_ms: Annotated[float, Ge(0), Le(100)] = 0.0
    right_delay_ms: Annotated[float, Ge(-100), Le(100)] = 0.0
    imu_delay_ms: Annotated[float, Ge(-1000), Le(1000)] = 0.0

    @property
    def latest_ms(self) -> float:
        """The most that a picture is taken before or after its stamp."""
        return WIDEST_JITTER * self.jitter_ms + abs(self.right_delay_ms)


@dataclass(frozen=True, slots=True)
class Schedule:
    """The frames of a motion that are delivered, all (K,): stamps, when each camera took them, and repetitions.

    `index` numbers the frames of the motion; `repeats` marks frames that show the picture before again.
    """

    index: NDArray[np.int64]
    t_ns: Stamps
    left_ns: Stamps
    right_ns: Stamps
    repeats: NDArray[np.bool_]


def schedule(
    timing: Timing,
    t_ns: Stamps,
    rngs: Mapping[str, np.random.Generator],
    *,
    before: int = 0,
) -> Schedule:
    """The frames of a motion with stamps t_ns (N,); `rngs` has a generator for each of STREAMS.

    A larger share adds to the effects of a smaller one: a frame that is lost at one share is lost at a larger one. The
    first and the last frame are never lost, and the first is never a repetition. `before` is the number of earlier
    frames of the same motion, which use up the first random numbers.
    """
    count = len(t_ns)
    drop_chance = rngs["drop"].random(before + count)
    repeat_chance = rngs["repeat"].random(before + count)
    draws = rngs["jitter"].standard_normal(before + count)[before:]
    jitter = np.clip(draws, -WIDEST_JITTER, WIDEST_JITTER)  # standard deviations

    burst_begins = drop_chance < timing.drop_share / timing.drop_burst
    bursts = np.convolve(burst_begins, np.ones(timing.drop_burst, int))
    lost = bursts[before : before + count] > 0
    lost[[0, -1]] = False
    index = np.flatnonzero(~lost)

    jitter_ns = np.rint(jitter * timing.jitter_ms * NS_PER_MS).astype(np.int64)
    left_ns = t_ns + jitter_ns
    right_ns = left_ns + round(timing.right_delay_ms * NS_PER_MS)

    repeats = repeat_chance[before + index] < timing.repeat_share
    repeats[0] = False
    delivered = np.arange(len(index))
    own_picture = np.where(repeats, 0, delivered)
    shown = index[np.maximum.accumulate(own_picture)]  # the frame of the motion whose picture each one shows
    return Schedule(index, t_ns[index], left_ns[shown], right_ns[shown], repeats)
