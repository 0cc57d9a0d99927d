"""Whether the body stands still at the start, and the gyroscope bias and gravity that follow if it does."""

from dataclasses import dataclass

import numpy as np

from vobench.plugin import STANDARD_GRAVITY_MPS2, Array, ImuCalibration, ImuReadings, unit

# Readings at rest stay within so many sigma of their mean, plus a chip's rounding.
SIGMAS = 5.0
ROUNDING_RADPS = 2e-3
ROUNDING_MPS2 = 0.02
COS_TILTED = float(np.cos(np.deg2rad(20)))  # a body on wheels never tilts so far; EuRoC's, with x up, does


@dataclass(frozen=True, slots=True)
class Rest:
    """The gyroscopes' bias (3,) and gravity (3,), both in the IMU's axes."""

    gyro_bias_radps: Array
    gravity_mps2: Array


class Standstill:
    """Collects the first readings until the body moves, or has stood still for long enough."""

    def __init__(self, imu: ImuCalibration, duration_s: float) -> None:
        self._imu = imu
        self._duration_ns = duration_s * 1e9
        no_vectors = np.zeros((0, 3))
        self.readings = ImuReadings(np.zeros(0, np.int64), no_vectors, no_vectors)

    def take(self, new: ImuReadings) -> None:
        """Add readings."""
        before = self.readings
        self.readings = ImuReadings(
            np.concatenate([before.t_ns, new.t_ns]),
            np.concatenate([before.gyro_radps, new.gyro_radps]),
            np.concatenate([before.accel_mps2, new.accel_mps2]),
        )

    def verdict(self) -> Rest | None:
        """Bias and gravity; None as long as the readings do not decide.

        For a moving body the bias is taken as zero, and its z as up unless the specific force is plainly tilted. For
        a body at rest both are the means of the readings; gravity then includes the accelerometers' bias.
        """
        t_ns = self.readings.t_ns
        gyro_radps = self.readings.gyro_radps
        accel_mps2 = self.readings.accel_mps2
        if not len(t_ns):
            return None

        root_hz = np.sqrt(self._imu.rate_hz)
        turning = _exceeds(gyro_radps, SIGMAS * self._imu.gyro_noise * root_hz + ROUNDING_RADPS)
        moving = _exceeds(accel_mps2, SIGMAS * self._imu.accel_noise * root_hz + ROUNDING_MPS2)
        if turning or moving:
            return Rest(np.zeros(3), -STANDARD_GRAVITY_MPS2 * self._up())
        if t_ns[-1] - t_ns[0] < self._duration_ns:
            return None
        return Rest(gyro_radps.mean(0), -accel_mps2.mean(0))

    def _up(self) -> Array:
        """Upwards (3,) in the IMU's axes: the body's z, unless the mean specific force is far from it."""
        z_body = self._imu.T_body_imu[2, :3]
        force_mps2 = self.readings.accel_mps2.mean(0)
        is_tilted = force_mps2 @ z_body < COS_TILTED * np.linalg.norm(force_mps2)
        return unit(force_mps2) if is_tilted else z_body


def _exceeds(readings: Array, tolerance: float) -> bool:
    """Whether any of the readings (M, 3) is further from their mean than this."""
    deviations = np.abs(readings - readings.mean(0))
    return bool(deviations.max() > tolerance)
