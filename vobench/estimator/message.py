"""Encodes and decodes the messages between vobench and an estimator: calibration, frames and answers.

docs/estimators.md has the specification. A message consists of a tag of four letters, the length of its payload in
bytes (uint32), and the payload. All numbers are little-endian. Answers contain only numbers and text, and are never
unpickled.
"""

import json
import pickle
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.estimator.check import InvalidOutputError, checked, checked_revision
from vobench.estimator.protocol import Frame, Image, Result, Status, Tracks
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array

VERSION = 1
HEADER = struct.Struct("<4sI")
FRAME = struct.Struct("<qqIIIIII")  # index, t_ns, width, height, channels, pictures, IMU readings, encoder readings
STAMP = struct.Struct("<q")  # t_ns of a reading, or the index of a frame
ANSWER = struct.Struct("<qII")  # index, status, contents (a sum of the bits below)
POSE = 1
COVARIANCE = 2
STATS = 4
TRACKS = 8
POINTS = 16
COUNT = struct.Struct("<I")
STATUSES = tuple(Status)
LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])
# The tags of failures, which can be sent instead of an answer, and the resulting status of the trial.
FAILURES = {b"FAIL": "refused", b"CRSH": "crashed", b"NMEM": "out_of_memory", b"WRNG": "invalid_output"}
ANSWER_BYTES = 64 << 20  # the limit of an answer; a larger length means that the bytes are not a message
STATS_BYTES = 1 << 16
REASON_BYTES = 1 << 12


def calibration(rig: Rig) -> dict[str, Any]:
    """The content of a rig for JSON: cameras, the left one first, and poses (4, 4) by rows.

    A missing sensor is None.
    """
    cameras = []
    for side in rig.sides:
        T_body_camera = rig.T_body_camera(side)
        cameras.append(_camera(rig.camera(side), T_body_camera))
    imu = None
    if rig.imu:
        imu = {**asdict(rig.imu), "T_body_imu": rig.imu.T_body_imu.tolist()}
    wheels = asdict(rig.wheels) if rig.wheels else None
    return {"cameras": cameras, "imu": imu, "wheels": wheels}


def _camera(camera: Camera, T_body_camera: Array) -> dict[str, Any]:
    return {"model": type(camera).__name__, **asdict(camera), "T_body_camera": T_body_camera.tolist()}


def framed(frame: Frame) -> list[bytes | memoryview]:
    """The parts of a frame: FRAME, the pictures by rows, and the IMU readings and encoder counts with their stamps."""
    parts: list[bytes | memoryview] = [_frame_head(frame)]
    parts += [np.ascontiguousarray(picture).data.cast("B") for picture in _pictures(frame)]
    if frame.imu is not None:
        vectors = np.hstack([frame.imu.gyro_radps, frame.imu.accel_mps2]).astype("<f8")
        rows = []
        for t_ns, vector in zip(frame.imu.t_ns.tolist(), vectors, strict=True):
            rows.append(STAMP.pack(t_ns) + vector.tobytes())
        parts.append(b"".join(rows))
    if frame.encoders is not None:
        counts = np.column_stack([frame.encoders.t_ns, frame.encoders.ticks])
        parts.append(counts.astype("<i8").tobytes())
    return parts


def _pictures(frame: Frame) -> list[Image]:
    return [picture for picture in (frame.left, frame.right) if picture is not None]


def _frame_head(frame: Frame) -> bytes:
    pictures = _pictures(frame)
    height = 0
    width = 0
    channels = 0
    if pictures:
        height, width, channels = (*pictures[0].shape, 1)[:3]  # a grey picture has one channel
    imu_readings = 0 if frame.imu is None else len(frame.imu.t_ns)
    encoder_readings = 0 if frame.encoders is None else len(frame.encoders.t_ns)
    return FRAME.pack(frame.index, frame.t_ns, width, height, channels, len(pictures), imu_readings, encoder_readings)


def pickled(frame: Frame) -> list[memoryview]:
    """The contents of a frame for vobench's worker: its pickle, and its arrays."""
    arrays = list[pickle.PickleBuffer]()
    head = pickle.dumps(frame, 5, buffer_callback=arrays.append)
    return [memoryview(head), *(array.raw() for array in arrays)]


def counted_parts(contents: Sequence[memoryview]) -> list[bytes | memoryview]:
    """The parts of a message with contents, each after its length."""
    parts: list[bytes | memoryview] = []
    for content in contents:
        parts += [COUNT.pack(len(content)), content]
    return parts


def shared_parts(contents: Sequence[memoryview]) -> list[bytes | memoryview]:
    """The parts of a message about a frame whose arrays are in shared memory: its pickle, and their lengths."""
    head, *arrays = contents
    return [COUNT.pack(len(head)), head, *(COUNT.pack(len(array)) for array in arrays)]


def unpickled(payload: bytearray | memoryview) -> Frame:
    """The frame in a payload of `counted_parts`. Its arrays share the memory of the payload."""
    view = memoryview(payload)
    contents = list[memoryview]()
    while view:
        (length,) = COUNT.unpack_from(view)
        end = COUNT.size + length
        contents.append(view[COUNT.size : end])
        view = view[end:]
    return _frame(contents[0], contents[1:])


def unpickled_shared(payload: memoryview, copy: Callable[[int], memoryview]) -> Frame:
    """The frame in a payload of `shared_parts`. `copy` returns a copy of the first bytes of the shared memory."""
    (head_length,) = COUNT.unpack_from(payload)
    head_end = COUNT.size + head_length
    lengths = [length for (length,) in COUNT.iter_unpack(payload[head_end:])]
    content = copy(sum(lengths))
    arrays = list[memoryview]()
    start = 0
    for length in lengths:
        arrays.append(content[start : start + length])
        start += length
    return _frame(payload[COUNT.size : head_end], arrays)


