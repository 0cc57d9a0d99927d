"""A rig at rest that somebody touches: readings far beyond the data sheet, as in the first second of EuRoC V1_01."""

from dataclasses import replace

import numpy as np

from vobench.estimator import Frame
from vobench.sensor.imu import IMUS, ImuReadings
from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2

ADIS = IMUS["adis16448"]
BIAS_RADPS = (0.05, -0.045, 0.042)  # of the size of EuRoC's, 0.08 rad/s
BIASED = replace(ADIS, gyro=replace(ADIS.gyro, bias=BIAS_RADPS), position_m=(0.1, 0.05, 0.2))
# The largest deviations on EuRoC, in standard deviations of the data sheet.
GYRO_SIGMAS = 122
ACCEL_SIGMAS = 158
TOUCHES = 6
TOUCHED_S = 1.0  # since the start
DECAY_S = 0.04
SLOWEST_HZ, FASTEST_HZ = 15, 60


def readings_at_rest(seconds: float, *, seed: int = 0) -> ImuReadings:
    """Readings of BIASED on a level rig that is at rest: bias, gravity's reaction and white noise."""
    rng = np.random.default_rng(seed)
    count = int(seconds * BIASED.rate_hz)
    root_hz = np.sqrt(BIASED.rate_hz)
    t_ns = np.rint(np.arange(count) * 1e9 / BIASED.rate_hz).astype(np.int64)
    gyro_radps = BIAS_RADPS + rng.normal(0, BIASED.gyro.noise * root_hz, (count, 3))
    accel_mps2 = rng.normal(0, BIASED.accel.noise * root_hz, (count, 3))
    accel_mps2[:, 2] += STANDARD_GRAVITY_MPS2
    return ImuReadings(t_ns, gyro_radps, accel_mps2)


def touched(readings: ImuReadings, *, seed: int = 0) -> ImuReadings:
    """The readings of BIASED with decaying oscillations at random instants of the first second."""
    rng = np.random.default_rng(seed)
    t_s = (readings.t_ns - readings.t_ns[0]) / 1e9
    root_hz = np.sqrt(BIASED.rate_hz)
    gyro_radps = readings.gyro_radps.copy()
    accel_mps2 = readings.accel_mps2.copy()
    for start_s in rng.uniform(0, TOUCHED_S - 0.2, TOUCHES):
        since_s = np.maximum(t_s - start_s, 0)
        envelope = np.where(t_s < TOUCHED_S, np.exp(-since_s / DECAY_S), 0)
        gyro_wave, accel_wave = (np.sin(2 * np.pi * rng.uniform(SLOWEST_HZ, FASTEST_HZ) * since_s) for _ in range(2))
        gyro_peak_radps = GYRO_SIGMAS * BIASED.gyro.noise * root_hz * rng.uniform(-1, 1, 3)
        accel_peak_mps2 = ACCEL_SIGMAS * BIASED.accel.noise * root_hz * rng.uniform(-1, 1, 3)
        gyro_radps += np.outer(envelope * gyro_wave, gyro_peak_radps)
        accel_mps2 += np.outer(envelope * accel_wave, accel_peak_mps2)
    return ImuReadings(readings.t_ns, gyro_radps, accel_mps2)


def framed(readings: ImuReadings, pictures: list, *, rate_hz: float) -> list[Frame]:
    """Frames with pictures (left, right), or None, and the readings up to each."""
    frames = []
    first = 0
    for index, pair in enumerate(pictures):
        t_ns = round(index * 1e9 / rate_hz)
        end = int(np.searchsorted(readings.t_ns, t_ns, side="right"))
        new = ImuReadings(readings.t_ns[first:end], readings.gyro_radps[first:end], readings.accel_mps2[first:end])
        left, right = pair or (None, None)
        frames.append(Frame(index, t_ns, left=left, right=right, imu=new))
        first = end
    return frames


def grainy(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The picture with noise of 1.5 grey values."""
    noisy = picture + rng.normal(0, 1.5, picture.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)
