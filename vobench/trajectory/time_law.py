"""How far along its way a body is at any time: from rest to rest, evenly, or in stages with pauses."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from vobench.errors import MotionError
from vobench.geometry.se3 import Array

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

LONGEST_S = 86_400.0
SHORTEST_S = 1e-9  # of speeding up: an instant is a whole nanosecond
HALVINGS = 80  # of a day, they leave less than float64 can tell


@dataclass(frozen=True, slots=True)
class TimeLaw:
    """Progress, metres or radians or seconds of a way, as a never falling polynomial in pieces over time in s.

    Raises MotionError where it lasts longer than a day.
    """

    progress: "PPoly"

    def __post_init__(self) -> None:
        if not self.end_s - self.start_s <= LONGEST_S:
            raise MotionError(f"the motion would last {self.end_s - self.start_s:.3g} s; a day is the longest")

    @property
    def start_s(self) -> float:
        """When it begins."""
        return float(self.progress.x[0])

    @property
    def end_s(self) -> float:
        """When it ends."""
        return float(self.progress.x[-1])

    @property
    def breaks_s(self) -> Array:
        """Times at which its third derivative may jump."""
        inner: Array = self.progress.x[1:-1]
        return inner

    @property
    def length(self) -> float:
        """Progress at its end."""
        return float(self.progress(self.end_s))

    def at(self, t_s: Array) -> tuple[Array, Array, Array]:
        """Progress (K,), its rate and the rate's derivative; outside its time it goes on at the rate of its end."""
        inside_s = np.clip(t_s, self.start_s, self.end_s)
        s, rate, change = (self.progress(inside_s, order) for order in range(3))
        return s + rate * (t_s - inside_s), rate, np.where(inside_s == t_s, change, 0.0)

    def when(self, progress: Array) -> Array:
        """The times (B,) at which a progress (B,) is passed, found by halving."""
        early, late = np.full(len(progress), self.start_s), np.full(len(progress), self.end_s)
        for _ in range(HALVINGS):
            middle = (early + late) / 2
            is_before = self.progress(middle) < progress
            early, late = np.where(is_before, middle, early), np.where(is_before, late, middle)
        return late


def rest_to_rest(length: float, *, speed: float, acceleration: float) -> TimeLaw:
    """From rest to `speed` and back to rest over `length`, at most at `acceleration`; a short way is never that fast.

    Speed rises as the quintic 10τ³ - 15τ⁴ + 6τ⁵, so that acceleration begins and ends smoothly.
    Raises MotionError where a figure is not positive, or it would take less than an instant or more than a day.
    """
    named = {"the length of the way": length, "the speed on it": speed, "the acceleration on it": acceleration}
    for name, value in named.items():
        if not (np.isfinite(value) and value > 0):
            raise MotionError(f"{name} is {value:g}; it should be a finite number above 0")
    top = min(speed, float(np.sqrt(length * acceleration * 8 / 15)))
    ramp_s = 15 / 8 * top / acceleration
    cruise_s = length / top - ramp_s
    if not ramp_s >= SHORTEST_S or not cruise_s + 2 * ramp_s <= LONGEST_S:
        raise MotionError(
            f"{length:g} at a speed of {speed:g} and an acceleration of {acceleration:g} takes "
            f"{cruise_s + 2 * ramp_s:.3g} s; it should be from a nanosecond to a day"
        )
    rise = top * np.array([ramp_s**-5, -3 * ramp_s**-4, 2.5 * ramp_s**-3, 0.0, 0.0, 0.0, 0.0])
    even = np.array([0.0, 0.0, 0.0, 0.0, 0.0, top, 0.0])
    stages = [(ramp_s, rise), (cruise_s, even), (ramp_s, even - rise)]
    return _in_turn([stage for stage in stages if stage[0] > 1e-9 * ramp_s])


def evenly(start_s: float, end_s: float, *, begin: float = 0.0, rate: float = 1.0) -> TimeLaw:
    """From `begin` on at a constant rate."""
    return TimeLaw(scipy.interpolate.PPoly(np.array([[rate], [begin]]), np.array([start_s, end_s])))


def in_stages(laws: Sequence[TimeLaw], *, pause_s: float = 0.0) -> TimeLaw:
    """One law after another, each from where the last ended, with rests between. Raises MotionError for its pause."""
    if not (np.isfinite(pause_s) and pause_s >= 0):
        raise MotionError(f"pause_s is {pause_s:g}; it should be a finite number of seconds, 0 or more")
    rest = [(pause_s, np.zeros(7))] if pause_s else []
    return _in_turn([stage for k, law in enumerate(laws) for stage in [*(rest if k else []), *_stages(law)]])


def _stages(law: TimeLaw) -> list[tuple[float, Array]]:
    """Durations and coefficients of a law's polynomials."""
    durations_s = [after - before for before, after in pairwise(law.progress.x)]
    return list(zip(durations_s, law.progress.c.T, strict=True))


def _in_turn(stages: Sequence[tuple[float, Array]]) -> TimeLaw:
    """The law of polynomials (duration, coefficients (7,)), each lifted to where the one before ended."""
    x = np.concatenate([[0.0], np.cumsum([duration_s for duration_s, _ in stages])])
    c = np.stack([coefficients for _, coefficients in stages], -1)
    c[-1] = 0.0
    gained = [np.polyval(c[:, k], duration_s) for k, (duration_s, _) in enumerate(stages)]
    c[-1] = np.concatenate([[0.0], np.cumsum(gained)[:-1]])
    return TimeLaw(scipy.interpolate.PPoly(c, x))