def _frame(head: memoryview, arrays: Sequence[memoryview]) -> Frame:
    frame: Frame = pickle.loads(head, buffers=arrays)
    return frame


def answered(result: Result, index: int) -> bytes:
    """The payload of a POSE with the checked result of a frame. Raises InvalidOutputError if it is too long."""
    contents = 0
    parts = list[bytes]()
    if result.T_odom_frame is not None:
        contents |= POSE
        parts.append(_numbers(result.T_odom_frame[:3]))
    if result.covariance is not None:
        contents |= COVARIANCE
        parts.append(_numbers(result.covariance))
    if result.stats:
        contents |= STATS
        stats = json.dumps(dict(result.stats)).encode()
        if len(stats) > STATS_BYTES:
            raise InvalidOutputError(f"frame {index}: {len(stats)} bytes of stats, where {STATS_BYTES} are the limit")
        parts.append(COUNT.pack(len(stats)) + stats)
    if result.tracks is not None:
        contents |= TRACKS
        tracks = result.tracks
        rows = np.column_stack([tracks.uv_last_px, tracks.uv_px, tracks.inlier])
        parts.append(COUNT.pack(len(rows)) + _numbers(rows))
    if result.points is not None:
        contents |= POINTS
        parts.append(COUNT.pack(len(result.points)) + _numbers(result.points))

    head = ANSWER.pack(index, STATUSES.index(result.status), contents)
    reason = result.reason.encode("utf-8", "replace")
    payload = b"".join([head, *parts, reason])
    if len(payload) > ANSWER_BYTES:
        raise InvalidOutputError(
            f"frame {index}: an answer of {len(payload)} bytes, where {ANSWER_BYTES} are the limit"
        )
    return payload


def _numbers(array: Array) -> bytes:
    return array.astype("<f8").tobytes()


def read_answer(payload: bytes, requested: int) -> Result:
    """The checked result in the payload of a POSE. Raises InvalidOutputError, also for another frame."""
    try:
        with np.errstate(all="ignore"):
            return checked(_read_result(payload, requested), requested)
    except InvalidOutputError:
        raise
    except (struct.error, ValueError, RecursionError) as error:
        raise InvalidOutputError(f"frame {requested}: {error}") from None


def _read_result(payload: bytes, requested: int) -> Result:
    index, status, contents = ANSWER.unpack_from(payload)
    if index != requested:
        raise InvalidOutputError(f"frame {requested}: the answer is to frame {index}")
    if status >= len(STATUSES) or contents >= 2 * POINTS:
        raise InvalidOutputError(f"frame {requested}: no status {status} with contents {contents}")

    reader = _Reader(payload, ANSWER.size)
    T_odom_frame = reader.pose() if contents & POSE else None
    covariance = reader.numbers(6, 6) if contents & COVARIANCE else None
    stats = json.loads(reader.counted(STATS_BYTES)) if contents & STATS else {}
    tracks = reader.tracks() if contents & TRACKS else None
    points = reader.numbers(reader.count(), 3) if contents & POINTS else None
    reason = reader.rest(REASON_BYTES).decode("utf-8", "replace")
    return Result(T_odom_frame, STATUSES[status], reason, tracks, stats, covariance, points)


def revision(index: int, T_odom_frame: Array) -> bytes:
    """The payload of a REVI with a revised pose."""
    return STAMP.pack(index) + _numbers(T_odom_frame[:3])


def read_revision(payload: bytes) -> Mapping[int, Array]:
    """The checked pose in the payload of a REVI, by the index of its frame. Raises InvalidOutputError."""
    try:
        (index,) = STAMP.unpack_from(payload)
        T_odom_frame = _Reader(payload, STAMP.size).pose()
        with np.errstate(all="ignore"):
            return checked_revision({index: T_odom_frame})
    except (struct.error, ValueError) as error:
        raise InvalidOutputError(f"finish(): {error}") from None


class _Reader:
    """Reads the parts of a message in their order. Raises ValueError if the message is too short."""

    def __init__(self, payload: bytes, start: int) -> None:
        self._payload = payload
        self._position = start

    def _take(self, length: int) -> bytes:
        start = self._position
        self._position += length
        if self._position > len(self._payload):
            raise ValueError(f"a message of {len(self._payload)} bytes should have {self._position} or more")
        return self._payload[start : self._position]

    def count(self) -> int:
        """A uint32."""
        (count,) = COUNT.unpack(self._take(COUNT.size))
        return int(count)

    def counted(self, limit: int) -> bytes:
        """A run of bytes whose length, a uint32 of at most `limit`, comes before it."""
        length = self.count()
        if length > limit:
            raise ValueError(f"{length} bytes of stats, where {limit} are the limit")
        return self._take(length)

    def numbers(self, rows: int, columns: int) -> NDArray[np.float64]:
        """A table (rows, columns) of float64."""
        values = np.frombuffer(self._take(8 * rows * columns), "<f8")
        return values.reshape(rows, columns)

    def pose(self) -> NDArray[np.float64]:
        """A transform (4, 4), whose first three rows are in the message."""
        return np.vstack([self.numbers(3, 4), LAST_ROW])

    def tracks(self) -> Tracks:
        """Tracks, one per row: the last pixel, the current pixel, and whether it is an inlier."""
        rows = self.numbers(self.count(), 5)
        return Tracks(rows[:, :2], rows[:, 2:4], rows[:, 4] != 0)

    def rest(self, limit: int) -> bytes:
        """The remaining bytes, at most `limit`."""
        return self._payload[self._position : self._position + limit]
