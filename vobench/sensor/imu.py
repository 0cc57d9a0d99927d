"""An inertial measurement unit: angular rate and specific force, with the noise and bias of Kalibr's model."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class ImuReadings:
    """What an IMU says, in its own axes: t_ns (M,), gyro_radps (M, 3), accel_mps2 (M, 3) with gravity's reaction."""

    t_ns: NDArray[np.int64]
    gyro_radps: Array
    accel_mps2: Array
