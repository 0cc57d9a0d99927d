"""A program of any language that takes frames on standard input and gives poses on standard output.

docs/estimators.md has the specification. Every message is a tag of four letters, the length of what follows in bytes
(uint32), and that; all numbers are little-endian.
"""

import json
import os
import select
import struct
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import numpy as np

from vobench.errors import VobenchError
from vobench.estimator.command import filled
from vobench.estimator.manifest import Limits
from vobench.estimator.process import ANSWER_BYTES, Answer, checked, checked_revision
from vobench.estimator.program import LOOK_S, EstimatorFailure, Program
from vobench.estimator.protocol import Frame, Result, Status
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array

VERSION = 1
HEADER = struct.Struct("<4sI")
FRAME = struct.Struct("<qqIIIIII")  # index, t_ns, width, height, channels, pictures, IMU readings, encoder readings
POSE = struct.Struct("<qII")  # index, status, what follows: 1 a pose, 2 a covariance
STATUSES = tuple(Status)
LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])


class StreamProgram:
    """A running program that is handed one frame at a time. Its verbs raise EstimatorFailure."""

    def __init__(self, argv: Sequence[str], folder: Path, *, log: Path, limits: Limits, rate_hz: float) -> None:
        self._argv, self._folder, self._log, self._limits, self._rate_hz = argv, folder, log, limits, rate_hz
        self._door: AbstractContextManager[Program] | None = None

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Start it, hand over the calibration, and wait until it is ready."""
        argv = filled(self._argv, self._folder, {**params, "seed": seed, "rate_hz": self._rate_hz})
        pipe = subprocess.PIPE
        self._program = self._door = Program(
            argv, log=self._log, limits=self._limits, stdin=pipe, stdout=pipe, bufsize=0
        )
        process = self._program.process
        assert process.stdin
        assert process.stdout
        self._input, self._output = process.stdin.fileno(), process.stdout.fileno()
        os.set_blocking(self._input, False)
        said = {"version": VERSION, "seed": seed, "rate_hz": self._rate_hz, "params": dict(params), **calibration(rig)}
        self._limit_s = self._limits.start_s
        until = time.monotonic() + self._limit_s
        self._send(b"CALB", [json.dumps(said).encode()], until)
        self._receive("its start", {b"REDY"}, until)

    def process(self, frame: Frame) -> Answer:
        """Hand over the next frame; what the program says of it, checked."""
        self._program.look(at_once=True)
        cpu_s, self._limit_s, began = self._program.cpu_s, self._limits.frame_s, time.monotonic()
        until = began + self._limit_s
        self._send(b"FRAM", framed(frame), until)
        _, payload = self._receive(f"frame {frame.index}", {b"POSE"}, until)
        wall_s = time.monotonic() - began
        self._program.look(at_once=True)
        try:
            result = checked(_result(payload, frame.index), frame.index)
        except (VobenchError, struct.error, ValueError) as error:
            raise EstimatorFailure("invalid_output", " ".join(str(error).split())) from None
        return Answer(result, 1e3 * wall_s, 1e3 * (self._program.cpu_s - cpu_s), self._program.peak_mib)

    def finish(self) -> dict[int, Array]:
        """Say that there are no more frames; the poses that it revises, until it says so too or ends well."""
        revised, self._limit_s = dict[int, Array](), self._program.left_s()
        until = time.monotonic() + self._limit_s
        try:
            self._send(b"DONE", [], until)
            while (message := self._receive("the end", {b"REVI", b"DONE", b""}, until))[0] == b"REVI":
                index, T = _revision(message[1])
                revised[index] = T
            return checked_revision(revised)
        except (VobenchError, struct.error, ValueError) as error:
            raise EstimatorFailure("invalid_output", " ".join(str(error).split())) from None

    def _send(self, tag: bytes, parts: Sequence[bytes], until: float) -> None:
        for part in (HEADER.pack(tag, sum(map(len, parts))), *parts):
            left = memoryview(part)
            while left:
                self._await([], [self._input], until)
                try:
                    left = left[os.write(self._input, left) :]
                except BlockingIOError:
                    continue
                except BrokenPipeError:
                    if tag == b"DONE":
                        return
                    raise EstimatorFailure(*self._end("its input")) from None

    def _receive(self, what: str, tags: set[bytes], until: float) -> tuple[bytes, bytes]:
        """The next message; an empty tag where the program has ended well and may."""
        head = self._read(HEADER.size, what, until, may_end=b"" in tags)
        if not head:
            return b"", b""
        tag, length = HEADER.unpack(head)
        if tag == b"FAIL":
            reason = self._read(min(length, 4096), what, until).decode("utf-8", "replace")
            raise EstimatorFailure("refused", " ".join(reason.split()))
        if tag not in tags or length > ANSWER_BYTES:
            wanted = " or ".join(sorted(tag.decode() for tag in tags if tag))
            said = f"{tag!r} and {length} bytes"
            raise EstimatorFailure("invalid_output", f"{what}: it should answer {wanted}, but says {said}")
        return tag, self._read(length, what, until)

    def _read(self, length: int, what: str, until: float, *, may_end: bool = False) -> bytes:
        read = b""
        while len(read) < length:
            self._await([self._output], [], until)
            more = os.read(self._output, min(length - len(read), 1 << 20))
            if not more:
                kind, reason = self._end(what)
                if may_end and not read and kind == "invalid_output":
                    return b""
                torn = f": its answer breaks off after {len(read)} of {length} bytes" if read else ""
                raise EstimatorFailure(kind, reason + torn)
            read += more
        return read

    def _end(self, what: str) -> tuple[str, str]:
        """Status and reason of an end before its time."""
        try:
            if self._program.process.wait(timeout=5) == 0:
                return "invalid_output", f"{what}: it ended, with exit code 0"
        except subprocess.TimeoutExpired:
            return "invalid_output", f"{what}: it closed its output and lives on"
        return self._program.death()

    def _await(self, reads: list[int], writes: list[int], until: float) -> None:
        while True:
            ready = select.select(reads, writes, [], max(min(LOOK_S, until - time.monotonic()), 0))
            self._program.look()
            if any(ready):
                return
            if time.monotonic() > until:
                raise EstimatorFailure("timeout", f"no answer within {self._limit_s:g} s")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *end: Any) -> None:
        """End it, and whatever it has started."""
        if self._door:
            self._door.__exit__(*end)


def calibration(rig: Rig) -> dict[str, Any]:
    """A rig as JSON: cameras by their models, the left one first; places as (4, 4) in rows; None for what is not."""
    cameras = [_camera(rig.camera(side), rig.T_body_camera(side)) for side in rig.sides]
    imu = rig.imu and {**asdict(rig.imu), "T_body_imu": rig.imu.T_body_imu.tolist()}
    return {"cameras": cameras, "imu": imu, "wheels": asdict(rig.wheels) if rig.wheels else None}


def _camera(camera: Camera, T_body_camera: Array) -> dict[str, Any]:
    return {"model": type(camera).__name__, **asdict(camera), "T_body_camera": T_body_camera.tolist()}


def framed(frame: Frame) -> list[bytes]:
    """A frame's parts: FRAME, the pictures row by row, IMU readings and encoder counts, each after its stamp."""
    pictures = [picture for picture in (frame.left, frame.right) if picture is not None]
    height, width, channels = (*pictures[0].shape, 1)[:3] if pictures else (0, 0, 0)
    imu, encoders = frame.imu, frame.encoders
    counts = (len(pictures), 0 if imu is None else len(imu.t_ns), 0 if encoders is None else len(encoders.t_ns))
    parts = [FRAME.pack(frame.index, frame.t_ns, width, height, channels, *counts)]
    parts += [np.ascontiguousarray(picture).tobytes() for picture in pictures]
    if imu is not None:
        values = np.hstack([imu.gyro_radps, imu.accel_mps2]).astype("<f8")
        parts += [struct.pack("<q", t) + row.tobytes() for t, row in zip(imu.t_ns.tolist(), values, strict=True)]
    if encoders is not None:
        parts.append(np.column_stack([encoders.t_ns, encoders.ticks]).astype("<i8").tobytes())
    return parts


def _result(payload: bytes, asked: int) -> Result:
    """What a POSE says: its reason is the text behind the numbers."""
    index, status, what = POSE.unpack_from(payload)
    if index != asked:
        raise ValueError(f"frame {asked}: the answer is to frame {index}")
    if status >= len(STATUSES) or what > 3:
        raise ValueError(f"frame {asked}: no status {status} with contents {what}")
    at, T, P = POSE.size, None, None
    if what & 1:
        T, at = np.vstack([_numbers(payload, at, 12).reshape(3, 4), LAST_ROW]), at + 96
    if what & 2:
        P, at = _numbers(payload, at, 36).reshape(6, 6), at + 288
    return Result(T, STATUSES[status], payload[at:].decode("utf-8", "replace"), covariance=P)


def _revision(payload: bytes) -> tuple[int, Array]:
    (index,) = struct.unpack_from("<q", payload)
    return index, np.vstack([_numbers(payload, 8, 12).reshape(3, 4), LAST_ROW])


def _numbers(payload: bytes, at: int, count: int) -> Array:
    if len(payload) < at + 8 * count:
        raise ValueError(f"a message of {len(payload)} bytes should have {at + 8 * count} or more")
    return np.frombuffer(payload, "<f8", count, at)
