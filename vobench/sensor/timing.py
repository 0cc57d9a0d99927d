"""When sensors really look: frames that are lost or come twice, stamps that jitter, a late eye or IMU. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from vobench.setting import Share, settings
from vobench.trajectory.trajectory import Stamps

NS_PER_MS = 1e6
STREAMS = ("drop", "repeat", "jitter")
WIDEST_JITTER = 3.0  # standard deviations; a stamp is no further off


@settings()
class Timing:
    """What happens to pictures and readings between sensors and their stamps.

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
        """How far from its stamp a picture can be taken."""
        return WIDEST_JITTER * self.jitter_ms + abs(self.right_delay_ms)


@dataclass(frozen=True, slots=True)
class Schedule:
    """Which of a way's frames come (K,), and of each: its stamp, when both eyes took it, whether it is the last again.

    `index` numbers the frames of the way; all are (K,).
    """

    index: NDArray[np.int64]
    t_ns: Stamps
    left_ns: Stamps
    right_ns: Stamps
    repeats: NDArray[np.bool_]


def schedule(timing: Timing, t_ns: Stamps, rngs: Mapping[str, np.random.Generator], *, before: int = 0) -> Schedule:
    """The frames of a way with stamps t_ns (N,); `rngs` has a generator for each of STREAMS.

    More of a kind adds to what happened before: a frame that is lost at one share is lost at a larger one. The first
    frame and the last always come, and the first shows its own picture. So many of the way's frames come `before`.
    """
    count = len(t_ns)
    chances = {name: rngs[name].random(before + count) for name in ("drop", "repeat")}
    jitter = np.clip(rngs["jitter"].standard_normal(before + count)[before:], -WIDEST_JITTER, WIDEST_JITTER)
    begins = chances["drop"] < timing.drop_share / timing.drop_burst
    lost = np.convolve(begins, np.ones(timing.drop_burst, int))[before : before + count] > 0
    lost[[0, -1]] = False
    index = np.flatnonzero(~lost)
    left_ns = t_ns + np.rint(jitter * timing.jitter_ms * NS_PER_MS).astype(np.int64)
    right_ns = left_ns + round(timing.right_delay_ms * NS_PER_MS)
    repeats = chances["repeat"][before + index] < timing.repeat_share
    repeats[0] = False
    shown = index[np.maximum.accumulate(np.where(repeats, 0, np.arange(len(index))))]
    return Schedule(index, t_ns[index], left_ns[shown], right_ns[shown], repeats)
