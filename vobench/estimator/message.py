"""The messages between vobench and an estimator, as bytes: the calibration and frames out, answers back.

docs/estimators.md has the specification. Every message is a tag of four letters, the length of what follows in bytes
(uint32), and that; all numbers are little-endian. What comes back is numbers and text: nothing of it is unpickled.
"""

import json
import pickle
import struct
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.estimator.check import InvalidOutputError, checked, checked_revision
from vobench.estimator.protocol import Frame, Result, Status, Tracks
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array

VERSION = 1
HEADER = struct.Struct("<4sI")
FRAME = struct.Struct("<qqIIIIII")  # index, t_ns, width, height, channels, pictures, IMU readings, encoder readings
ANSWER = struct.Struct("<qII")  # index, status, what follows: the sum of some of these
POSE = 1
COVARIANCE = 2
STATS = 4
TRACKS = 8
POINTS = 16
COUNT = struct.Struct("<I")
STATUSES = tuple(Status)
LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])
# What an estimator may say instead of an answer, and the status of its trial then.
FAILURES = {b"FAIL": "refused", b"CRSH": "crashed", b"NMEM": "out_of_memory", b"WRNG": "invalid_output"}
ANSWER_BYTES = 64 << 20  # a pose, some numbers, tracks and points; more is no answer but noise on the connection
STATS_BYTES = 1 << 16
REASON_BYTES = 1 << 12


def calibration(rig: Rig) -> dict[str, Any]:
    """A rig as JSON: cameras by their models, the left one first; places as (4, 4) in rows; None for what is not."""
    cameras = [_camera(rig.camera(side), rig.T_body_camera(side)) for side in rig.sides]
    imu = rig.imu and {**asdict(rig.imu), "T_body_imu": rig.imu.T_body_imu.tolist()}
    return {"cameras": cameras, "imu": imu, "wheels": asdict(rig.wheels) if rig.wheels else None}


def _camera(camera: Camera, T_body_camera: Array) -> dict[str, Any]:
    return {"model": type(camera).__name__, **asdict(camera), "T_body_camera": T_body_camera.tolist()}


def framed(frame: Frame) -> list[bytes | memoryview]:
    """A frame's parts: FRAME, the pictures row by row, IMU readings and encoder counts, each after its stamp."""
    pictures = [picture for picture in (frame.left, frame.right) if picture is not None]
    height, width, channels = (*pictures[0].shape, 1)[:3] if pictures else (0, 0, 0)
    imu = frame.imu
    encoders = frame.encoders
    counts = (len(pictures), 0 if imu is None else len(imu.t_ns), 0 if encoders is None else len(encoders.t_ns))
    parts: list[bytes | memoryview] = [FRAME.pack(frame.index, frame.t_ns, width, height, channels, *counts)]
    parts += [np.ascontiguousarray(picture).tobytes() for picture in pictures]
    if imu is not None:
        values = np.hstack([imu.gyro_radps, imu.accel_mps2]).astype("<f8")
        parts += [struct.pack("<q", t) + row.tobytes() for t, row in zip(imu.t_ns.tolist(), values, strict=True)]
    if encoders is not None:
        parts.append(np.column_stack([encoders.t_ns, encoders.ticks]).astype("<i8").tobytes())
    return parts


def pickled(frame: Frame) -> list[bytes | memoryview]:
    """A frame's parts for our own worker: its pickle and its arrays as they lie in memory, each after its length."""
    arrays = list[pickle.PickleBuffer]()
    said = pickle.dumps(frame, 5, buffer_callback=arrays.append)
    parts: list[bytes | memoryview] = [said, *(array.raw() for array in arrays)]
    return [each for part in parts for each in (COUNT.pack(len(part)), part)]


def unpickled(payload: bytearray) -> Frame:
    """The frame of these parts; its arrays are the payload's memory."""
    view = memoryview(payload)
    parts = list[memoryview]()
    while view:
        end = COUNT.size + COUNT.unpack_from(view)[0]
        parts.append(view[COUNT.size : end])
        view = view[end:]
    frame: Frame = pickle.loads(parts[0], buffers=parts[1:])
    return frame


