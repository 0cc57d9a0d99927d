"""Reading a sequence: sensors and truth through separate doors, frames one at a time."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.errors import SequenceError
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.sequence import bag
from vobench.sequence import messages as ros
from vobench.sequence.truth_image import truth_topics
from vobench.sequence.writer import CASE_ATTACHMENT, SENSORS_FILE, TRUTH_FILE, WHEELS_NOTE
from vobench.trajectory.trajectory import Trajectory

Image = NDArray[np.uint8]
IMAGE_TOPICS = (ros.LEFT_IMAGE, ros.RIGHT_IMAGE)


@dataclass(frozen=True, slots=True)
class StereoFrame:
    """Two grey pictures (H, W) uint8 of one instant."""

    index: int
    t_ns: int
    left: Image
    right: Image


@dataclass(frozen=True, slots=True)
class EncodedFrame:
    """The same two pictures as they lie in the file; `form` is png or jpeg."""

    index: int
    t_ns: int
    form: str
    left: bytes
    right: bytes


@dataclass(frozen=True, slots=True)
class Sequence:
    """All that an estimator may see of a recording; the truth is read by `read_truth`."""

    path: Path
    rig: Rig
    frame_count: int

    @classmethod
    def open(cls, folder: Path) -> "Sequence":
        """Check the sensors of a recording and read its calibration. Raises SequenceError."""
        path = Path(folder) / SENSORS_FILE
        counts = bag.check_topics(path, ros.SENSOR_TOPICS)
        if counts[ros.LEFT_IMAGE] != counts[ros.RIGHT_IMAGE] or not counts[ros.LEFT_IMAGE]:
            raise SequenceError(
                f"a recording needs as many left as right pictures and at least one, "
                f"got {counts[ros.LEFT_IMAGE]} and {counts[ros.RIGHT_IMAGE]}: {path}"
            )
        return cls(path, _read_rig(path, (ros.LEFT_INFO, ros.RIGHT_INFO)), counts[ros.LEFT_IMAGE])

    def __len__(self) -> int:
        return self.frame_count

    def encoded_frames(self) -> Iterator[EncodedFrame]:
        """The stereo pairs in order, undecoded."""
        images, count = bag.messages(self.path, IMAGE_TOPICS), 0
        for (left_topic, left), (right_topic, right) in zip(images, images, strict=False):
            t_ns = ros.stamp_ns(left)
            if (left_topic, right_topic) != IMAGE_TOPICS or ros.stamp_ns(right) != t_ns:
                raise SequenceError(f"frame {count} is no left and right picture of one stamp in {self.path}")
            yield EncodedFrame(count, t_ns, left.format, left.data.tobytes(), right.data.tobytes())
            count += 1
        if count != self.frame_count:
            raise SequenceError(f"{count} frames found, but its summary says {self.frame_count}: {self.path}")

    def frames(self) -> Iterator[StereoFrame]:
        """The stereo pairs in order; only the current one is held in memory."""
        for frame in self.encoded_frames():
            left = _decode(frame.left, self.rig.left, f"left picture {frame.index} of {self.path}")
            right = _decode(frame.right, self.rig.camera("right"), f"right picture {frame.index} of {self.path}")
            yield StereoFrame(frame.index, frame.t_ns, left, right)

    def encoders(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Stamps (M,) and counts (M, 2) of all encoder readings, left and right."""
        readings = [(ros.stamp_ns(m), m.left, m.right) for _, m in bag.messages(self.path, (ros.ENCODERS,))]
        table = np.array(readings, np.int64).reshape(-1, 3)
        return table[:, 0].copy(), table[:, 1:].copy()

    def exposures(self) -> tuple[NDArray[np.int64], Array]:
        """Stamps (N,) of all pairs, and their exposure times in s and gains in dB (N, 2)."""
        found = [(ros.stamp_ns(m), m.time_s, m.gain_db) for _, m in bag.messages(self.path, (ros.EXPOSURE,))]
        stamps = np.array([t for t, _, _ in found], np.int64)
        return stamps, np.array([(time_s, gain_db) for _, time_s, gain_db in found], float).reshape(-1, 2)


def read_truth(folder: Path) -> Trajectory:
    """The true path of base_link in map. Raises SequenceError where the file is not whole."""
    path = Path(folder) / TRUTH_FILE
    bag.check_topics(path, ros.TRUTH_TOPICS)
    rows = [(ros.stamp_ns(m), ros.pose_fields(m.pose.pose)) for _, m in bag.messages(path, (ros.ODOMETRY,))]
    fields = np.array([pose for _, pose in rows], float).reshape(-1, 7)
    return Trajectory(np.array([t for t, _ in rows], np.int64), ros.poses(fields))


