"""An IMU's calibration as the text that Kalibr reads."""

import numpy as np

from vobench.errors import InputError
from vobench.geometry.rig import ImuCalibration


def kalibr_imu_yaml(calibration: ImuCalibration, *, topic: str) -> str:
    """Kalibr's imu.yaml: topic, rate and four densities. It has no place for T_body_imu: Kalibr finds that out.

    Raises InputError where one of the numbers is not positive, which Kalibr refuses.
    """
    numbers = {
        "update_rate": calibration.rate_hz,
        "accelerometer_noise_density": calibration.accel_noise,
        "accelerometer_random_walk": calibration.accel_walk,
        "gyroscope_noise_density": calibration.gyro_noise,
        "gyroscope_random_walk": calibration.gyro_walk,
    }
    for key, value in numbers.items():
        if not 0 < value < np.inf:
            raise InputError(f"Kalibr reads no IMU whose {key} is {value:g}; it must be more than 0")
    return "\n".join([f"rostopic: {topic}", *(f"{key}: {_number(value)}" for key, value in numbers.items())]) + "\n"


def _number(value: float) -> str:
    """All digits, and always a point: Kalibr's YAML 1.1 takes 1e-05 for a word."""
    if 1e-3 <= value < 1e6:
        return repr(float(value))
    return np.format_float_scientific(value, trim="0")
