"""Fusion of an IMU and stereo: at rest with a large bias, touched, and which noise is believed."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.estimators.touched import BIASED, framed, grainy, readings_at_rest, touched
from vobench.estimator import ImuReadings, Status
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig
from vobench.motion.drive import drive
from vobench.sensor.imu import STREAMS, measure

LENS = Pinhole(360, 240, 250.0, 250.0, 179.5, 119.5)
RIG = replace(stereo_rig(LENS, pitch_deg=10), imu=BIASED.calibration)
RATE_HZ = 20
FRAMES = 40


@pytest.fixture(scope="module")
def pairs(bed):
    """Pairs of pictures of a rig at rest, each with its own noise."""
    rng = np.random.default_rng(1)
    (exact,) = bed.film(RIG, np.eye(4)[None])
    return [(grainy(exact.left, rng), grainy(exact.right, rng)) for _ in range(FRAMES)]


def farthest_m(results) -> float:
    return float(np.linalg.norm([result.T_odom_frame[:3, 3] for result in results], axis=1).max())


def test_a_gyroscope_with_the_bias_of_a_real_chip_is_not_rejected_at_rest(bed, pairs):
    frames = framed(readings_at_rest(2.5), pairs, rate_hz=RATE_HZ)
    results = bed.estimated("imu_visual", RIG, frames)
    assert {result.status for result in results[1:]} == {Status.OK}
    assert farthest_m(results) < 1e-3
    assert results[-1].stats["bias_dps"] == pytest.approx(np.rad2deg(0.0794), rel=0.1)


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_touches_of_a_hundred_sigma_do_not_carry_a_standing_rig_away(bed, pairs, seed):
    frames = framed(touched(readings_at_rest(2.5), seed=seed), pairs, rate_hz=RATE_HZ)
    assert farthest_m(bed.estimated("imu_visual", RIG, frames)) < 3e-3


def measured_noise(bed):
    """What imu_visual measures the noise with, for the IMU of RIG."""
    estimator = bed.started("imu_visual", RIG)
    package = type(estimator).__module__.rpartition(".")[0]
    noise = sys.modules[f"{package}.noise"]
    return noise.MeasuredNoise(RIG.imu, least_gyro=1e-5, least_accel=1e-3)


def test_in_an_ordinary_drive_the_stated_noise_is_believed(bed):
    rngs = dict(zip(STREAMS, np.random.default_rng(0).spawn(len(STREAMS)), strict=True))
    readings, _ = measure(drive(((0.5, 0.3), (1, 1))).motion, BIASED, rngs=rngs)
    frames = framed(readings, [None] * 100, rate_hz=RATE_HZ)
    noise = measured_noise(bed)
    assert all(noise.after(frame.imu) == RIG.imu for frame in frames)


def test_noise_far_above_the_stated_one_is_measured(bed):
    rng = np.random.default_rng(0)
    rest = readings_at_rest(2.5)
    shaken_mps2 = rest.accel_mps2 + rng.normal(0, 20 * BIASED.accel.noise * np.sqrt(BIASED.rate_hz), (500, 3))
    frames = framed(ImuReadings(rest.t_ns, rest.gyro_radps, shaken_mps2), [None] * FRAMES, rate_hz=RATE_HZ)
    noise = measured_noise(bed)
    believed = [noise.after(frame.imu) for frame in frames]
    accel_noise = [imu.accel_noise / BIASED.accel.noise for imu in believed[1:]]
    assert np.mean(accel_noise) == pytest.approx(20, rel=0.1)
    assert min(accel_noise) > 10
    assert {imu.gyro_noise for imu in believed} == {BIASED.gyro.noise}
