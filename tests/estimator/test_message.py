"""Messages: what is written is read back, and what is torn or wrong is refused with the frame's number."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest

from vobench.estimator.check import InvalidOutputError
from vobench.estimator.message import (
    ANSWER,
    ANSWER_BYTES,
    COUNT,
    FRAME,
    POINTS,
    REASON_BYTES,
    STATS,
    STATS_BYTES,
    STATUSES,
    answered,
    calibration,
    counted_parts,
    framed,
    pickled,
    read_answer,
    read_revision,
    revision,
    shared_parts,
    unpickled,
    unpickled_shared,
)
from vobench.estimator.protocol import EncoderReadings, Frame, ImuReadings, Result, Status, Tracks
from vobench.geometry import se3
from vobench.geometry.rig import PIONEER_WHEELS, paper_lens, stereo_rig
from vobench.sensor.imu import IMUS

RNG = np.random.default_rng(1)
POSE = se3.transform(se3.rotation_z(0.3), [1.0, -2.0, 3.0])
A = RNG.normal(size=(6, 12))
FULL = Result(
    POSE,
    Status.DEGRADED,
    "dim",
    Tracks(RNG.uniform(size=(3, 2)), RNG.uniform(size=(3, 2)), np.array([True, False, True])),
    {"a": 1.5, "b": -2.0},
    A @ A.T,
    RNG.normal(size=(4, 3)),
)


def assert_equal_results(one: Result, other: Result) -> None:
    assert (one.status, one.reason, dict(one.stats)) == (other.status, other.reason, dict(other.stats))
    for name in ("T_odom_frame", "covariance", "points"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.tracks is None) == (other.tracks is None)
    if one.tracks is not None:
        for name in ("uv_last_px", "uv_px", "inlier"):
            np.testing.assert_array_equal(getattr(one.tracks, name), getattr(other.tracks, name))


@pytest.mark.parametrize(
    "result",
    [
        FULL,
        Result(POSE),
        Result(None, Status.LOST, "dark"),
        Result(None, Status.INIT, stats={"x": 1.0}),
        Result(POSE, covariance=FULL.covariance),
        Result(POSE, points=FULL.points),
        Result(POSE, tracks=FULL.tracks),
    ],
    ids=["full", "pose", "lost", "stats", "covariance", "points", "tracks"],
)
def test_an_answer_is_read_as_it_was_written(result):
    assert_equal_results(read_answer(answered(result, 7), 7), result)


@pytest.mark.parametrize("status", list(Status))
def test_every_status_is_read_as_it_was_written(status):
    assert read_answer(answered(Result(POSE, status), 0), 0).status is status


def test_an_answer_to_another_frame_is_refused():
    with pytest.raises(InvalidOutputError, match="frame 8: the answer is to frame 7"):
        read_answer(answered(FULL, 7), 8)


def test_an_answer_that_breaks_off_anywhere_before_its_reason_is_refused():
    payload = answered(Result(POSE, stats={"a": 1.0}, tracks=FULL.tracks, points=FULL.points), 0)
    for length in range(len(payload)):
        with pytest.raises(InvalidOutputError, match=r"^frame 0: "):
            read_answer(payload[:length], 0)


@pytest.mark.parametrize(("status", "contents"), [(len(STATUSES), 0), (0, 2 * POINTS)])
def test_a_status_or_content_that_there_is_not_is_refused(status, contents):
    with pytest.raises(InvalidOutputError, match=f"frame 0: no status {status} with contents {contents}"):
        read_answer(ANSWER.pack(0, status, contents) + bytes(200), 0)


def test_the_last_status_and_all_contents_are_possible():
    payload = answered(Result(None, Status.LOST), 0)
    assert read_answer(payload, 0).status is STATUSES[-1]
    assert ANSWER.unpack_from(answered(FULL, 0))[2] == 2 * POINTS - 1


def test_stats_beyond_their_limit_are_refused_on_both_sides():
    stats = {"x" * 70 + str(n): 1.0 for n in range(1000)}
    assert len(json.dumps(stats)) > STATS_BYTES
    with pytest.raises(InvalidOutputError, match=f"frame 3: .* bytes of stats, where {STATS_BYTES} are the limit"):
        answered(Result(POSE, stats=stats), 3)
    claimed = ANSWER.pack(3, STATUSES.index(Status.LOST), STATS) + COUNT.pack(STATS_BYTES + 1) + bytes(STATS_BYTES + 1)
    with pytest.raises(InvalidOutputError, match=f"{STATS_BYTES + 1} bytes of stats, where {STATS_BYTES} are the"):
        read_answer(claimed, 3)


def test_stats_at_their_limit_are_taken():
    text = json.dumps({"x": 1.0})
    padded = text + " " * (STATS_BYTES - len(text))
    payload = ANSWER.pack(3, STATUSES.index(Status.LOST), STATS) + COUNT.pack(STATS_BYTES) + padded.encode()
    assert read_answer(payload, 3).stats == {"x": 1.0}


def test_an_answer_beyond_its_limit_is_refused():
    rows = ANSWER_BYTES // 24 + 1
    with pytest.raises(InvalidOutputError, match=f"frame 0: an answer of .* bytes, where {ANSWER_BYTES} are the limit"):
        answered(Result(POSE, points=np.zeros((rows, 3))), 0)


def test_an_answer_at_its_limit_is_sent():
    reason = "x" * (ANSWER_BYTES - ANSWER.size)
    assert len(answered(Result(None, Status.LOST, reason), 0)) == ANSWER_BYTES
    with pytest.raises(InvalidOutputError, match=f"an answer of {ANSWER_BYTES + 1} bytes"):
        answered(Result(None, Status.LOST, reason + "x"), 0)


def test_a_reason_is_cut_at_its_limit():
    payload = answered(Result(None, Status.LOST), 0) + b"x" * (2 * REASON_BYTES)
    assert set(read_answer(payload, 0).reason) == {"x"}


def test_a_revision_is_read_as_it_was_written():
    assert list(read_revision(revision(12, POSE))) == [12]
    np.testing.assert_array_equal(read_revision(revision(12, POSE))[12], POSE)
    with pytest.raises(InvalidOutputError, match=r"finish\(\): "):
        read_revision(revision(12, POSE)[:-1])


IMU = ImuReadings(np.array([5, 6], np.int64), RNG.normal(size=(2, 3)), RNG.normal(size=(2, 3)))
ENCODERS = EncoderReadings(np.array([4, 5, 6], np.int64), np.array([[1, 2], [3, 4], [5, 6]], np.int64))


def test_a_frames_parts_are_its_head_its_pictures_and_its_readings():
    left = np.arange(12, dtype=np.uint8).reshape(3, 4)
    head, *parts = framed(Frame(2, 6, left, left.T.copy().T + 1, ENCODERS, IMU))
    assert FRAME.unpack(head) == (2, 6, 4, 3, 1, 2, 2, 3)  # width, height, channels, pictures, IMU, encoders
    assert parts[0] == left.tobytes()
    assert parts[1] == (left + 1).tobytes()
    for row, values in enumerate(struct.iter_unpack("<q6d", parts[2])):
        assert values == (IMU.t_ns[row], *IMU.gyro_radps[row], *IMU.accel_mps2[row])
    assert row == 1
    assert struct.unpack("<9q", parts[3]) == (4, 1, 2, 5, 3, 4, 6, 5, 6)


def test_a_frame_without_pictures_has_no_size_and_a_colour_one_has_three_channels():
    (head,) = framed(Frame(2, 6))
    assert FRAME.unpack(head) == (2, 6, 0, 0, 0, 0, 0, 0)
    colour = framed(Frame(2, 6, np.zeros((3, 4, 3), np.uint8)))
    assert FRAME.unpack(colour[0])[2:6] == (4, 3, 3, 1)


def test_a_frame_for_the_worker_is_read_as_it_was_written():
    left = RNG.integers(0, 256, (30, 40)).astype(np.uint8)
    contents = pickled(Frame(2, 6, left, None, ENCODERS, IMU))
    memory = bytearray(b"".join(contents[1:]))
    frames = [
        unpickled(bytearray(b"".join(counted_parts(contents)))),
        unpickled_shared(
            memoryview(b"".join(shared_parts(contents))), lambda length: memoryview(bytearray(memory[:length]))
        ),
    ]
    for frame in frames:
        assert (frame.index, frame.t_ns, frame.right) == (2, 6, None)
        np.testing.assert_array_equal(frame.left, left)
        np.testing.assert_array_equal(frame.encoders.ticks, ENCODERS.ticks)
        np.testing.assert_array_equal(frame.imu.accel_mps2, IMU.accel_mps2)


def test_a_calibration_is_json_that_names_every_sensor_and_has_none_for_a_missing_one():
    rig = stereo_rig(paper_lens(square_pixels=True), pitch_deg=10)
    content = json.loads(json.dumps(calibration(rig)))
    assert [camera["model"] for camera in content["cameras"]] == [type(rig.left).__name__] * 2
    np.testing.assert_array_equal(content["cameras"][1]["T_body_camera"], rig.T_body_right)
    assert content["imu"] is None
    assert content["wheels"]["radius_m"] == PIONEER_WHEELS.radius_m

    imu = IMUS["adis16448"].calibration
    content = json.loads(json.dumps(calibration(replace(rig, imu=imu, wheels=None))))
    np.testing.assert_array_equal(content["imu"]["T_body_imu"], imu.T_body_imu)
    assert content["wheels"] is None
