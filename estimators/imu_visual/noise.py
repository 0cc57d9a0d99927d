"""The noise that an IMU's readings have, which vibration makes larger than the stated one."""

from dataclasses import replace
from math import comb

import numpy as np

from vobench.plugin import Array, ImuCalibration, ImuReadings

ORDER = 2  # of the differences, in which motion is small beside noise
WINDOW_S = 0.2
MIN_READINGS = 8
# In simulated drives, walks, runs and flights, the measured noise is at most 2.2 times the stated one at 200 Hz, and
# 4.1 times at 100 Hz. On EuRoC's drone that is touched, readings are off by up to 158 times.
WELL_ABOVE = 5.0


class MeasuredNoise:
    """The stated densities of noise, or those of the last readings where they are well above."""

    def __init__(self, stated: ImuCalibration, *, least_gyro: float, least_accel: float) -> None:
        self._stated = stated
        self._least_gyro = least_gyro
        self._least_accel = least_accel
        self._gyro_radps = np.zeros((0, 3))
        self._accel_mps2 = np.zeros((0, 3))

    def after(self, readings: ImuReadings) -> ImuCalibration:
        """The calibration with the noise of the readings up to these."""
        count = max(MIN_READINGS, round(WINDOW_S * self._stated.rate_hz), len(readings.t_ns))
        self._gyro_radps = np.concatenate([self._gyro_radps, readings.gyro_radps])[-count:]
        self._accel_mps2 = np.concatenate([self._accel_mps2, readings.accel_mps2])[-count:]
        return replace(
            self._stated,
            gyro_noise=self._believed(self._gyro_radps, self._stated.gyro_noise, self._least_gyro),
            accel_noise=self._believed(self._accel_mps2, self._stated.accel_noise, self._least_accel),
        )

    def _believed(self, values: Array, stated: float, least: float) -> float:
        """A density: the stated one, unless the measured one of the values (M, 3) is well above it."""
        if len(values) < MIN_READINGS:
            return stated
        measured = density(values, self._stated.rate_hz)
        return measured if measured > WELL_ABOVE * max(stated, least) else stated


def density(values: Array, rate_hz: float) -> float:
    """The density, in the unit of the values (M, 3) by root Hz, of white noise in a slowly changing signal.

    The N-th difference of white noise of variance 1 has the variance C(2 N, N). It is the mean square that counts, not
    a robust measure: the outliers of a touch are what the integral suffers from.
    """
    differences = np.diff(values, n=ORDER, axis=0) / np.sqrt(comb(2 * ORDER, ORDER))
    sigma = float(np.sqrt(np.mean(differences**2)))
    return sigma / float(np.sqrt(rate_hz))
