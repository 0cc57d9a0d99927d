"""Wheels and IMU say what the motion does to them, each reading once, in order of time, before its picture."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.runner.motion import body_motion
from vobench.runner.sensors import SensorFeed, _imu_readings, wheel_error_m
from vobench.sensor.timing import Timing
from vobench.suite.suite import read_plan

SUITE = """name: it
seed: 1
scenes: [room]
rigs: {{it: {{pitch_deg: 10, imu: {imu}}}}}
trajectories: {{way: {{{way}}}}}
estimators: [stand_still]
"""
CIRCLE = "kind: circle, radius_m: 0.5, mover: unicycle"


class Writer:
    """Remembers what it was given, in turn."""

    def __init__(self) -> None:
        self.sensors, self.truth = list[tuple[int, str]](), list[tuple[int, str]]()

    def write_encoders(self, t_ns, ticks):
        self.sensors += [(int(t), "encoders") for t in np.atleast_1d(t_ns)]

    def write_imu(self, readings):
        self.sensors += [(int(t), "imu") for t in readings.t_ns]

    def write_imu_bias(self, t_ns, gyro_radps, accel_mps2):
        self.truth.append((int(t_ns), "bias"))

    def of(self, kind):
        return [t for t, its in self.sensors if its == kind]


@pytest.fixture
def case(tmp_path):
    """The case of one trajectory and IMU."""

    def read(way: str = CIRCLE, imu: str = "adis16448"):
        (tmp_path / "it.yaml").write_text(SUITE.format(way=way, imu=imu))
        return read_plan(str(tmp_path / "it.yaml")).simulated[0]

    return read


def fed(case):
    travel, writer = body_motion(case), Writer()
    feed = SensorFeed(case, travel)
    for t_ns in travel.t_ns.tolist():
        feed.write_until(t_ns, writer)
        assert writer.sensors[-1][0] <= t_ns
    return travel, writer


@pytest.mark.parametrize("imu", ["adis16448", "{like: exact, rate_hz: 1000}", "{like: exact, rate_hz: 7}"])
def test_every_reading_up_to_the_last_picture_comes_once_and_in_order_of_time(case, imu):
    travel, writer = fed(case(imu=imu))
    stamps = [t for t, _ in writer.sensors]
    assert stamps == sorted(stamps)
    assert writer.of("encoders") == travel.rims.t_ns.tolist()
    readings = writer.of("imu")
    assert len(readings) == len(set(readings))
    rate_hz = {"adis16448": 200}.get(imu) or int(imu.split()[-1].rstrip("}"))
    lasts_s = travel.t_ns[-1] / 1e9
    assert len(readings) == pytest.approx(lasts_s * rate_hz, abs=2)
    assert [t for t, _ in writer.truth] == readings


@pytest.mark.parametrize("delay_ms", [12.5, -7.5])
def test_a_late_imu_has_the_same_readings_that_much_later(case, delay_ms):
    it = case()
    late = replace(it, camera=replace(it.camera, timing=Timing(imu_delay_ms=delay_ms)))
    (told, bias), (was, _) = (_imu_readings(each, body_motion(each)) for each in (late, it))
    np.testing.assert_array_equal(told.t_ns - was.t_ns, round(delay_ms * 1e6))
    np.testing.assert_array_equal(bias.t_ns, told.t_ns)
    np.testing.assert_array_equal(told.gyro_radps, was.gyro_radps)
    travel, writer = fed(late)
    assert writer.of("imu") == [t for t in told.t_ns.tolist() if 0 <= t <= travel.t_ns[-1]]


def test_the_noise_of_an_imu_is_the_same_whatever_it_rides_on(case):
    """Its readings less those of one without errors, for two motions that last equally long."""
    errors = []
    for slip in ("none", "slippery"):
        way = f"kind: circle, radius_m: 0.5, laps: 0.2, slip: {slip}"
        for imu in ("{like: adis16448, gyro: {step: 0}, accel: {step: 0}}", "exact"):
            it = case(way, imu)
            errors.append(_imu_readings(it, body_motion(it)))
    (real, bias), (true, _), (other, its_bias), (its_true, _) = errors
    assert np.abs(true.gyro_radps - its_true.gyro_radps).max() > 1e-3
    np.testing.assert_array_equal(bias.gyro_radps, its_bias.gyro_radps)
    np.testing.assert_array_equal(bias.accel_mps2, its_bias.accel_mps2)
    for key in ("gyro_radps", "accel_mps2"):
        noise, its_noise = (getattr(a, key) - getattr(b, key) for a, b in ((real, true), (other, its_true)))
        assert noise.std() > 1e-4
        np.testing.assert_allclose(noise, its_noise, atol=1e-12)


def test_every_error_of_an_imu_draws_by_itself(case):
    way = "kind: circle, radius_m: 0.5, laps: 0.5, slip: none"
    unrounded, exact = (case(way, imu) for imu in ("{like: adis16448, gyro: {step: 0}, accel: {step: 0}}", "exact"))
    (real, bias), (true, _) = (_imu_readings(it, body_motion(it)) for it in (unrounded, exact))
    white = [getattr(real, key) - getattr(true, key) - getattr(bias, key) for key in ("gyro_radps", "accel_mps2")]
    walk = [np.diff(getattr(bias, key), axis=0) for key in ("gyro_radps", "accel_mps2")]
    drawn = np.stack([draws[: len(walk[0])].ravel() for draws in (*white, *walk)])
    for shift in (0, 3):  # a walk starts from the first reading on, and each reading has three axes
        alike = np.corrcoef(np.roll(drawn[:2], shift, 1), drawn[2:])
        np.testing.assert_allclose(alike, np.eye(4), atol=0.1)


def test_what_flies_has_no_wheels_to_read(case):
    _, writer = fed(case("kind: rail, points_m: [[0, 0, 1], [1, 0, 1]]"))
    assert writer.of("encoders") == []
    assert writer.of("imu")


@pytest.mark.parametrize(
    ("way", "least_m", "most_m"),
    [
        (f"{CIRCLE}, encoders: exact", 0, 2e-4),
        (f"{CIRCLE}, laps: 0.5, rate_hz: 5, encoders: exact", 0, 2e-4),
        (f"{CIRCLE}", 2e-3, 0.1),
        ("kind: square, side_m: 0.5, mover: unicycle, encoders: exact", 0, 2e-4),
        ("kind: reverse, length_m: 0.5, mover: unicycle, encoders: exact", 0, 2e-4),
        ("kind: circle, radius_m: 1, mover: ackermann, encoders: exact", 0, 2e-3),
        ("targets_m: [[0.5, 0.5]], slip: none, encoders: exact", 0, 1e-3),
        ("targets_m: [[0.5, 0.5]], slip: slippery, encoders: exact", 1e-3, 0.3),
    ],
)
def test_an_odometer_is_off_by_slip_and_by_its_wheels_errors_alone(case, way, least_m, most_m):
    it = case(way)
    assert least_m <= wheel_error_m(it, body_motion(it)) <= most_m


def test_without_wheels_there_is_no_odometer(case):
    it = case("kind: rail, points_m: [[0, 0, 1], [1, 0, 1]]")
    assert wheel_error_m(it, body_motion(it)) is None
