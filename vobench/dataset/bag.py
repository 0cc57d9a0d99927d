"""Reads ROS 1 bags, ROS 2 bags and MCAP files of other programs as recordings."""

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode

from vobench.dataset.bag_picture import MOSAICS, picture
from vobench.dataset.bag_rig import (
    FramedInfo,
    Info,
    StaticTransforms,
    find_transform,
    frame_name,
    info_rig,
    static_transforms,
)
from vobench.dataset.bag_topics import SelectedTopics, choose
from vobench.dataset.bag_writer import write_ros2
from vobench.dataset.kalibr import chain_has_imu, chain_rig, find_imu, read_imu
from vobench.dataset.layout import Layout, Writing, head
from vobench.dataset.picture import EncodedPicture, refuse_lfs_pointers
from vobench.dataset.picture_list import partners
from vobench.dataset.recording import (
    CalibratedImu,
    CalibratedRig,
    Notes,
    PictureStream,
    ReadOptions,
    RecordedFrame,
    Recording,
    assemble,
)
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sequence.mcap_file import MAGIC
from vobench.sequence.message import stamp_ns
from vobench.sequence.recording import MAGICS, METADATA, open_bag, read_first_poses
from vobench.sequence.topic import IMU, LEFT_IMAGE, RIGHT_IMAGE, SENSORS_FILE, TF_STATIC
from vobench.trajectory.trajectory import Stamps, Trajectory

BASE = "base_link"
MOST_PROFILE = 256  # the number of bytes of a profile's name that are read
SUPPORTED_MCAP = "supported are MCAP files in ROS 2 form (profile ros2, CDR messages)"
MOST_WAITING = 64  # the largest number of pictures in memory that wait for the other picture of their pair


@dataclass(frozen=True, slots=True)
class BagContents:
    """The result of reading a bag once: stamps and first message of each topic, IMU readings, and /tf_static."""

    stamps: dict[str, Stamps]
    first: dict[str, Any]
    imu: ImuReadings | None
    transforms: StaticTransforms

    def frame_of(self, topic: str) -> str:
        """The name of the coordinate frame of a topic's messages."""
        return frame_name(self.first[topic].header.frame_id)


def read_bag(path: Path, options: ReadOptions, *, form: str) -> Recording:
    """The recording in a bag. Its pictures are read when they are iterated. Raises InputError."""
    refuse_lfs_pointers(path)
    if form == "mcap":
        _require_ros2(path)
    with open_bag(path) as reader:
        non_empty = [connection for connection in reader.connections if connection.msgcount]
        types = {connection.topic: connection.msgtype for connection in non_empty}
        chosen = choose(types, options.topics, str(path))
        contents = _contents(reader, chosen, path)
    pictures = _pictures(path, chosen, contents, options)
    stream = PictureStream.open(pictures.shots)
    truth = None
    repeats = 0
    if chosen.truth:
        truth, repeats = read_first_poses(path, chosen.truth)
    body, body_notes = _body(chosen, contents)
    calibration = _rig(path, chosen, contents, body, options)
    imu = _imu(path, chosen, contents, body, options)

    notes = [*chosen.notes, "Stamps are those in the messages' headers.", *pictures.notes]
    if options.calibration is None:
        notes += body_notes
    elif truth is not None:
        truth, truth_notes = _of_chain_body(truth, calibration.rig, chosen, contents)
        notes += truth_notes
    notes += [*calibration.notes, *imu.notes]
    encoding = getattr(contents.first[chosen.left], "encoding", "")
    if encoding.lower() in MOSAICS:
        notes.append(f"The colour mosaic ({encoding}) was converted to grey by OpenCV's bilinear interpolation.")
    if repeats:
        notes.append(f"{repeats} poses of {chosen.truth} repeat a stamp; the first pose of each stamp was kept.")
    unread = types.keys() - {*chosen.sensors, TF_STATIC.name, chosen.truth_topic}
    if unread:
        notes.append(f"Topics that were not read: {', '.join(sorted(unread))}.")
    return assemble(
        form,
        replace(calibration.rig, imu=imu.calibration),
        stream,
        pictures.t_ns,
        truth=truth,
        imu=imu.readings,
        notes=notes,
        calibration=calibration.source,
    )


