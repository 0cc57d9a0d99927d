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
from vobench.trajectory.nanoseconds import NS_PER_S
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


def initial_bias(triad: Triad, draw: Array) -> Array:
    """The initial bias (3,) of one start, for standard normal numbers (3,)."""
    return np.asarray(triad.bias) + triad.bias_std * draw


def random_walk(triad: Triad, draws: Array, *, step_s: float) -> Array:
    """The random walk of the bias (M, 3) for standard normal numbers (M, 3): exact for any step.

    Without a correlation time it begins at 0. With one it is stationary, with the standard deviation
    walk √(correlation_s / 2) from the first reading on.
    Source: Kalibr's IMU noise model; Gillespie (1996) for the exact step of a correlated walk.
    """
    if triad.correlation_s is None:
        shocks = triad.walk * sqrt(step_s) * draws
        shocks[:1] = 0.0
        return np.cumsum(shocks, axis=0)
    from scipy.signal import lfilter

    stationary_std = triad.walk * sqrt(triad.correlation_s / 2)
    shocks = stationary_std * draws
    shocks[1:] *= sqrt(-expm1(-2 * step_s / triad.correlation_s))
    decay = exp(-step_s / triad.correlation_s)
    walk: Array = lfilter([1.0], [1.0, -decay], shocks, axis=0)
    return walk


def readings_of(
    triad: Triad,
    true: Array,
    bias: Array,
    draws: Array,
    *,
    step_s: float,
) -> Array:
    """Readings (M, 3) of the truth (M, 3), with a bias (M, 3) and standard normal numbers (M, 3).

    White noise of a density has the standard deviation density / √step in the mean over a step, so that readings at a
    lower rate are less noisy. Source: Kalibr's IMU noise model.
    """
    gain = np.asarray(triad.gain)
    white_std = triad.noise / sqrt(step_s)
    readings: Array = true @ gain.T + bias + white_std * draws
    if triad.limit is not None:
        readings = np.clip(readings, -triad.limit, triad.limit)
    if triad.step:
        readings = triad.step * np.rint(readings / triad.step)
    return readings


BLOCK = 4096  # readings that are computed at once, so that memory does not grow with the motion's length


def reading_stamps(motion: Motion, rate_hz: float) -> Stamps:
    """Stamps (M,) index / rate from a motion's start up to its end."""
    duration_ns = motion.end_ns - motion.start_ns
    count = int(duration_ns * rate_hz / NS_PER_S) + 2  # with one or two that lie beyond the end
    exact_ns = np.arange(count) * float(NS_PER_S) / rate_hz
    offsets_ns = np.rint(exact_ns).astype(np.int64)
    stamps: Stamps = motion.start_ns + offsets_ns[offsets_ns <= duration_ns]
    return stamps


def mean_inertia(
    motion: Motion,
    T_body_imu: Array,
    rate_hz: float,
    *,
    count: int,
) -> Array:
    """Mean angular rate and specific force (2, count, 3) in the IMU's axes, over 1 / rate around each stamp.

    Neighbouring intervals share their edges, so the means add up to the whole motion, also where it jerks.
    """
    means = np.empty((2, count, 3))
    breaks_ns = np.append(motion.breaks_ns, [motion.start_ns, motion.end_ns]) - motion.start_ns
    for first in range(0, count, BLOCK):
        last = min(first + BLOCK, count)
        edges = np.arange(first, last + 1, dtype=np.float64) - 0.5  # in steps
        edges_ns = edges * NS_PER_S / rate_hz
        means[:, first:last] = _means_between(motion, T_body_imu, edges_ns, breaks_ns)
    return means


NODES_PER_PIECE = 3  # leave 1e-10 of an 8 Hz shake over 5 ms; longer pieces need more
SECONDS_PER_NODE = 0.02
MOST_NODES = 16


def _means_between(
    motion: Motion,
    T_body_imu: Array,
    edges_ns: Array,
    breaks_ns: Array,
) -> Array:
    """Means (2, M, 3) between edges (M + 1,), in ns since the start: Gauss-Legendre on each smooth piece."""
    is_inside = (breaks_ns > edges_ns[0]) & (breaks_ns < edges_ns[-1])
    ends_ns = np.union1d(edges_ns, breaks_ns[is_inside])  # of P pieces, (P + 1,)
    half_ns = np.diff(ends_ns) / 2
    middle_ns = (ends_ns[1:] + ends_ns[:-1]) / 2
    longest_s = half_ns.max() * 2e-9
    node_count = min(NODES_PER_PIECE + int(longest_s / SECONDS_PER_NODE), MOST_NODES)
    nodes, weights = np.polynomial.legendre.leggauss(node_count)

    t_ns = motion.start_ns + middle_ns[:, None] + half_ns[:, None] * nodes  # (P, nodes)
    kinematics = motion.at(t_ns.ravel()).of_mounted(T_body_imu)
    inertia = _inertia(kinematics).reshape(2, *t_ns.shape, 3)
    integrals = np.einsum("apni,n,p->api", inertia, weights / 2, 2 * half_ns)  # of each piece

    first_pieces = np.searchsorted(ends_ns, edges_ns[:-1])  # of each interval between edges
    duration_ns = np.add.reduceat(2 * half_ns, first_pieces)
    totals = np.add.reduceat(integrals, first_pieces, axis=1)
    means: Array = totals / duration_ns[:, None]
    return means


