"""Reading a sequence: the sensors by `Sequence`, the truth by functions; frames one at a time or by number."""

import hashlib
from array import array
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench import stop
from vobench.errors import SequenceError
from vobench.geometry.rig import SIDES, Rig, Side
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuBias, ImuReadings
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame, TruthNames, check_channels
from vobench.sequence.bag import Bag
from vobench.sequence.calibration import read_rig
from vobench.sequence.cdr import parse_picture
from vobench.sequence.mcap_file import parsing, part_of
from vobench.sequence.message import NOT_ESTIMATED, PoseFields, pose_fields, poses_from_fields, stamp_ns
from vobench.sequence.picture import MONO, Image, decode
from vobench.sequence.pixel_truth import names_from_json, pixel_truth_topics, truth_topic, truth_values
from vobench.sequence.topic import (
    CASE_ATTACHMENT,
    DISTURBANCE,
    ENCODERS,
    EXPOSURE,
    IMAGE_TOPICS,
    IMPORT_NOTE,
    IMU,
    IMU_BIAS,
    IMU_NOTE,
    INFO_TOPICS,
    LEFT_IMAGE,
    LEFT_INFO,
    NAMES_ATTACHMENT,
    ODOMETRY,
    PROVENANCE_NOTE,
    SENSOR_TOPICS,
    SENSORS_FILE,
    TRUE_INFO_TOPICS,
    TRUTH_FILE,
    TRUTH_TOPICS,
    WHEELS_NOTE,
    Topic,
)
from vobench.trajectory.trajectory import Stamps, Trajectory

DISTURBANCE_FIELDS = ("left_slip", "right_slip", "side_slip_rad", "push_mps2", "turn_push_radps2")
LONGEST_PATH = 60  # characters in a repr


@dataclass(frozen=True, slots=True)
class StereoFrame:
    """Pictures (H, W) uint8 of one instant, (H, W, 3) where `colour` is rgb8; no `right` where there is one camera."""

    index: int
    t_ns: int
    left: Image
    right: Image | None
    colour: str = MONO


@dataclass(frozen=True, slots=True)
class EncodedFrame:
    """The pictures of one instant as the file has them; `form` is png or jpeg."""

    index: int
    t_ns: int
    form: str
    left: bytes
    right: bytes | None
    colour: str = MONO