def _require_ros2(path: Path) -> None:
    """Raise InputError if an MCAP file contains messages other than those of ROS 2. Source: mcap.dev/spec, Header."""
    start = head(path)
    begin = len(MAGIC) + struct.calcsize("<BQI")  # after the opcode, the record length and the profile length
    if len(start) < begin or start[len(MAGIC)] != Opcode.HEADER:
        raise InputError(f"an MCAP file should begin with its header, this one does not: {path}")
    (length,) = struct.unpack_from("<I", start, begin - 4)
    end = begin + min(length, MOST_PROFILE)
    profile = start[begin:end].decode("utf-8", "replace")
    if profile == "ros2":
        return

    advice = f"{SUPPORTED_MCAP}, so convert its messages to sensor_msgs first"
    if profile == "ros1":
        problem = "with ROS 1 messages"
        advice = f"{SUPPORTED_MCAP}, so convert it to a ROS 1 .bag or to ROS 2"
    elif profile:
        problem = f"of the profile {profile!r}"
    else:
        problem = "that names no profile (usually Protobuf or JSON)"
    raise InputError(f"an MCAP file {problem}; {advice}: {path}")


def _contents(reader: Any, chosen: SelectedTopics, path: Path) -> BagContents:
    """Read the chosen topics once, without decoding or keeping pictures. Raises InputError."""
    messages = _read_once(reader, chosen)
    _require_pictures(chosen, messages.first, path)
    stamps = {}
    for topic, topic_ns in messages.stamps_ns.items():
        stamps[topic] = _increasing(np.array(topic_ns, np.int64), topic, path)
    imu = None
    if chosen.imu in stamps:
        imu = _readings(chosen.imu, stamps[chosen.imu], messages.readings, path)
    return BagContents(stamps, messages.first, imu, static_transforms(messages.static, str(path)))


class _Messages(NamedTuple):
    """The unchecked result of reading a bag once.

    `stamps_ns` and `first` are the stamps and the first message of each topic, `readings` those of the IMU, and
    `static` the messages on /tf_static.
    """

    stamps_ns: dict[str, list[int]]
    first: dict[str, Any]
    readings: list[tuple[float, ...]]
    static: list[Any]


def _read_once(reader: Any, chosen: SelectedTopics) -> _Messages:
    """Read the messages of the chosen topics in order. Of the truth and the calibrations, only the first is read."""
    wanted = {*chosen.sensors, TF_STATIC.name, chosen.truth_topic}
    first_only = (chosen.truth_topic, chosen.left_info, chosen.right_info)
    messages = _Messages({}, {}, [], [])
    connections = [connection for connection in reader.connections if connection.topic in wanted]
    for connection, _, raw in reader.messages(connections):
        topic = connection.topic
        if topic in messages.first and topic in first_only:
            continue
        message = reader.deserialize(raw, connection.msgtype)
        if topic == TF_STATIC.name:
            messages.static.append(message)
            continue
        if topic not in messages.first:
            messages.first[topic] = _without_pixels(message)
        if hasattr(message, "header"):
            messages.stamps_ns.setdefault(topic, []).append(stamp_ns(message))
        if topic == chosen.imu:
            messages.readings.append(_imu_fields(message))
    return messages


def _require_pictures(
    chosen: SelectedTopics,
    first: Mapping[str, Any],
    path: Path,
) -> None:
    for topic in (chosen.left, chosen.right):
        if topic and topic not in first:
            raise InputError(f"{topic} should have messages, but has none that can be read in {path}")


def _without_pixels(message: Any) -> Any:
    """The message, or only the header and encoding of a picture, whose pixels may be a view of a larger buffer."""
    if not hasattr(message, "data"):
        return message
    return SimpleNamespace(header=message.header, encoding=getattr(message, "encoding", ""))


def _imu_fields(message: Any) -> tuple[float, ...]:
    gyro = message.angular_velocity
    accel = message.linear_acceleration
    return gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z


def _readings(
    topic: str,
    t_ns: Stamps,
    rows: list[tuple[float, ...]],
    path: Path,
) -> ImuReadings:
    values = np.array(rows, float)
    is_finite = np.isfinite(values).all(1)
    if not is_finite.all():
        row = int(np.flatnonzero(~is_finite)[0])
        raise InputError(f"reading {row} of {topic} should be finite, but is {values[row].tolist()} in {path}")
    return ImuReadings(t_ns, values[:, :3].copy(), values[:, 3:].copy())


def _increasing(t_ns: Stamps, topic: str, path: Path) -> Stamps:
    """Return the stamps if they increase. Raises InputError otherwise."""
    late = np.flatnonzero(np.diff(t_ns) <= 0)
    if late.size:
        before = int(late[0])
        after = before + 1
        order = f"message {after} has {t_ns[after]} ns after {t_ns[before]} ns"
        raise InputError(f"{topic}: stamps must increase, but {order} in {path}")
    return t_ns


