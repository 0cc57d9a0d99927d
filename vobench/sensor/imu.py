"""An IMU after Kalibr's model: angular rate and specific force, noise, bias, presets."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, expm1, pi, sqrt
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.rig import ImuCalibration
from vobench.geometry.se3 import Array
from vobench.setting import Positive, settings
from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2, Kinematics, Motion
from vobench.trajectory.trajectory import Stamps

Size = Annotated[float, Ge(0), Le(1e3)]
Number = Annotated[float, Ge(-1e3), Le(1e3)]
Axes = tuple[Number, Number, Number]
EYE: tuple[Axes, Axes, Axes] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@settings()
class Triad:
    """Reading = gain · truth + bias + white noise, cut off at ± limit and rounded to whole steps.

    With U the unit read: noise in U/√Hz, walk in U/s/√Hz, forgotten after correlation_s (None: never); bias,
    bias_std (what each start adds to it by chance), limit (None: not cut off) and step (0: not rounded) in U.
    The gain's diagonal is scale, the rest misalignment.
    """

    noise: Size = 0.0
    walk: Size = 0.0
    correlation_s: Positive | None = None
    bias: Axes = (0.0, 0.0, 0.0)
    bias_std: Size = 0.0
    gain: tuple[Axes, Axes, Axes] = EYE
    limit: Positive | None = None
    step: Size = 0.0


FLAWLESS = Triad()


def started(triad: Triad, draw: Array) -> Array:
    """The bias (3,) that this start begins with, for standard normal numbers (3,)."""
    return np.asarray(triad.bias) + triad.bias_std * draw


def walked(triad: Triad, draws: Array, *, step_s: float) -> Array:
    """How far the bias has walked (M, 3) for standard normal numbers (M, 3): exact for any step.

    A walk that is never forgotten begins at 0. One that is has the spread walk √(correlation_s / 2) from the
    first reading on. Source: Kalibr's IMU noise model; Gillespie (1996) for the exact step with memory.
    """
    if triad.correlation_s is None:
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
    cut: Array = analogue if triad.limit is None else np.clip(analogue, -triad.limit, triad.limit)
    return triad.step * np.rint(cut / triad.step) if triad.step else cut


AT_ONCE = 4096  # readings: what is held in memory does not grow with the motion's length


def reading_stamps(motion: Motion, rate_hz: float) -> Stamps:
    """Stamps (M,) index / rate from a motion's start up to its end."""
    lasts_ns = motion.end_ns - motion.start_ns
    since_ns = np.rint(np.arange(int(lasts_ns * rate_hz / 1e9) + 2) * 1e9 / rate_hz).astype(np.int64)
    stamps: Stamps = motion.start_ns + since_ns[since_ns <= lasts_ns]
    return stamps


def mean_inertia(motion: Motion, T_body_imu: Array, rate_hz: float, *, count: int) -> Array:
    """Mean angular rate and specific force (2, count, 3) in the IMU's axes, over 1 / rate around each stamp.

    Neighbouring means share their edges, so they add up to the whole motion also where it jerks.
    """
    means = np.empty((2, count, 3))
    breaks_ns = np.append(motion.breaks_ns, [motion.start_ns, motion.end_ns]) - motion.start_ns
    for first in range(0, count, AT_ONCE):
        last = min(first + AT_ONCE, count)
        edges_ns = (np.arange(first, last + 1, dtype=np.float64) - 0.5) * 1e9 / rate_hz
        means[:, first:last] = _means_between(motion, T_body_imu, edges_ns, breaks_ns)
    return means


def _means_between(motion: Motion, T_body_imu: Array, edges_ns: Array, breaks_ns: Array) -> Array:
    """Means (2, M, 3) between edges (M + 1,), in ns since the start: Gauss-Legendre on each smooth piece."""
    within = breaks_ns[(breaks_ns > edges_ns[0]) & (breaks_ns < edges_ns[-1])]
    cuts_ns = np.union1d(edges_ns, within)
    half_ns = np.diff(cuts_ns) / 2
    middle_ns = (cuts_ns[1:] + cuts_ns[:-1]) / 2
    # 3 nodes a piece leave 1e-10 of an 8 Hz shake over 5 ms; longer pieces need more.
    nodes, weights = np.polynomial.legendre.leggauss(min(3 + int(half_ns.max() * 2e-9 / 0.02), 16))
    t_ns = motion.start_ns + middle_ns[:, None] + half_ns[:, None] * nodes
    felt = _felt(motion.at(t_ns.ravel()).of_mounted(T_body_imu)).reshape(2, *t_ns.shape, 3)
    pieces = np.einsum("apni,n,p->api", felt, weights / 2, 2 * half_ns)
    begin = np.searchsorted(cuts_ns, edges_ns[:-1])
    lasts_ns = np.add.reduceat(2 * half_ns, begin)
    means: Array = np.add.reduceat(pieces, begin, axis=1) / lasts_ns[:, None]
    return means


def _felt(imu: Kinematics) -> Array:
    """Angular rate and specific force (2, K, 3): R'(a - g), which is upwards at rest."""
    up = imu.T_world_body[:, 2, :3]  # the world's z axis in the IMU's axes
    return np.stack([imu.turn_radps, imu.acceleration_mps2 + STANDARD_GRAVITY_MPS2 * up])


# The random streams, one for each process: switching one off leaves the others as they were.
STREAMS = ("gyro_white", "accel_white", "gyro_walk", "accel_walk", "start_bias")
Generators = Mapping[str, np.random.Generator]


