"""Kalibr's imu.yaml: what Kalibr asks for, in numbers that its reader takes for numbers."""

import re
from dataclasses import replace

import pytest
from ruamel.yaml import YAML

from vobench.errors import InputError
from vobench.sensor.imu_preset import IMUS
from vobench.sensor.imu_text import kalibr_imu_yaml

# What YAML 1.1 resolves to a float (PyYAML, which Kalibr reads with): a point, and a sign in the exponent.
FLOAT_1_1 = r"[0-9]+\.[0-9]*([eE][-+][0-9]+)?"
CALIBRATION = IMUS["mpu6000"].calibration


def test_kalibr_finds_all_that_it_asks_for_to_the_last_digit():
    said = YAML(typ="safe").load(kalibr_imu_yaml(CALIBRATION, topic="/imu"))
    assert said == {
        "rostopic": "/imu",
        "update_rate": 200.0,
        "accelerometer_noise_density": CALIBRATION.accel_noise,
        "accelerometer_random_walk": CALIBRATION.accel_walk,
        "gyroscope_noise_density": CALIBRATION.gyro_noise,
        "gyroscope_random_walk": CALIBRATION.gyro_walk,
    }


@pytest.mark.parametrize("value", [1e-5, 3e-7, 0.002, 1.0, 2.5e-4])
def test_a_number_is_a_number_to_yaml_1_1(value):
    text = kalibr_imu_yaml(replace(CALIBRATION, gyro_walk=value), topic="/imu")
    number = text.split("gyroscope_random_walk: ")[1].strip()
    assert re.fullmatch(FLOAT_1_1, number)
    assert float(number) == value


@pytest.mark.parametrize("value", [0.0, -1e-3, float("nan")])
def test_what_kalibr_refuses_is_refused_by_name(value):
    with pytest.raises(InputError, match="Kalibr reads no IMU whose accelerometer_random_walk is"):
        kalibr_imu_yaml(replace(CALIBRATION, accel_walk=value), topic="/imu")
