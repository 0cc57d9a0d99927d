"""A record of an IMU at rest gives its four densities back, by the Allan deviation, whatever its rate."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.sensor.imu import IMUS, STREAMS, ImuReadings, measure

HOURS_NS = 3600 * 10**9
# The chip's rounding would add a noise of its own.
SMOOTH = replace(IMUS["adis16448"], **{n: replace(getattr(IMUS["adis16448"], n), step=0.0) for n in ("gyro", "accel")})


def allan_variance(readings: Array, size: int) -> float:
    """Overlapping Allan variance of readings (M, 3), over axes alike, for clusters of so many (IEEE 952, annex C)."""
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(readings - readings.mean(0), 0)])
    second = total[2 * size :] - 2 * total[size:-size] + total[: -2 * size]
    return float((second**2).mean() / (2 * size**2))


def densities(readings: Array, rate_hz: float) -> tuple[float, float]:
    """White noise and walk, from N² / tau + K² tau / 3 through the Allan variances, the sure ones counting more."""
    sizes = np.unique(np.geomspace(1, len(readings) / 50, 25).astype(int))
    tau_s = sizes / rate_hz
    variance = np.array([allan_variance(readings, size) for size in sizes])
    model, sure = variance, 1 / np.sqrt(tau_s)
    for _ in range(3):
        weight = (sure / model)[:, None]
        found, *_ = np.linalg.lstsq(weight * np.stack([1 / tau_s, tau_s / 3], -1), weight[:, 0] * variance)
        model = np.stack([1 / tau_s, tau_s / 3], -1) @ found
    white, walk = np.sqrt(found)
    return float(white), float(walk)


def record(bed, rate_hz: float, seed: int) -> ImuReadings:
    rngs = dict(zip(STREAMS, np.random.default_rng(seed).spawn(len(STREAMS)), strict=True))
    motion = bed.at_rest(np.eye(4), end_ns=10 * HOURS_NS)
    return measure(motion, replace(SMOOTH, rate_hz=rate_hz), rngs=rngs)[0]


@pytest.mark.parametrize("rate_hz", [10.0, 5.0])
def test_ten_hours_give_all_four_densities_back(bed, rate_hz):
    readings = record(bed, rate_hz, seed=1)
    found = (*densities(readings.gyro_radps, rate_hz), *densities(readings.accel_mps2, rate_hz))
    assert found == pytest.approx((1.6968e-4, 1.9393e-5, 2e-3, 3e-3), rel=0.05)


def test_the_slopes_are_minus_a_half_and_plus_a_half(bed):
    gyro = record(bed, 5.0, seed=2).gyro_radps
    white, walk = ([np.sqrt(allan_variance(gyro, size)) for size in sizes] for sizes in ((1, 4), (2000, 8000)))
    assert white[0] / white[1] == pytest.approx(2, rel=0.02)
    assert walk[1] / walk[0] == pytest.approx(2, rel=0.3)