class _Pictures(NamedTuple):
    """The pictures of a bag, which have not been read, their stamps, and notes on how they were paired."""

    shots: Callable[[], Iterator[RecordedFrame]]
    t_ns: Stamps
    notes: Notes


def _pictures(
    path: Path,
    chosen: SelectedTopics,
    contents: BagContents,
    options: ReadOptions,
) -> _Pictures:
    left_ns = contents.stamps[chosen.left]
    stamps = {chosen.left: left_ns}
    notes = Notes()
    if chosen.right is not None:
        right_ns = contents.stamps[chosen.right]
        pairs = partners(left_ns, right_ns, options.within_ns, str(path))
        stamps = {chosen.left: left_ns[pairs.left], chosen.right: right_ns[pairs.right]}
        notes = pairs.notes
    indices = {}  # the index of each frame, by topic and stamp
    for topic, t_ns in stamps.items():
        indices[topic] = {int(t): index for index, t in enumerate(t_ns)}
    frames_ns = stamps[chosen.left]
    return _Pictures(partial(_read_pictures, path, indices, frames_ns), frames_ns, notes)


def _read_pictures(
    path: Path,
    indices: dict[str, dict[int, int]],
    t_ns: Stamps,
) -> Iterator[RecordedFrame]:
    """The frames in order. A picture waits in memory for the other one of its pair; at most MOST_WAITING wait."""
    waiting: dict[int, dict[str, EncodedPicture]] = {}  # for each index of a frame, its pictures by topic
    due = 0
    with open_bag(path) as reader:
        connections = [connection for connection in reader.connections if connection.topic in indices]
        for connection, _, raw in reader.messages(connections):
            topic = connection.topic
            message: Any = reader.deserialize(raw, connection.msgtype)
            index = indices[topic].get(stamp_ns(message))
            if index is None:
                continue
            name = f"image {index} of {topic} in {path}"
            waiting.setdefault(index, {})[topic] = picture(message, name)
            if len(waiting) > MOST_WAITING:
                raise InputError(f"left and right images are more than {MOST_WAITING} apart in {path}")
            while len(waiting.get(due, ())) == len(indices):
                by_topic = waiting.pop(due)
                pictures = tuple(by_topic[topic] for topic in indices)
                yield RecordedFrame(int(t_ns[due]), pictures)
                due += 1


def _body(chosen: SelectedTopics, contents: BagContents) -> tuple[str | None, Notes]:
    """The name of the body's frame, None for that of the left camera, and a note on it.

    It is the frame of the truth, or otherwise base_link, if /tf_static connects it with the left camera.
    """
    left_frame = contents.frame_of(chosen.left)
    truth_frame = _truth_frame(chosen, contents)
    if truth_frame and find_transform(contents.transforms, truth_frame, left_frame) is not None:
        return truth_frame, (f"The body is {truth_frame}.",)
    topic = chosen.truth_topic
    if find_transform(contents.transforms, BASE, left_frame) is not None:
        assumed = f", and the frame of {topic} was assumed to be the body" if topic else ""
        return BASE, (f"The body is {BASE}{assumed}.",)
    if truth_frame:
        return None, (f"The body is the left camera; the truth is of {truth_frame}, whose position is not known.",)
    assumed = ", and the truth was assumed to be of it" if topic else ""
    return None, (f"The body is the left camera{assumed}.",)


def _of_chain_body(
    truth: Trajectory, rig: Rig, chosen: SelectedTopics, contents: BagContents
) -> tuple[Trajectory, Notes]:
    """The poses of the body of a camchain, from the poses of the frame that the bag gives, and a note on them.

    They are converted if /tf_static connects that frame with the left camera, and otherwise taken as they are.
    """
    truth_frame = _truth_frame(chosen, contents)
    if not truth_frame:
        return truth, (f"The frame of {chosen.truth_topic} was assumed to be the body.",)
    T_truth_left = find_transform(contents.transforms, truth_frame, contents.frame_of(chosen.left))
    if T_truth_left is None:
        return truth, (
            f"The truth is of {truth_frame}, whose position is not known, and was assumed to be of the body.",
        )
    T_truth_body = T_truth_left @ se3.inverse(rig.T_body_left)
    converted = replace(truth, T_world_frame=truth.T_world_frame @ T_truth_body)
    return converted, (f"The truth of {truth_frame} was converted to the body by /tf_static.",)


