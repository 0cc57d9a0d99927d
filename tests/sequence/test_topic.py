"""A recording has the topics of the sensors that its rig has."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import PIONEER_WHEELS, ImuCalibration, Rig, stereo_rig
from vobench.sequence.topic import (
    DISTURBANCE,
    ENCODERS,
    IMAGE_TOPICS,
    IMU,
    IMU_BIAS,
    INFO_TOPICS,
    TRUE_INFO_TOPICS,
    sensor_topics,
    truth_topics,
)


@pytest.fixture
def cameras_alone() -> Rig:
    rig = stereo_rig(Pinhole(48, 32, 40.0, 40.0, 23.5, 15.5), pitch_deg=0)
    return replace(rig, wheels=None, imu=None)


def added(before: Rig, after: Rig) -> tuple[set[object], set[object]]:
    """The topics of sensors and of truth that the second rig has and the first has not."""
    sensors = set(sensor_topics(after)) - set(sensor_topics(before))
    truth = set(truth_topics(after)) - set(truth_topics(before))
    return sensors, truth


def test_wheels_add_encoders_and_their_disturbances(cameras_alone):
    assert added(cameras_alone, replace(cameras_alone, wheels=PIONEER_WHEELS)) == ({ENCODERS}, {DISTURBANCE})


def test_an_imu_adds_its_readings_and_their_bias(cameras_alone):
    imu = ImuCalibration(np.eye(4), 200.0, 1e-3, 1e-2, 1e-5, 1e-4)
    assert added(cameras_alone, replace(cameras_alone, imu=imu)) == ({IMU}, {IMU_BIAS})


def test_a_second_camera_adds_its_picture_and_calibration(cameras_alone):
    single = replace(cameras_alone, right=None, T_body_right=None)
    assert added(single, cameras_alone) == ({INFO_TOPICS[1], IMAGE_TOPICS[1]}, {TRUE_INFO_TOPICS[1]})
