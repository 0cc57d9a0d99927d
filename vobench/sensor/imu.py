"""An inertial measurement unit: angular rate and specific force, with the noise and bias of Kalibr's model."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.rig import ImuCalibration
from vobench.geometry.se3 import Array
from vobench.sensor.imu_mean import mean_inertia, reading_stamps
from vobench.sensor.triad import FLAWLESS, Triad, read_out, started, walked
from vobench.trajectory.kinematics import Motion
from vobench.trajectory.trajectory import Stamps

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


@dataclass(frozen=True, slots=True)
class ImuSettings:
    """An IMU as it is: how often it reads, its gyroscopes (rad/s) and accelerometers (m/s²), where it sits.

    Raises InputError where the rate or the place is none.
    """

    rate_hz: float = 200.0
    gyro: Triad = FLAWLESS
    accel: Triad = FLAWLESS
    T_body_imu: Array = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        if not (isfinite(self.rate_hz) and 1 <= self.rate_hz <= 1e5):
            raise InputError(f"an IMU's rate_hz should be within 1 and 100000, got {self.rate_hz}")
        place = np.asarray(self.T_body_imu, float)
        if place.shape != (4, 4) or not np.isfinite(place).all() or not se3.is_rotation(place[:3, :3]):
            raise InputError(f"T_body_imu should be a rigid transform (4, 4), got {place.tolist()}")

    @property
    def calibration(self) -> ImuCalibration:
        """What an honest calibration says of it: its place, its rate and the four densities."""
        g, a = self.gyro, self.accel
        return ImuCalibration(self.T_body_imu, self.rate_hz, g.noise, a.noise, g.walk, a.walk)


def measure(motion: Motion, settings: ImuSettings, *, rngs: Generators | None = None) -> tuple[ImuReadings, ImuBias]:
    """Readings over the whole of a motion, and the biases in them; `rngs` holds the generators of STREAMS.

    A reading is the mean over the 1 / rate_hz around its stamp, so that readings add up to the motion.
    Raises InputError where something is left to chance and its generator is missing.
    """
    step_s, t_ns = 1 / settings.rate_hz, reading_stamps(motion, settings.rate_hz)
    truth = mean_inertia(motion, settings.T_body_imu, settings.rate_hz, count=len(t_ns))
    triads = {"gyro": settings.gyro, "accel": settings.accel}
    starts = _draws("start_bias", 2, max(triad.bias_std for triad in triads.values()), rngs)
    readings, biases = [], []
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
