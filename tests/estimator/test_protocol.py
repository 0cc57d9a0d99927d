"""The contract of estimators: what their messages hold by default, and that nobody can change a message."""

from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest

from vobench import plugin
from vobench.estimator import protocol
from vobench.estimator.protocol import EncoderReadings, Frame, Result, Status, Tracks

MESSAGES = {
    "frame": Frame(3, 10**9),
    "result": Result(np.eye(4)),
    "tracks": Tracks(np.zeros((2, 2)), np.ones((2, 2)), np.array([True, False])),
    "encoder readings": EncoderReadings(np.array([5, 6]), np.array([[1, 2], [3, 4]])),
}


@pytest.mark.parametrize("name", MESSAGES)
def test_no_field_of_a_message_can_be_replaced_or_added(name):
    message = MESSAGES[name]
    for field in fields(message):
        with pytest.raises(FrozenInstanceError):
            setattr(message, field.name, None)
    assert not hasattr(message, "__dict__")


def test_a_frame_has_only_the_data_that_are_put_into_it():
    frame = MESSAGES["frame"]
    assert (frame.index, frame.t_ns) == (3, 10**9)
    sensors = [frame.left, frame.right, frame.encoders, frame.imu]
    assert sensors == [None] * 4


def test_a_result_with_only_a_pose_is_ok_and_says_nothing_else():
    result = MESSAGES["result"]
    assert result.status is Status.OK
    assert result.reason == ""
    assert dict(result.stats) == {}
    assert (result.tracks, result.covariance, result.points) == (None, None, None)


def test_the_stats_of_one_result_are_not_those_of_another():
    first = Result(None)
    second = Result(None)
    assert first.stats is not second.stats


def test_a_pose_has_to_be_given_even_if_there_is_none():
    with pytest.raises(TypeError, match="T_odom_frame"):
        Result()
    with pytest.raises(TypeError, match="t_ns"):
        Frame(0)


def test_a_status_is_the_word_that_is_written_to_files_in_this_order():
    """The order is part of the binary messages, in which a status is its place in the list."""
    assert [str(status) for status in Status] == ["init", "ok", "stationary", "degraded", "lost"]
    assert Status("degraded") is Status.DEGRADED
    with pytest.raises(ValueError, match="blind"):
        Status("blind")


def test_a_changed_copy_of_a_result_leaves_the_first_as_it_was():
    result = Result(np.eye(4), stats={"tracks": 5.0})
    lost = replace(result, T_odom_frame=None, status=Status.LOST, reason="dark")
    assert (lost.status, lost.stats) == (Status.LOST, {"tracks": 5.0})
    assert result.status is Status.OK
    np.testing.assert_array_equal(result.T_odom_frame, np.eye(4))


def test_plugins_import_the_same_classes():
    for name in ("EncoderReadings", "Estimator", "Frame", "Result", "Status", "Tracks"):
        assert getattr(plugin, name) is getattr(protocol, name)
