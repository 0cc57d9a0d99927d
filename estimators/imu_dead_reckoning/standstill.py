"""Whether the body stands still at the start, and what is learnt if it does."""

from dataclasses import dataclass

import numpy as np

from vobench.plugin import STANDARD_GRAVITY_MPS2, Array, ImuCalibration, ImuReadings, unit

# Readings at rest stay within so many sigma of their mean, and a little more for a chip's rounding.
SIGMAS = 5.0
COS_TILTED = float(np.cos(np.deg2rad(20)))  # a body on wheels feels no such slant; EuRoC's, with x up, does
ROUNDING_RADPS = 2e-3
ROUNDING_MPS2 = 0.02


@dataclass(frozen=True, slots=True)
class Rest:
    """What an IMU at rest tells: its gyroscopes' bias, and gravity (3,), both in its own axes."""

    gyro_bias_radps: Array
    gravity_mps2: Array


class Standstill:
    """Listens to the first readings until it is clear that the body moves, or it has stood still for long enough."""

    def __init__(self, imu: ImuCalibration, lasts_s: float) -> None:
        self._imu = imu
        self._lasts_ns = lasts_s * 1e9
        none = np.zeros((0, 3))
        self.readings = ImuReadings(np.zeros(0, np.int64), none, none)

    def take(self, new: ImuReadings) -> None:
        """Remember more readings."""
        r = self.readings
        self.readings = ImuReadings(
            np.concatenate([r.t_ns, new.t_ns]),
            np.concatenate([r.gyro_radps, new.gyro_radps]),
            np.concatenate([r.accel_mps2, new.accel_mps2]),
        )

    def verdict(self) -> Rest | None:
        """What is known of rest by now; None as long as it is undecided.

        One who moves is taken to be level, or tilted as it feels where that is plain, and its IMU without bias. One
        who stands still shows gravity, in which the accelerometers' bias is then included, and the gyroscopes' bias.
        """
        r = self.readings
        if not len(r.t_ns):
            return None
        root_hz = np.sqrt(self._imu.rate_hz)
        turns = _strays(r.gyro_radps, SIGMAS * self._imu.gyro_noise * root_hz + ROUNDING_RADPS)
        if turns or _strays(r.accel_mps2, SIGMAS * self._imu.accel_noise * root_hz + ROUNDING_MPS2):
            return Rest(np.zeros(3), -STANDARD_GRAVITY_MPS2 * self._up())
        if r.t_ns[-1] - r.t_ns[0] < self._lasts_ns:
            return None
        return Rest(r.gyro_radps.mean(0), -r.accel_mps2.mean(0))

    def _up(self) -> Array:
        """Upwards (3,) in the IMU's axes: the body's z, unless what is felt so far is far from it."""
        level = self._imu.T_body_imu[2, :3]
        felt_mps2 = self.readings.accel_mps2.mean(0)
        is_tilted = felt_mps2 @ level < COS_TILTED * np.linalg.norm(felt_mps2)
        return unit(felt_mps2) if is_tilted else level


def _strays(readings: Array, tolerance: float) -> bool:
    """Whether any of the readings (M, 3) is further from their mean than this."""
    return bool(np.abs(readings - readings.mean(0)).max() > tolerance)