@dataclass(frozen=True, slots=True)
class Sequence:
    """Everything that an estimator may see of a recording; the truth is read by `read_truth`."""

    path: Path
    rig: Rig
    frame_count: int
    bag: Bag = field(repr=False)

    @classmethod
    def open(cls, folder: Path) -> "Sequence":
        """Check the sensors of a recording and read its calibration. Raises SequenceError."""
        bag = Bag.open(Path(folder) / SENSORS_FILE)
        bag.require((LEFT_INFO, LEFT_IMAGE))
        rig = read_rig(bag, INFO_TOPICS)
        counts = [bag.count(topic) for topic in IMAGE_TOPICS[: len(rig.sides)]]
        if len(set(counts)) > 1 or not counts[0]:
            got = " and ".join(map(str, counts))
            raise SequenceError(
                f"a recording needs as many left as right images and at least one, got {got}: {bag.path}"
            )
        return cls(bag.path, rig, counts[0], bag)

    def __len__(self) -> int:
        return self.frame_count

    def __getitem__(self, index: int) -> StereoFrame:
        """One frame by its number, from the end where it is negative. Raises IndexError where there is none."""
        if not -self.frame_count <= index < self.frame_count:
            raise IndexError(f"frame {index} of a sequence with {self.frame_count} frames")
        return self.frame(index % self.frame_count)

    def __iter__(self) -> Iterator[StereoFrame]:
        """The frames in order, one at a time in memory."""
        return self.frames()

    def __repr__(self) -> str:
        path = str(self.path)
        if len(path) > LONGEST_PATH:
            path = f"…{path[-LONGEST_PATH:]}"
        cameras = " and ".join(self.rig.sides)
        return f"Sequence({path}, {self.frame_count} frames of {cameras})"

    @property
    def _image_topics(self) -> tuple[Topic, ...]:
        return IMAGE_TOPICS[: len(self.rig.sides)]

    def encoded_frames(self) -> Iterator[EncodedFrame]:
        """The frames in order, undecoded."""
        images = self.bag.raw(self._image_topics)
        cameras = len(self._image_topics)
        count = 0
        for pictures in zip(*[images] * cameras, strict=False):
            stop.check()
            yield self._encoded(count, pictures)
            count += 1
        if count != self.frame_count:
            raise SequenceError(f"{count} frames found, but its summary says {self.frame_count}: {self.path}")

    def _encoded(
        self,
        index: int,
        messages: Iterable[tuple[Topic, memoryview]],
    ) -> EncodedFrame:
        """The frame of one message of each camera. Raises SequenceError where they are not of one instant."""
        topics = []
        pictures = []
        with parsing(self.path):
            for topic, data in messages:
                topics.append(topic)
                pictures.append(parse_picture(data))
        stamps = {picture.t_ns for picture in pictures}
        if tuple(topics) != self._image_topics or len(stamps) > 1:
            raise SequenceError(f"frame {index} is not a left and a right image of one stamp in {self.path}")
        left = pictures[0]
        right = bytes(pictures[1].encoded) if len(pictures) > 1 else None
        return EncodedFrame(index, left.t_ns, left.codec, bytes(left.encoded), right, left.colour)

    def frames(self, *, right: bool = True) -> Iterator[StereoFrame]:
        """The frames in order, one in memory at a time; without `right`, the right pictures are not decoded."""
        for frame in self.encoded_frames():
            yield self._decoded(frame if right else replace(frame, right=None))

    def _decoded(self, frame: EncodedFrame) -> StereoFrame:
        name = f"image {frame.index} of {self.path}"
        left = decode(frame.left, self.rig.left, f"left {name}", colour=frame.colour)
        right = None
        if frame.right is not None:
            right = decode(frame.right, self.rig.camera("right"), f"right {name}", colour=frame.colour)
        return StereoFrame(frame.index, frame.t_ns, left, right, frame.colour)

    def frame(self, index: int) -> StereoFrame:
        """One frame; only its part of the file is read. Raises SequenceError where there is none."""
        messages = self.bag.nth(self._image_topics, index)
        return self._decoded(self._encoded(index, messages))

    def frame_at(self, t_ns: int) -> StereoFrame:
        """The last frame at or before an instant. Raises SequenceError where there is none yet."""
        stamps = self.bag.stamps(LEFT_IMAGE)
        not_later = int(np.searchsorted(stamps, t_ns, side="right"))
        if not not_later:
            raise SequenceError(f"there is no frame at or before {t_ns} ns in {self.path}")
        return self.frame(not_later - 1)

    def frame_stamps(self) -> Stamps:
        """The stamps (N,) of all frames, without reading a picture. Raises SequenceError where they are damaged.

        An index has no checksum, but the calibration of each frame has one of its own.
        """
        stamps = self.bag.stamps(LEFT_IMAGE)
        info_stamps = self.bag.stamps(LEFT_INFO)
        if len(stamps) == len(info_stamps) and not np.array_equal(stamps, info_stamps):
            raise SequenceError(f"images and calibration should have the same stamps, but do not in {self.path}")
        return stamps

    def encoders(self) -> tuple[Stamps, NDArray[np.int64]]:
        """Stamps (M,) and counts (M, 2) of all encoder readings, left and right; empty where there are no encoders."""
        readings = []
        for _, message in self.bag.messages((ENCODERS,)):
            readings.append((stamp_ns(message), message.left, message.right))
        table = np.array(readings, np.int64).reshape(-1, 3)
        return table[:, 0].copy(), table[:, 1:].copy()

    def exposures(self) -> tuple[Stamps, Array]:
        """Stamps (N,) of all frames, and their exposure times in s and gains in dB (N, 2); empty where not known."""
        return _table(self.bag, EXPOSURE, _exposure_fields, 2)

    def imu(self) -> ImuReadings:
        """All readings of the IMU, in its own axes; empty where there is none."""
        stamps, rows = _table(self.bag, IMU, _imu_fields, 6)
        return ImuReadings(stamps, rows[:, :3].copy(), rows[:, 3:].copy())


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _exposure_fields(message: Any) -> tuple[float, float]:
    return message.time_s, message.gain_db


def _imu_fields(message: Any) -> tuple[float, ...]:
    return *_xyz(message.angular_velocity), *_xyz(message.linear_acceleration)


