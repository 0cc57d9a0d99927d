"""The presets say what their sources say."""

import numpy as np
import pytest

from vobench.sensor.imu_preset import IMUS

# gyro in rad/s, accel in m/s²: white noise, walk.
SAID = {
    "exact": (0, 0, 0, 0),
    "adis16448": (1.6968e-4, 1.9393e-5, 2e-3, 3e-3),
    "mpu6000": (8.727e-5, 1.4105e-6, 2.3536e-3, 1.7652e-5),
    "bmi055": (2.4435e-4, 1.3713e-6, 1.47100e-3, 4.1606e-5),
}


@pytest.mark.parametrize("name", IMUS)
def test_a_preset_has_the_densities_of_its_source(name):
    c = IMUS[name].calibration
    assert (c.gyro_noise, c.gyro_walk, c.accel_noise, c.accel_walk) == pytest.approx(SAID[name], rel=1e-4)
    assert c.rate_hz == 200


@pytest.mark.parametrize(("name", "gyro_deg_per_hour", "accel_micro_g"), [("mpu6000", 4.6, 36), ("bmi055", 2.0, 30)])
def test_a_walk_that_is_forgotten_keeps_within_its_stability(name, gyro_deg_per_hour, accel_micro_g):
    gyro, accel = (t.walk * np.sqrt(t.correlation_s / 2) for t in (IMUS[name].gyro, IMUS[name].accel))
    assert np.rad2deg(gyro) * 3600 == pytest.approx(gyro_deg_per_hour)
    assert accel / 9.80665 * 1e6 == pytest.approx(accel_micro_g)


@pytest.mark.parametrize("name", sorted(set(IMUS) - {"exact"}))
def test_a_chip_counts_to_its_limit_in_no_more_than_sixteen_bits(name):
    for triad in (IMUS[name].gyro, IMUS[name].accel):
        assert 2**10 < triad.limit / triad.step < 2**15 * 1.01