def _truth_frame(chosen: SelectedTopics, contents: BagContents) -> str:
    """The frame whose poses are the truth; empty if it has no name."""
    child = chosen.truth_frames.rpartition(".")[2]
    if child:
        return child
    first = contents.first.get(chosen.truth_topic)
    return frame_name(getattr(first, "child_frame_id", ""))


def _rig(
    path: Path,
    chosen: SelectedTopics,
    contents: BagContents,
    body: str | None,
    options: ReadOptions,
) -> CalibratedRig:
    """The rig from the calibration that the options name, or otherwise from the bag."""
    if options.calibration is not None:
        return _chain_rig(options.calibration, 2 if chosen.right else 1)
    cameras = []
    for topic, info in ((chosen.left, chosen.left_info), (chosen.right, chosen.right_info)):
        if topic is None:
            continue
        if info is None or info not in contents.first:
            raise InputError(f"no camera_info for {topic}: name its topic or a camchain.yaml of Kalibr's for {path}")
        is_rectified = "rect" in topic.replace("unrect", "")
        camera_info = Info(info, contents.first[info], is_rectified)
        cameras.append(FramedInfo(camera_info, contents.frame_of(topic)))

    rig, notes = info_rig(cameras, contents.transforms, body)
    if any(camera.info.rectified for camera in cameras):
        notes = (*notes, "The topics' names say that the images are rectified: the calibration is their matrix P.")
    return CalibratedRig(rig, str(path), notes)


def _chain_rig(chain: Path, count: int) -> CalibratedRig:
    has_imu = chain_has_imu(chain)
    T_body_left = None if has_imu else np.eye(4)
    rig, notes = chain_rig(chain, count, T_body_left)
    body = "the IMU" if has_imu else "the left camera"
    note = f"The calibration is that of {chain.name}, and the body is {body}, whatever the bag says."
    return CalibratedRig(rig, str(chain), (note, *notes[1:]))


def _imu(
    path: Path,
    chosen: SelectedTopics,
    contents: BagContents,
    body: str | None,
    options: ReadOptions,
) -> CalibratedImu:
    if contents.imu is None or chosen.imu is None:
        return CalibratedImu(None, None, ())
    noise = find_imu(path, options)
    if noise is None:
        why = "a bag has no noise densities of an IMU; name Kalibr's imu.yaml"
        return CalibratedImu(None, None, (f"{chosen.imu} was dropped: {why}.",))
    T_body_imu: Array | None = np.eye(4)
    if options.calibration is None:
        body_frame = body or contents.frame_of(chosen.left)
        T_body_imu = find_transform(contents.transforms, body_frame, contents.frame_of(chosen.imu))
    if T_body_imu is None:
        return CalibratedImu(None, None, (f"{chosen.imu} was dropped: its position on the body is not known.",))
    calibration = read_imu(noise, T_body_imu)
    return CalibratedImu(contents.imu, calibration, (f"The IMU's noise is that of {noise.name}.",))


def _begins(path: Path, suffix: str) -> bool:
    """Whether a file begins like files with a suffix. A sensors.mcap, which is part of a sequence, does not count."""
    magic = next(magic for magic, known in MAGICS.items() if known == suffix)
    return path.name != SENSORS_FILE and head(path).startswith(magic)


def _is_ros2(path: Path) -> bool:
    return (path / METADATA).is_file() or _begins(path, ".db3")


HEEDS = frozenset({"calibration", "imu", "within_ns", "topics"})
ROS2_TOPICS = (LEFT_IMAGE.name, RIGHT_IMAGE.name, IMU.name)
LAYOUTS = (
    Layout(
        "ros2",
        f"a ROS 2 bag: a folder with {METADATA}, or a .db3 file",
        _is_ros2,
        partial(read_bag, form="ros2"),
        HEEDS,
        Writing(write_ros2, topics=ROS2_TOPICS, keeps=None),
        r"[^/]*/[^/]*\.db3",
    ),
    Layout(
        "ros1",
        "a ROS 1 bag: a .bag file",
        partial(_begins, suffix=".bag"),
        partial(read_bag, form="ros1"),
        HEEDS,
        truth=r"[^/]*/[^/]*\.bag",
    ),
    Layout(
        "mcap",
        "an .mcap file",
        partial(_begins, suffix=".mcap"),
        partial(read_bag, form="mcap"),
        HEEDS,
        truth=r"[^/]*/[^/]*\.mcap",
    ),
)