def _bias_fields(message: Any) -> tuple[float, ...]:
    return *_xyz(message.gyro), *_xyz(message.accel)


def _pose_fields(message: Any) -> PoseFields:
    return pose_fields(message.pose.pose)


def _disturbance_fields(message: Any) -> list[float]:
    return [getattr(message, name) for name in DISTURBANCE_FIELDS]


def _table(
    bag: Bag,
    topic: Topic,
    row: Callable[[Any], Iterable[float]],
    width: int,
) -> tuple[Stamps, Array]:
    """Stamps (M,) of a topic's messages, and `row` of each of them (M, width)."""
    stamps = array("q")
    values = array("d")
    for _, message in bag.messages((topic,)):
        stamps.append(stamp_ns(message))
        values.extend(row(message))
    return np.array(stamps, np.int64), np.array(values, float).reshape(-1, width)


def _truth_bag(folder: Path) -> Bag:
    return Bag.open(Path(folder) / TRUTH_FILE)


def read_truth(folder: Path) -> Trajectory:
    """The true path of base_link in map. Raises SequenceError where the file is not whole."""
    bag = _truth_bag(folder)
    bag.require(TRUTH_TOPICS)
    stamps, fields = _table(bag, ODOMETRY, _pose_fields, 7)
    return Trajectory(stamps, poses_from_fields(fields))


def has_truth(folder: Path) -> bool:
    """Whether the true path is known; imported recordings may lack it. Raises SequenceError where its file is torn."""
    path = Path(folder) / TRUTH_FILE
    has_file = path.exists() or part_of(path).exists()
    return has_file and Bag.open(path).count(ODOMETRY) > 0


def read_twist(folder: Path) -> Array | None:
    """The true twist (N, 6) at the poses of `read_truth`, m/s then rad/s, in body axes; None where it is not known."""
    _, rows = _table(_truth_bag(folder), ODOMETRY, _twist_fields, 7)
    is_unknown = rows[:, 6] == NOT_ESTIMATED
    if not len(rows) or is_unknown.any():
        return None
    return rows[:, :6].copy()


def _twist_fields(message: Any) -> tuple[float, ...]:
    """The six numbers of a twist, and the first of its covariance, which is UNKNOWN for a twist that is not known."""
    twist = message.twist.twist
    return *_xyz(twist.linear), *_xyz(twist.angular), message.twist.covariance[0]


def read_imu_bias(folder: Path) -> ImuBias:
    """The biases in the IMU's readings; empty where there is no IMU."""
    stamps, rows = _table(_truth_bag(folder), IMU_BIAS, _bias_fields, 6)
    return ImuBias(stamps, rows[:, :3].copy(), rows[:, 3:].copy())


def read_disturbances(folder: Path) -> tuple[Stamps, Array]:
    """Stamps (N,), and left and right slip ratio, side slip in rad, pushes in m/s² and rad/s² (N, 5).

    Both are empty where no disturbances were recorded.
    """
    return _table(_truth_bag(folder), DISTURBANCE, _disturbance_fields, len(DISTURBANCE_FIELDS))


def read_true_rig(folder: Path) -> Rig:
    """The rig that the pictures were made with; `Sequence.rig` is the nominal one. Raises SequenceError."""
    return read_rig(_truth_bag(folder), TRUE_INFO_TOPICS)


def has_case(folder: Path) -> bool:
    """Whether a recording was made from a case. Raises SequenceError if the file with the truth is damaged."""
    return _truth_bag(folder).has_attachment(CASE_ATTACHMENT)


def read_case(folder: Path) -> bytes:
    """The case that a recording was made from, as its writer gave it. Raises SequenceError where it was imported."""
    return _truth_bag(folder).attachment(CASE_ATTACHMENT)


def read_provenance(folder: Path) -> dict[str, str]:
    """The versions of the software that made a recording, by name; empty where they were not noted."""
    return _truth_bag(folder).note(PROVENANCE_NOTE)


def read_import_notes(folder: Path) -> dict[str, str]:
    """The notes on the import of a recording, by name; empty for a recording that was not imported."""
    return _truth_bag(folder).note(IMPORT_NOTE)


