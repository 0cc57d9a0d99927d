"""A stream estimator in Python, without vobench, that never moves; put your own odometry where `pose` is made.

Its manifest says `stream: [python3, ./stream_client.py]`, or your own interpreter: /path/venv/bin/python.
docs/estimators.md has every field.
"""

import json
import struct
import sys

import numpy as np

FRAME = struct.Struct("<qqIIIIII")
OK = 1
LOST = 4


def read(length: int) -> bytes:
    """So many bytes of standard input; the program ends where there are none."""
    data = sys.stdin.buffer.read(length)
    if len(data) < length:
        sys.exit(2)
    return data


def send(tag: bytes, payload: bytes = b"") -> None:
    """One message on standard output."""
    sys.stdout.buffer.write(struct.pack("<4sI", tag, len(payload)) + payload)
    sys.stdout.buffer.flush()


def pictures(payload: bytes) -> list[np.ndarray]:
    """The left and the right picture (H, W) or (H, W, 3) of a frame, as far as they were asked for."""
    _, _, width, height, channels, count, _, _ = FRAME.unpack_from(payload)
    values = np.frombuffer(payload, np.uint8, count * width * height * channels, FRAME.size)
    return list(values.reshape(count, height, width, *([channels] if channels == 3 else [])))


calibration = {}
while True:
    tag, length = struct.unpack("<4sI", read(8))
    payload = read(length)
    if tag == b"CALB":
        calibration = json.loads(payload)
        print("cameras:", len(calibration["cameras"]), file=sys.stderr)
        send(b"REDY")
    elif tag == b"FRAM":
        index = FRAME.unpack_from(payload)[0]
        eyes = pictures(payload)
        pose = np.eye(4)  # T_odom_left
        send(b"POSE", struct.pack("<qII", index, OK, 1) + pose[:3].astype("<f8").tobytes())
    elif tag == b"DONE":
        send(b"DONE")
        break