@dataclass(frozen=True, slots=True)
class ImuReadings:
    """What an IMU says, in its own axes: t_ns (M,), gyro_radps (M, 3), accel_mps2 (M, 3) with gravity's reaction."""

    t_ns: Stamps
    gyro_radps: Array
    accel_mps2: Array


@dataclass(frozen=True, slots=True)
class ImuBias:
    """The biases in readings, in the IMU's axes: t_ns (M,), gyro_radps (M, 3), accel_mps2 (M, 3)."""

    t_ns: Stamps
    gyro_radps: Array
    accel_mps2: Array


@settings()
class ImuSettings:
    """An IMU as it is: how often it reads, where it sits, its gyroscopes (rad/s) and accelerometers (m/s²).

    `rotation_deg` is roll, pitch and yaw, turned about fixed axes in that order.
    """

    rate_hz: Annotated[float, Ge(1), Le(10_000)] = 200.0
    position_m: Axes = (0.0, 0.0, 0.0)
    rotation_deg: Axes = (0.0, 0.0, 0.0)
    gyro: Triad = FLAWLESS
    accel: Triad = FLAWLESS

    @property
    def T_body_imu(self) -> Array:
        """Its pose (4, 4) on the body."""
        from scipy.spatial.transform import Rotation

        R_body_imu = Rotation.from_euler("xyz", self.rotation_deg, degrees=True).as_matrix()
        return se3.transform(R_body_imu, np.array(self.position_m))

    @property
    def calibration(self) -> ImuCalibration:
        """What an honest calibration says of it: its place, its rate and the four densities."""
        g = self.gyro
        a = self.accel
        return ImuCalibration(self.T_body_imu, self.rate_hz, g.noise, a.noise, g.walk, a.walk)


def measure(motion: Motion, settings: ImuSettings, *, rngs: Generators | None = None) -> tuple[ImuReadings, ImuBias]:
    """Readings over the whole of a motion, and the biases in them; `rngs` holds the generators of STREAMS.

    A reading is the mean over the 1 / rate_hz around its stamp, so that readings add up to the motion.
    Raises InputError where something is left to chance and its generator is missing.
    """
    step_s = 1 / settings.rate_hz
    t_ns = reading_stamps(motion, settings.rate_hz)
    truth = mean_inertia(motion, settings.T_body_imu, settings.rate_hz, count=len(t_ns))
    triads = {"gyro": settings.gyro, "accel": settings.accel}
    starts = _draws("start_bias", 2, max(triad.bias_std for triad in triads.values()), rngs)
    readings = []
    biases = []
    for (name, triad), true, start in zip(triads.items(), truth, starts, strict=True):
        walk = walked(triad, _draws(f"{name}_walk", len(t_ns), triad.walk, rngs), step_s=step_s)
        biases.append(started(triad, start) + walk)
        white = _draws(f"{name}_white", len(t_ns), triad.noise, rngs)
        readings.append(read_out(triad, true, biases[-1], white, step_s=step_s))
    return ImuReadings(t_ns, *readings), ImuBias(t_ns, *biases)


def _draws(stream: str, count: int, size: float, rngs: Generators | None) -> Array:
    """Standard normal numbers (count, 3) of a stream; zeros where what they are for has no size."""
    if not size:
        return np.zeros((count, 3))
    if rngs is None or stream not in rngs:
        raise InputError(f"an IMU needs a random generator for each of {', '.join(STREAMS)}; {stream!r} is missing")
    return rngs[stream].standard_normal((count, 3))


DEG = pi / 180
DEG_PER_HOUR = DEG / 3600
MILLI_G = STANDARD_GRAVITY_MPS2 / 1000


def _walk(spread: float, correlation_s: float) -> float:
    """The density of a walk that stays within `spread` (one sigma) because it is forgotten after correlation_s."""
    return spread * sqrt(2 / correlation_s)


IMUS = {
    "exact": ImuSettings(),
    "adis16448": ImuSettings(
        gyro=Triad(noise=1.6968e-4, walk=1.9393e-5, bias_std=0.5 * DEG, limit=1000 * DEG, step=DEG / 25),
        accel=Triad(noise=2e-3, walk=3e-3, bias_std=20 * MILLI_G, limit=18e3 * MILLI_G, step=1e3 * MILLI_G / 1200),
    ),
    "mpu6000": ImuSettings(
        gyro=Triad(
            noise=0.30 * DEG / 60,
            walk=_walk(4.6 * DEG_PER_HOUR, 500),
            correlation_s=500,
            limit=2000 * DEG,
            step=DEG / 16.4,
        ),
        accel=Triad(
            noise=0.24 * MILLI_G,
            walk=_walk(0.036 * MILLI_G, 800),
            correlation_s=800,
            limit=16e3 * MILLI_G,
            step=1e3 * MILLI_G / 2048,
        ),
    ),
    "bmi055": ImuSettings(
        gyro=Triad(
            noise=0.014 * DEG,
            walk=_walk(2 * DEG_PER_HOUR, 100),
            correlation_s=100,
            bias_std=1 * DEG,
            limit=1000 * DEG,
            step=DEG / 32.8,
        ),
        accel=Triad(
            noise=0.15 * MILLI_G,
            walk=_walk(0.03 * MILLI_G, 100),
            correlation_s=100,
            bias_std=70 * MILLI_G,
            limit=4e3 * MILLI_G,
            step=1e3 * MILLI_G / 512,
        ),
    ),
}