def payload_hash(folder: Path) -> str:
    """SHA-256 over everything that was recorded: pixels instead of encoded bytes, which change with libpng."""
    sensors = Bag.open(Path(folder) / SENSORS_FILE)
    truth = _truth_bag(folder)
    optional_topics = (*TRUE_INFO_TOPICS, IMU_BIAS, DISTURBANCE, *pixel_truth_topics())
    digest = hashlib.sha256()
    for topic, data in sensors.raw(SENSOR_TOPICS):
        payload = _pixels(data, sensors.path) if topic in IMAGE_TOPICS else data
        digest.update(_length_line(topic, payload))
        digest.update(payload)
    for topic, data in truth.raw((*TRUTH_TOPICS, *optional_topics)):
        digest.update(_length_line(topic, data))
        digest.update(data)

    wheels = sensors.note(WHEELS_NOTE)
    digest.update(_sorted_entries(wheels))
    imu = sensors.note(IMU_NOTE)
    if imu:
        digest.update(_sorted_entries(imu))
    return digest.hexdigest()


def _length_line(topic: Topic, payload: bytes | memoryview) -> bytes:
    return f"{topic.name} {len(payload)}\n".encode()


def _sorted_entries(note: dict[str, str]) -> bytes:
    entries = sorted(note.items())
    return repr(entries).encode()


def _pixels(data: memoryview, path: Path) -> bytes:
    with parsing(path):
        picture = parse_picture(data)
    image = decode(picture.encoded, None, f"an image of {path}", colour=picture.colour)
    return f"{picture.t_ns} {image.shape}\n".encode() + image.tobytes()


@dataclass(frozen=True, slots=True)
class StereoTruth:
    """Per-pixel ground truth of the pictures of one instant; no `right` where there is one camera."""

    index: int
    t_ns: int
    left: TruthFrame
    right: TruthFrame | None


def truth_channels(folder: Path) -> tuple[str, ...]:
    """The channels of per-pixel ground truth in a sequence; most have none. Raises SequenceError for a torn file."""
    bag = _truth_bag(folder)
    return tuple(name for name in CHANNELS if bag.has(truth_topic("left", name)))


def read_truth_names(folder: Path) -> TruthNames:
    """The names of the ids of `instance` and `material`. Raises SequenceError where no channels were recorded."""
    return names_from_json(_truth_bag(folder).attachment(NAMES_ATTACHMENT))


def read_truth_frames(folder: Path, channels: Iterable[str] | None = None) -> Iterator[StereoTruth]:
    """Channels (None: all) of the pictures of each instant, one instant in memory at a time.

    Raises SequenceError where a channel was not recorded.
    """
    bag = _truth_bag(folder)
    recorded = truth_channels(folder)
    wanted = recorded if channels is None else check_channels(channels)
    for name in wanted:
        if name not in recorded:
            known = ", ".join(recorded) or "none"
            raise SequenceError(f"no truth channel '{name}' was recorded, only {known}: {bag.path}")
    return _truth_frames(bag, wanted)


def _channel_topics(bag: Bag, channels: tuple[str, ...]) -> dict[Topic, tuple[Side, str]]:
    """Side and channel by topic, of the cameras that have channels."""
    channel_of: dict[Topic, tuple[Side, str]] = {}
    for side in SIDES:
        topics = {truth_topic(side, name): (side, name) for name in channels}
        if any(bag.has(topic) for topic in topics):
            channel_of.update(topics)
    return channel_of


def _truth_frames(bag: Bag, channels: tuple[str, ...]) -> Iterator[StereoTruth]:
    channel_of = _channel_topics(bag, channels)
    sides = {side for side, _ in channel_of.values()}

    instants = groupby(bag.messages(channel_of), key=_stamp_of)
    for index, (t_ns, messages) in enumerate(instants):
        values: dict[Side, dict[str, Any]] = {side: {} for side in sides}
        for topic, message in messages:
            side, name = channel_of[topic]
            values[side][name] = truth_values(name, message)
        if any(len(by_name) != len(channels) for by_name in values.values()):
            raise SequenceError(f"truth frame {index} at {t_ns} ns lacks channels in {bag.path}")
        right = TruthFrame(**values["right"]) if "right" in values else None
        yield StereoTruth(index, t_ns, TruthFrame(**values["left"]), right)


def _stamp_of(entry: tuple[Topic, Any]) -> int:
    _, message = entry
    return stamp_ns(message)