def _inertia(imu: Kinematics) -> Array:
    """Angular rate and specific force (2, K, 3): R'(a - g), which is upwards at rest."""
    up = imu.T_world_body[:, 2, :3]  # the world's z axis in the IMU's axes
    specific_force_mps2 = imu.acceleration_mps2 + STANDARD_GRAVITY_MPS2 * up
    return np.stack([imu.angular_velocity_radps, specific_force_mps2])


# The random streams, one for each process: switching one off does not change the others.
STREAMS = ("gyro_white", "accel_white", "gyro_walk", "accel_walk", "start_bias")
Generators = Mapping[str, np.random.Generator]


@dataclass(frozen=True, slots=True)
class ImuReadings:
    """Readings of an IMU in its own axes: t_ns (M,), gyro_radps (M, 3), accel_mps2 (M, 3) with gravity's reaction."""

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
        """The exact calibration of the IMU: its mount, its rate and the four densities."""
        return ImuCalibration(
            self.T_body_imu,
            self.rate_hz,
            gyro_noise=self.gyro.noise,
            accel_noise=self.accel.noise,
            gyro_walk=self.gyro.walk,
            accel_walk=self.accel.walk,
        )


def measure(
    motion: Motion,
    settings: ImuSettings,
    *,
    rngs: Generators | None = None,
) -> tuple[ImuReadings, ImuBias]:
    """Readings over the whole of a motion, and the biases in them; `rngs` holds the generators of STREAMS.

    A reading is the mean over the 1 / rate_hz around its stamp, so that readings add up to the motion.
    Raises InputError where a random process has no generator.
    """
    step_s = 1 / settings.rate_hz
    t_ns = reading_stamps(motion, settings.rate_hz)
    count = len(t_ns)
    true_gyro, true_accel = mean_inertia(motion, settings.T_body_imu, settings.rate_hz, count=count)
    largest_bias_std = max(settings.gyro.bias_std, settings.accel.bias_std)
    gyro_start, accel_start = _draws("start_bias", 2, largest_bias_std, rngs)

    gyro_bias = _bias("gyro", settings.gyro, gyro_start, count=count, step_s=step_s, rngs=rngs)
    gyro_white = _draws("gyro_white", count, settings.gyro.noise, rngs)
    gyro_radps = readings_of(settings.gyro, true_gyro, gyro_bias, gyro_white, step_s=step_s)

    accel_bias = _bias("accel", settings.accel, accel_start, count=count, step_s=step_s, rngs=rngs)
    accel_white = _draws("accel_white", count, settings.accel.noise, rngs)
    accel_mps2 = readings_of(settings.accel, true_accel, accel_bias, accel_white, step_s=step_s)

    return ImuReadings(t_ns, gyro_radps, accel_mps2), ImuBias(t_ns, gyro_bias, accel_bias)


def _bias(
    name: str,
    triad: Triad,
    start: Array,
    *,
    count: int,
    step_s: float,
    rngs: Generators | None,
) -> Array:
    """The bias (count, 3) of gyroscopes or accelerometers, for standard normal numbers (3,) of the start."""
    walk = random_walk(triad, _draws(f"{name}_walk", count, triad.walk, rngs), step_s=step_s)
    return initial_bias(triad, start) + walk


def _draws(
    stream: str,
    count: int,
    size: float,
    rngs: Generators | None,
) -> Array:
    """Standard normal numbers (count, 3) of a stream; zeros where the size of their effect is 0."""
    if not size:
        return np.zeros((count, 3))
    if rngs is None or stream not in rngs:
        raise InputError(f"an IMU needs a random generator for each of {', '.join(STREAMS)}; {stream!r} is missing")
    return rngs[stream].standard_normal((count, 3))


DEG = pi / 180
DEG_PER_HOUR = DEG / 3600
MILLI_G = STANDARD_GRAVITY_MPS2 / 1000


def _walk(spread: float, correlation_s: float) -> float:
    """The density of a walk of a correlation time whose stationary standard deviation is `spread`."""
    return spread * sqrt(2 / correlation_s)


IMUS = {
    "exact": ImuSettings(),
    "adis16448": ImuSettings(
        gyro=Triad(
            noise=1.6968e-4,
            walk=1.9393e-5,
            bias_std=0.5 * DEG,
            limit=1000 * DEG,
            step=DEG / 25,
        ),
        accel=Triad(
            noise=2e-3,
            walk=3e-3,
            bias_std=20 * MILLI_G,
            limit=18e3 * MILLI_G,
            step=1e3 * MILLI_G / 1200,
        ),
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