def answered(result: Result, index: int) -> bytes:
    """What a POSE says: a checked result of a frame as bytes."""
    reason = result.reason.encode("utf-8", "replace")
    what = 0
    parts = list[bytes]()
    for bit, table in ((POSE, result.T_odom_frame), (COVARIANCE, result.covariance)):
        if table is not None:
            what |= bit
            parts.append((table[:3] if bit == POSE else table).astype("<f8").tobytes())
    if result.stats:
        said = json.dumps(dict(result.stats)).encode()
        if len(said) > STATS_BYTES:
            raise InvalidOutputError(f"frame {index}: {len(said)} bytes of stats, where {STATS_BYTES} are the limit")
        what |= STATS
        parts.append(COUNT.pack(len(said)) + said)
    tracks = result.tracks
    lines = None if tracks is None else np.column_stack([tracks.uv_last_px, tracks.uv_px, tracks.inlier])
    for bit, rows in ((TRACKS, lines), (POINTS, result.points)):
        if rows is not None:
            what |= bit
            parts.append(COUNT.pack(len(rows)) + rows.astype("<f8").tobytes())
    payload = b"".join([ANSWER.pack(index, STATUSES.index(result.status), what), *parts, reason])
    if len(payload) > ANSWER_BYTES:
        raise InvalidOutputError(
            f"frame {index}: an answer of {len(payload)} bytes, where {ANSWER_BYTES} are the limit"
        )
    return payload


def read_answer(payload: bytes, asked: int) -> Result:
    """The checked result that a POSE has of the frame that was asked for. Raises InvalidOutputError."""
    try:
        index, status, what = ANSWER.unpack_from(payload)
        if index != asked:
            raise InvalidOutputError(f"frame {asked}: the answer is to frame {index}")
        if status >= len(STATUSES) or what >= 2 * POINTS:
            raise InvalidOutputError(f"frame {asked}: no status {status} with contents {what}")
        said = _Reader(payload, ANSWER.size)
        T = np.vstack([said.numbers(3, 4), LAST_ROW]) if what & POSE else None
        P = said.numbers(6, 6) if what & COVARIANCE else None
        stats = json.loads(said.counted(STATS_BYTES)) if what & STATS else {}
        rows = said.numbers(said.count(), 5) if what & TRACKS else None
        points = said.numbers(said.count(), 3) if what & POINTS else None
        tracks = None if rows is None else Tracks(rows[:, :2], rows[:, 2:4], rows[:, 4] != 0)
        reason = payload[said.at : said.at + REASON_BYTES].decode("utf-8", "replace")
        with np.errstate(all="ignore"):
            return checked(Result(T, STATUSES[status], reason, tracks, stats, P, points), asked)
    except InvalidOutputError:
        raise
    except (struct.error, ValueError, RecursionError) as error:
        raise InvalidOutputError(f"frame {asked}: {error}") from None


def revision(index: int, T_odom_frame: Array) -> bytes:
    """What a REVI says: a revised pose."""
    return struct.pack("<q", index) + T_odom_frame[:3].astype("<f8").tobytes()


def read_revision(payload: bytes) -> Mapping[int, Array]:
    """The checked pose of a REVI, by its frame's index. Raises InvalidOutputError."""
    try:
        (index,) = struct.unpack_from("<q", payload)
        with np.errstate(all="ignore"):
            return checked_revision({index: np.vstack([_Reader(payload, 8).numbers(3, 4), LAST_ROW])})
    except (struct.error, ValueError) as error:
        raise InvalidOutputError(f"finish(): {error}") from None


class _Reader:
    """Reads one thing after another from a message. Raises InvalidOutputError where it is too short."""

    def __init__(self, payload: bytes, at: int) -> None:
        self._payload = payload
        self.at = at

    def _take(self, length: int) -> bytes:
        self.at += length
        if self.at > len(self._payload):
            raise ValueError(f"a message of {len(self._payload)} bytes should have {self.at} or more")
        return self._payload[self.at - length : self.at]

    def count(self) -> int:
        """A uint32."""
        return int(COUNT.unpack(self._take(COUNT.size))[0])

    def counted(self, most: int) -> bytes:
        """So many bytes as the uint32 before them says, `most` at most."""
        length = self.count()
        if length > most:
            raise ValueError(f"{length} bytes of stats, where {most} are the limit")
        return self._take(length)

    def numbers(self, rows: int, columns: int) -> NDArray[np.float64]:
        """A table of float64."""
        return np.frombuffer(self._take(8 * rows * columns), "<f8").reshape(rows, columns)