def read_true_rig(folder: Path) -> Rig:
    """The rig that the pictures were made with, where the one of `Sequence` is what estimators are told.

    Raises SequenceError where the file is not whole, or is of the time before it held the true rig.
    """
    path = Path(folder) / TRUTH_FILE
    bag.check_topics(path, (ros.TF_STATIC, *ros.TRUE_INFO_TOPICS))
    return _read_rig(path, ros.TRUE_INFO_TOPICS)


def read_case(folder: Path) -> bytes:
    """The case that a recording was made from, as its writer gave it."""
    return bag.attachment(Path(folder) / TRUTH_FILE, CASE_ATTACHMENT)


def payload_hash(folder: Path) -> str:
    """SHA-256 over all that was recorded: pixels instead of encoded bytes, which change with libpng."""
    digest = hashlib.sha256()
    for name, topics, later in (
        (SENSORS_FILE, ros.SENSOR_TOPICS, ()),
        (TRUTH_FILE, ros.TRUTH_TOPICS, (*ros.TRUE_INFO_TOPICS, *truth_topics())),
    ):
        path = Path(folder) / name
        bag.check_topics(path, topics)
        for topic, data in bag.raw_messages(path, (*topics, *later)):
            payload = _pixels(data, path) if topic in IMAGE_TOPICS else data
            digest.update(f"{topic.name} {len(payload)}\n".encode())
            digest.update(payload)
    wheels = bag.note(Path(folder) / SENSORS_FILE, WHEELS_NOTE)
    digest.update(repr(sorted(wheels.items())).encode())
    return digest.hexdigest()


def _pixels(data: bytes, path: Path) -> bytes:
    message: Any = ros.TYPES.deserialize_cdr(data, ros.LEFT_IMAGE.type_name)
    image = _decode(message.data.tobytes(), None, f"a picture of {path}")
    return f"{ros.stamp_ns(message)} {image.shape}\n".encode() + image.tobytes()


def _decode(encoded: bytes, camera: Camera | None, name: str) -> Image:
    """A grey picture from its PNG or JPEG. Raises SequenceError where it is none, or not of the camera's size."""
    image = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_UNCHANGED) if encoded else None
    if image is None or image.ndim != 2 or image.dtype != np.uint8:
        raise SequenceError(f"not an 8-bit grey PNG or JPEG: {name}")
    if camera and image.shape != (camera.height_px, camera.width_px):
        raise SequenceError(f"{image.shape} pixels, but the camera has {camera.height_px, camera.width_px}: {name}")
    return image.astype(np.uint8, copy=False)


def _read_rig(path: Path, info_topics: tuple[ros.Topic, ros.Topic]) -> Rig:
    """The rig from calibration, static transforms and the wheels' metadata."""
    left, right = (_first(path, topic) for topic in info_topics)
    T_body_left, T_body_right = _read_mounts(path)
    return Rig(ros.camera(left), ros.camera(right), T_body_left, T_body_right, _read_wheels(path))


def _first(path: Path, topic: ros.Topic) -> Any:
    for _, message in bag.messages(path, (topic,)):
        return message
    raise SequenceError(f"{topic.name} has no message in {path}")


def _read_mounts(path: Path) -> tuple[Array, Array]:
    stamped = _first(path, ros.TF_STATIC).transforms
    T_body = {t.child_frame_id: ros.poses(ros.pose_fields(t.transform)) for t in stamped}
    missing = {ros.LEFT, ros.RIGHT} - T_body.keys()
    if missing:
        raise SequenceError(f"{ros.TF_STATIC.name} does not say where {min(missing)} is mounted in {path}")
    return T_body[ros.LEFT], T_body[ros.RIGHT]


def _read_wheels(path: Path) -> WheelGeometry:
    entries = bag.note(path, WHEELS_NOTE)
    try:
        radius_m, track_m = float(entries["radius_m"]), float(entries["track_m"])
        return WheelGeometry(radius_m, track_m, int(entries["ticks_per_revolution"]))
    except (KeyError, ValueError) as error:
        raise SequenceError(f"the wheels are not described as radius, track and ticks ({error!r}) in {path}") from error
