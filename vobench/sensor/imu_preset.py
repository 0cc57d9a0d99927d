"""IMUs by name; where each figure is from, and which are assumed, is in docs/sensors.md."""

from math import pi, sqrt

from vobench.sensor.imu import ImuSettings
from vobench.sensor.triad import Triad
from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2

DEG = pi / 180
DEG_PER_HOUR = DEG / 3600
MILLI_G = STANDARD_GRAVITY_MPS2 / 1000


def _walk(spread: float, correlation_s: float) -> float:
    """The density of a walk that stays within `spread` (one sigma) because it is forgotten after correlation_s."""
    return spread * sqrt(2 / correlation_s)


IMUS = {
    "exact": ImuSettings(),
    "adis16448": ImuSettings(
        gyro=Triad(noise=1.6968e-4, walk=1.9393e-5, bias_std=0.5 * DEG, limit=1000 * DEG, step=DEG / 25),
        accel=Triad(noise=2e-3, walk=3e-3, bias_std=20 * MILLI_G, limit=18e3 * MILLI_G, step=1e3 * MILLI_G / 1200),
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
