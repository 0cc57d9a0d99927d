"""Reading a sequence: sensors and truth through separate doors, frames one at a time or by number."""

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
from vobench.geometry.rig import SIDES, Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuBias, ImuReadings
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame, TruthNames, check_channels
from vobench.sequence import messages as ros
from vobench.sequence.bag import Bag, parsing, part_of
from vobench.sequence.calibration import read_rig
from vobench.sequence.messages import picture_in
from vobench.sequence.picture import MONO, Image, decode
from vobench.sequence.pixel_truth import names_from_json, truth_topic, truth_topics, truth_values
from vobench.trajectory.trajectory import Stamps, Trajectory

LONGEST_PATH = 60  # characters of it in a repr


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
    """The same pictures as they lie in the file; `form` is png or jpeg."""

    index: int
    t_ns: int
    form: str
    left: bytes
    right: bytes | None
    colour: str = MONO


@dataclass(frozen=True, slots=True)
class Sequence:
    """All that an estimator may see of a recording; the truth is read by `read_truth`."""

    path: Path
    rig: Rig
    frame_count: int
    bag: Bag = field(repr=False)

    @classmethod
    def open(cls, folder: Path) -> "Sequence":
        """Check the sensors of a recording and read its calibration. Raises SequenceError."""
        bag = Bag.open(Path(folder) / ros.SENSORS_FILE)
        bag.require((ros.LEFT_INFO, ros.LEFT_IMAGE))
        rig = read_rig(bag, ros.INFO_TOPICS)
        counts = [bag.count(topic) for topic in ros.IMAGE_TOPICS[: len(rig.sides)]]
        if len(set(counts)) > 1 or not counts[0]:
            raise SequenceError(
                f"a recording needs as many left as right pictures and at least one, "
                f"got {' and '.join(map(str, counts))}: {bag.path}"
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
        cameras = " and ".join(self.rig.sides)
        shown = path if len(path) <= LONGEST_PATH else f"…{path[-LONGEST_PATH:]}"
        return f"Sequence({shown}, {self.frame_count} frames of {cameras})"

    @property
    def _image_topics(self) -> tuple[ros.Topic, ...]:
        return ros.IMAGE_TOPICS[: len(self.rig.sides)]

    def encoded_frames(self) -> Iterator[EncodedFrame]:
        """The frames in order, undecoded."""
        images = self.bag.raw(self._image_topics)
        eyes = len(self._image_topics)
        count = 0
        for pictures in zip(*[images] * eyes, strict=False):
            stop.check()
            yield self._encoded(count, pictures)
            count += 1
        if count != self.frame_count:
            raise SequenceError(f"{count} frames found, but its summary says {self.frame_count}: {self.path}")

    def _encoded(self, index: int, pictures: Iterable[tuple[ros.Topic, memoryview]]) -> EncodedFrame:
        """One message of each camera. Raises SequenceError where they are not of one instant."""
        topics, messages = zip(*pictures, strict=True)
        with parsing(self.path):
            stamps, forms, colours, encoded = zip(*map(picture_in, messages), strict=True)
        if topics != self._image_topics or len(set(stamps)) > 1:
            raise SequenceError(f"frame {index} is no left and right picture of one stamp in {self.path}")
        left, *others = map(bytes, encoded)
        return EncodedFrame(index, stamps[0], forms[0], left, others[0] if others else None, colours[0])

    def frames(self, *, right: bool = True) -> Iterator[StereoFrame]:
        """The frames in order, the right picture only where it is wanted; one frame at a time is held in memory."""
        for frame in self.encoded_frames():
            yield self._decoded(frame if right else replace(frame, right=None))

    def _decoded(self, frame: EncodedFrame) -> StereoFrame:
        name = f"picture {frame.index} of {self.path}"
        left = decode(frame.left, self.rig.left, f"left {name}", colour=frame.colour)
        right = None
        if frame.right is not None:
            right = decode(frame.right, self.rig.camera("right"), f"right {name}", colour=frame.colour)
        return StereoFrame(frame.index, frame.t_ns, left, right, frame.colour)

    def frame(self, index: int) -> StereoFrame:
        """One frame, of which only its part of the file is read. Raises SequenceError where there is none."""
        return self._decoded(self._encoded(index, self.bag.nth(self._image_topics, index)))

    def frame_at(self, t_ns: int) -> StereoFrame:
        """The last frame at or before an instant. Raises SequenceError where there is none yet."""
        until = int(np.searchsorted(self.bag.stamps(ros.LEFT_IMAGE), t_ns, side="right"))
        if not until:
            raise SequenceError(f"there is no frame at or before {t_ns} ns in {self.path}")
        return self.frame(until - 1)

    def frame_stamps(self) -> Stamps:
        """The stamps (N,) of all frames, without reading a picture. Raises SequenceError where they are damaged.

        An index has no checksum, but the calibration of each frame has one of its own.
        """
        stamps, again = (self.bag.stamps(topic) for topic in (ros.LEFT_IMAGE, ros.LEFT_INFO))
        if len(stamps) == len(again) and not np.array_equal(stamps, again):
            raise SequenceError(f"pictures and calibration should have the same stamps, but do not in {self.path}")
        return stamps

    def encoders(self) -> tuple[Stamps, NDArray[np.int64]]:
        """Stamps (M,) and counts (M, 2) of all encoder readings, left and right; empty where there are no encoders."""
        readings = [(ros.stamp_ns(m), m.left, m.right) for _, m in self.bag.messages((ros.ENCODERS,))]
        table = np.array(readings, np.int64).reshape(-1, 3)
        return table[:, 0].copy(), table[:, 1:].copy()

    def exposures(self) -> tuple[Stamps, Array]:
        """Stamps (N,) of all frames, and their exposure times in s and gains in dB (N, 2); empty where not known."""
        return _table(self.bag, ros.EXPOSURE, lambda m: (m.time_s, m.gain_db), 2)

    def imu(self) -> ImuReadings:
        """All readings of the IMU, in its own axes; empty where there is none."""
        stamps, rows = _table(self.bag, ros.IMU, lambda m: (*_xyz(m.angular_velocity), *_xyz(m.linear_acceleration)), 6)
        return ImuReadings(stamps, rows[:, :3].copy(), rows[:, 3:].copy())


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _table(bag: Bag, topic: ros.Topic, row: Callable[[Any], Iterable[float]], width: int) -> tuple[Stamps, Array]:
    """Stamps (M,) of a topic's messages and what `row` makes of each (M, width)."""
    stamps = array("q")
    values = array("d")
    for _, message in bag.messages((topic,)):
        stamps.append(ros.stamp_ns(message))
        values.extend(row(message))
    return np.array(stamps, np.int64), np.array(values, float).reshape(-1, width)


def _truth_bag(folder: Path) -> Bag:
    return Bag.open(Path(folder) / ros.TRUTH_FILE)


def read_truth(folder: Path) -> Trajectory:
    """The true path of base_link in map. Raises SequenceError where the file is not whole."""
    bag = _truth_bag(folder)
    bag.require(ros.TRUTH_TOPICS)
    stamps, fields = _table(bag, ros.ODOMETRY, lambda m: ros.pose_fields(m.pose.pose), 7)
    return Trajectory(stamps, ros.poses(fields))


def has_truth(folder: Path) -> bool:
    """Whether the true path is known: not of every imported recording. Raises SequenceError where its file is torn."""
    path = Path(folder) / ros.TRUTH_FILE
    return (path.exists() or part_of(path).exists()) and Bag.open(path).count(ros.ODOMETRY) > 0


def read_twist(folder: Path) -> Array | None:
    """The true twist (N, 6) at the poses of `read_truth`, m/s then rad/s, in body axes; None where it is not known."""
    _, rows = _table(_truth_bag(folder), ros.ODOMETRY, _twist_fields, 7)
    return None if not len(rows) or np.any(rows[:, 6] == ros.UNKNOWN) else rows[:, :6].copy()


def _twist_fields(message: Any) -> tuple[float, ...]:
    """The six numbers of a twist and the first of its covariance, which says whether it is known."""
    twist = message.twist.twist
    return *_xyz(twist.linear), *_xyz(twist.angular), message.twist.covariance[0]


def read_imu_bias(folder: Path) -> ImuBias:
    """What the IMU's readings were off by; empty where there is no IMU."""
    stamps, rows = _table(_truth_bag(folder), ros.IMU_BIAS, lambda m: (*_xyz(m.gyro), *_xyz(m.accel)), 6)
    return ImuBias(stamps, rows[:, :3].copy(), rows[:, 3:].copy())


def read_disturbances(folder: Path) -> tuple[Stamps, Array]:
    """Stamps (N,) and left and right slip ratio, side slip in rad, pushes in m/s² and rad/s² (N, 5), if noted."""
    names = ("left_slip", "right_slip", "side_slip_rad", "push_mps2", "turn_push_radps2")
    return _table(_truth_bag(folder), ros.DISTURBANCE, lambda m: [getattr(m, name) for name in names], 5)


def read_true_rig(folder: Path) -> Rig:
    """The rig that the pictures were made with; `Sequence.rig` is what estimators are told. Raises SequenceError."""
    return read_rig(_truth_bag(folder), ros.TRUE_INFO_TOPICS)


def read_case(folder: Path) -> bytes:
    """The case that a recording was made from, as its writer gave it. Raises SequenceError where it was imported."""
    return _truth_bag(folder).attachment(ros.CASE_ATTACHMENT)


def read_provenance(folder: Path) -> dict[str, str]:
    """The versions of what made a recording, by name; nothing in it for one of the time before they were noted."""
    return _truth_bag(folder).note(ros.PROVENANCE_NOTE)


def read_import_notes(folder: Path) -> dict[str, str]:
    """What was noted when a recording was imported; nothing in it where it was not."""
    return _truth_bag(folder).note(ros.IMPORT_NOTE)


def payload_hash(folder: Path) -> str:
    """SHA-256 over all that was recorded: pixels instead of encoded bytes, which change with libpng."""
    digest = hashlib.sha256()
    later = (*ros.TRUE_INFO_TOPICS, ros.IMU_BIAS, ros.DISTURBANCE, *truth_topics())
    sensors, truth = (Bag.open(Path(folder) / name) for name in (ros.SENSORS_FILE, ros.TRUTH_FILE))
    for bag, topics in ((sensors, ros.SENSOR_TOPICS), (truth, (*ros.TRUTH_TOPICS, *later))):
        for topic, data in bag.raw(topics):
            payload = _pixels(data, bag.path) if topic in ros.IMAGE_TOPICS else data
            digest.update(f"{topic.name} {len(payload)}\n".encode())
            digest.update(payload)
    digest.update(repr(sorted(sensors.note(ros.WHEELS_NOTE).items())).encode())
    if imu := sensors.note(ros.IMU_NOTE):
        digest.update(repr(sorted(imu.items())).encode())
    return digest.hexdigest()


def _pixels(data: memoryview, path: Path) -> bytes:
    with parsing(path):
        t_ns, _, colour, encoded = picture_in(data)
    image = decode(encoded, None, f"a picture of {path}", colour=colour)
    return f"{t_ns} {image.shape}\n".encode() + image.tobytes()


@dataclass(frozen=True, slots=True)
class StereoTruth:
    """What is true of the pictures of one instant; no `right` where there is one camera."""

    index: int
    t_ns: int
    left: TruthFrame
    right: TruthFrame | None


def truth_channels(folder: Path) -> tuple[str, ...]:
    """The channels that were recorded with a sequence; none for most. Raises SequenceError for a torn file."""
    bag = _truth_bag(folder)
    return tuple(name for name in CHANNELS if bag.has(truth_topic("left", name)))


def read_truth_names(folder: Path) -> TruthNames:
    """What the ids of `instance` and `material` mean. Raises SequenceError where no channels were recorded."""
    return names_from_json(_truth_bag(folder).attachment(ros.NAMES_ATTACHMENT))


def read_truth_frames(folder: Path, channels: Iterable[str] | None = None) -> Iterator[StereoTruth]:
    """Channels (None: all) of each instant's pictures, one instant in memory. Raises SequenceError if one lacks."""
    bag = _truth_bag(folder)
    there = truth_channels(folder)
    wanted = there if channels is None else check_channels(channels)
    for name in wanted:
        if name not in there:
            recorded = ", ".join(there) or "none"
            raise SequenceError(f"no truth channel '{name}' was recorded, only {recorded}: {bag.path}")
    return _frames(bag, wanted)


def _frames(bag: Bag, channels: tuple[str, ...]) -> Iterator[StereoTruth]:
    present = [side for side in SIDES if any(bag.has(truth_topic(side, name)) for name in channels)]
    places = {truth_topic(side, name): (side, name) for side in present for name in channels}
    pictures = bag.messages(places)
    for index, (t_ns, group) in enumerate(groupby(pictures, key=lambda found: ros.stamp_ns(found[1]))):
        found: dict[str, dict[str, Any]] = {side: {} for side in present}
        for topic, message in group:
            side, name = places[topic]
            found[side][name] = truth_values(name, message)
        if any(len(values) != len(channels) for values in found.values()):
            raise SequenceError(f"truth frame {index} at {t_ns} ns lacks channels in {bag.path}")
        right = TruthFrame(**found["right"]) if "right" in found else None
        yield StereoTruth(index, t_ns, TruthFrame(**found["left"]), right)
