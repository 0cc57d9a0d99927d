"""Whether the body stands still at the start, and the gyroscope bias and gravity that follow if it does."""

from dataclasses import dataclass

import numpy as np

from vobench.plugin import STANDARD_GRAVITY_MPS2, Array, ImuCalibration, ImuReadings, unit

# Readings at rest stay within so many sigma of their mean, plus a chip's rounding.
SIGMAS = 5.0
ROUNDING_RADPS = 2e-3
ROUNDING_MPS2 = 0.02
SIGMA_OF_MAD = 1.4826  # standard deviation of normal numbers, relative to their median absolute deviation
COS_TILTED = float(np.cos(np.deg2rad(20)))  # a body on wheels never tilts so far; EuRoC's, with x up, does
# At rest, the noise of tracks alone gives a median displacement of 0.03 px in a simulated room, and of 0.4 px with
# noise of 12 grey values. What half a pixel in a second hides is 1 mrad/s or, 5 m ahead, 5 mm/s with a lens of 500 px:
# little beside the bias of gyroscopes, of up to 80 mrad/s on EuRoC.
STILL_PX = 0.5


@dataclass(frozen=True, slots=True)
class Rest:
    """The gyroscopes' bias (3,) and gravity (3,), both in the IMU's axes.

    `stood_until_ns` is the instant until which the body is known to stand still, whatever its readings are.
    """

    gyro_bias_radps: Array
    gravity_mps2: Array
    stood_until_ns: float


class Standstill:
    """Collects the first readings, and how far pictures have moved, until the body has stood still for long enough.

    Pictures decide, because the readings of a rig at rest can deviate by a hundred times their data sheet's noise:
    EuRoC's drone is touched and vibrates. Without tracks (no texture, no light) the readings decide.
    """

    def __init__(self, imu: ImuCalibration, *, start_ns: float, duration_s: float) -> None:
        root_hz = np.sqrt(imu.rate_hz)
        self._imu = imu
        self._gyro_sigma_radps = imu.gyro_noise * root_hz
        self._accel_sigma_mps2 = imu.accel_noise * root_hz
        self._start_ns = start_ns
        self._duration_ns = duration_s * 1e9
        self._moving: Rest | None = None
        self._moved_px: list[float] = []
        no_vectors = np.zeros((0, 3))
        self.readings = ImuReadings(np.zeros(0, np.int64), no_vectors, no_vectors)
        self.is_over = False

    def take(self, new: ImuReadings, moved_px: float) -> None:
        """Add the readings up to a picture, and how far that has moved since the first one (NaN: unknown)."""
        before = self.readings
        self.readings = ImuReadings(
            np.concatenate([before.t_ns, new.t_ns]),
            np.concatenate([before.gyro_radps, new.gyro_radps]),
            np.concatenate([before.accel_mps2, new.accel_mps2]),
        )
        self._moved_px.append(moved_px)

    def verdict(self) -> Rest | None:
        """Bias and gravity; None as long as the body may stand still. It is final once `is_over`.

        For a moving body the bias is taken as zero, and its z as up unless the specific force is plainly tilted. For
        a body at rest both are means of the readings without outliers; gravity then includes the accelerometers' bias.
        """
        t_ns = self.readings.t_ns
        if not len(t_ns):
            return None
        if self._moving is None and self._deviates():
            self._moving = self._as_moving()
        moved_px = np.array(self._moved_px)
        known_px = moved_px[np.isfinite(moved_px)]

        if t_ns[-1] - t_ns[0] >= self._duration_ns:
            self.is_over = True
            return self._final(known_px)
        if len(known_px):
            return None if moved_px[-1] < STILL_PX else self._moving
        self.is_over = self._moving is not None
        return self._moving

    def _final(self, known_px: Array) -> Rest:
        """The verdict after the whole time, in which the known displacements (N,) of pictures decide if they are many.

        Their median counts, because a touch may swing the rig for a moment; but it has to come back.
        """
        is_still = self._moving is None
        if len(known_px) >= len(self._moved_px) / 2:
            is_still = bool(np.median(known_px) < STILL_PX and known_px[-1] < STILL_PX)
        if not is_still:
            return self._moving or self._as_moving()
        return Rest(
            _mean_without_outliers(self.readings.gyro_radps, self._gyro_sigma_radps, ROUNDING_RADPS),
            -_mean_without_outliers(self.readings.accel_mps2, self._accel_sigma_mps2, ROUNDING_MPS2),
            stood_until_ns=float(self.readings.t_ns[-1]) if self._moving else self._start_ns,
        )

    def _deviates(self) -> bool:
        """Whether readings are further from their mean than noise explains."""
        turns = _exceeds(self.readings.gyro_radps, SIGMAS * self._gyro_sigma_radps + ROUNDING_RADPS)
        moves = _exceeds(self.readings.accel_mps2, SIGMAS * self._accel_sigma_mps2 + ROUNDING_MPS2)
        return turns or moves

    def _as_moving(self) -> Rest:
        """No bias, and gravity of standard size along the upwards direction."""
        return Rest(np.zeros(3), -STANDARD_GRAVITY_MPS2 * self._up(), self._start_ns)

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


def _mean_without_outliers(readings: Array, sigma: float, rounding: float) -> Array:
    """The mean (3,) of the readings (M, 3) near their median. Without outliers, it is their mean.

    The standard deviation is the stated one or, if that is larger, the measured one (by the median absolute deviation).
    The median itself would be less accurate: it is a whole step of the converter.
    """
    deviations = np.abs(readings - np.median(readings, axis=0))
    measured_sigma = SIGMA_OF_MAD * np.median(deviations, axis=0)
    is_inlier = deviations <= SIGMAS * np.maximum(sigma, measured_sigma) + rounding
    mean: Array = np.mean(readings, axis=0, where=is_inlier)
    return mean
