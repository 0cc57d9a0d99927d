"""Three gyroscopes or three accelerometers at right angles: what they make of the truth."""

from dataclasses import dataclass
from math import exp, expm1, inf, isfinite, sqrt

import numpy as np

from vobench.errors import InputError
from vobench.geometry.se3 import Array

Axes = tuple[float, float, float]
EYE: tuple[Axes, Axes, Axes] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Triad:
    """Reading = gain · truth + bias + white noise, cut off at ± limit and rounded to whole steps.

    With U the unit read: noise in U/√Hz, walk in U/s/√Hz, forgotten after correlation_s (inf: never); bias,
    bias_std (what each start adds to it by chance), limit and step (0: not rounded) in U. The gain's diagonal is
    scale, the rest misalignment. Raises InputError where a value is none.
    """

    noise: float = 0.0
    walk: float = 0.0
    correlation_s: float = inf
    bias: Axes = (0.0, 0.0, 0.0)
    bias_std: float = 0.0
    gain: tuple[Axes, Axes, Axes] = EYE
    limit: float = inf
    step: float = 0.0

    def __post_init__(self) -> None:
        for name in ("noise", "walk", "bias_std", "step"):
            value = getattr(self, name)
            if not (value >= 0 and isfinite(value)):
                raise InputError(f"an IMU's {name} should be finite and 0 or more, got {value}")
        for name in ("correlation_s", "limit"):
            value = getattr(self, name)
            if not value > 0:
                raise InputError(f"an IMU's {name} should be more than 0, or inf for none, got {value}")
        for name, shape in (("bias", (3,)), ("gain", (3, 3))):
            value = np.asarray(getattr(self, name), float)
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(f"an IMU's {name} should be {shape} finite numbers, got {getattr(self, name)}")


FLAWLESS = Triad()


def started(triad: Triad, draw: Array) -> Array:
    """The bias (3,) that this start begins with, for standard normal numbers (3,)."""
    return np.asarray(triad.bias) + triad.bias_std * draw


def walked(triad: Triad, draws: Array, *, step_s: float) -> Array:
    """How far the bias has walked (M, 3) for standard normal numbers (M, 3): exact for any step.

    A walk that is never forgotten begins at 0. One that is has the spread walk √(correlation_s / 2) from the
    first reading on. Source: Kalibr's IMU noise model; Gillespie (1996) for the exact step with memory.
    """
    if triad.correlation_s == inf:
        shocks = triad.walk * sqrt(step_s) * draws
        shocks[:1] = 0.0
        return np.cumsum(shocks, axis=0)
    from scipy.signal import lfilter

    spread = triad.walk * sqrt(triad.correlation_s / 2)
    shocks = spread * draws
    shocks[1:] *= sqrt(-expm1(-2 * step_s / triad.correlation_s))
    walk: Array = lfilter([1.0], [1.0, -exp(-step_s / triad.correlation_s)], shocks, axis=0)
    return walk


def read_out(triad: Triad, true: Array, bias: Array, draws: Array, *, step_s: float) -> Array:
    """Readings (M, 3) of the truth (M, 3), with a bias (M, 3) and standard normal numbers (M, 3).

    A density of white noise is that of the mean over a step when divided by the step's root: what is
    read half as often is less noisy. Source: Kalibr's IMU noise model.
    """
    analogue = true @ np.asarray(triad.gain).T + bias + triad.noise / sqrt(step_s) * draws
    cut: Array = np.clip(analogue, -triad.limit, triad.limit)
    return triad.step * np.rint(cut / triad.step) if triad.step else cut
