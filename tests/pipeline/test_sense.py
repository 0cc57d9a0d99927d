"""Wheels and IMU say what the motion does to them, each reading once, in order of time, before its picture."""

import numpy as np
import pytest

from vobench.pipeline.motion import travel_of
from vobench.pipeline.sense import SensorFeed, wheel_error_m
from vobench.suite.expand import read_plan

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
    travel, writer = travel_of(case), Writer()
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


def test_what_flies_has_no_wheels_to_read(case):
    _, writer = fed(case("kind: rail, points_m: [[0, 0, 1], [1, 0, 1]]"))
    assert writer.of("encoders") == []
    assert writer.of("imu")


@pytest.mark.parametrize(
    ("way", "least_m", "most_m"),
    [
        (f"{CIRCLE}, encoders: exact", 0, 2e-4),
        (f"{CIRCLE}", 2e-3, 0.1),
        ("kind: square, side_m: 0.5, mover: unicycle, encoders: exact", 0, 2e-4),
        ("kind: reverse, length_m: 0.5, encoders: exact", 0, 2e-4),
        ("kind: circle, radius_m: 1, mover: ackermann, encoders: exact", 0, 2e-3),
        ("targets_m: [[0.5, 0.5]], slip: none, encoders: exact", 0, 1e-3),
        ("targets_m: [[0.5, 0.5]], slip: slippery, encoders: exact", 1e-3, 0.3),
    ],
)
def test_an_odometer_is_off_by_slip_and_by_its_wheels_errors_alone(case, way, least_m, most_m):
    it = case(way)
    assert least_m <= wheel_error_m(it, travel_of(it)) <= most_m


def test_without_wheels_there_is_no_odometer(case):
    it = case("kind: rail, points_m: [[0, 0, 1], [1, 0, 1]]")
    assert wheel_error_m(it, travel_of(it)) is None
