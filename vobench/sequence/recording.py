"""Poses and topics of recordings of any origin: MCAP, ROS 2 and ROS 1 bags."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

from vobench.errors import SequenceError, VobenchError
from vobench.geometry.se3 import Array
from vobench.sequence.mcap_file import decompressed
from vobench.sequence.message import pose_fields, poses_from_fields, stamp_ns
from vobench.sequence.message_type import TYPES
from vobench.sequence.topic import TF_STATIC
from vobench.temporary import temporary_folder
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory

MAGICS = {b"\x89MCAP": ".mcap", b"#ROSBAG V2.0": ".bag", b"SQLite format 3\x00": ".db3"}
LONGEST_MAGIC = 16
METADATA = "metadata.yaml"  # the file that makes a folder a ROS 2 bag
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
NORM_TOLERANCE = 1e-3  # of a quaternion

PoseFields = tuple[float, ...]  # x, y, z, qx, qy, qz, qw


def _pose(message: Any) -> Any:
    return message.pose


def _pose_with_covariance(message: Any) -> Any:
    return message.pose.pose


def _transform(message: Any) -> Any:
    return message.transform


# The pose in a message, by its type.
POSES = {
    "geometry_msgs/msg/PoseStamped": _pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose_with_covariance,
    "geometry_msgs/msg/TransformStamped": _transform,
    "nav_msgs/msg/Odometry": _pose_with_covariance,
}


def is_recording(path: Path) -> bool:
    """Whether a file begins as MCAP, ROS bag or SQLite, or a folder is a ROS 2 bag."""
    if path.is_dir():
        return (path / METADATA).is_file()
    return _suffix(path) is not None


def read_poses(path: Path, topic: str | None) -> Trajectory:
    """The poses of a topic, or of `/tf:parent.child`; None: of the only topic with poses. Raises SequenceError."""
    t_ns, fields = _read(path, topic)
    return _trajectory(t_ns, fields, path)


def read_first_poses(path: Path, topic: str | None) -> tuple[Trajectory, int]:
    """As `read_poses`, of successive poses with one stamp only the first; and how many were left out."""
    t_ns, fields = _read(path, topic)
    is_first = np.diff(t_ns, prepend=t_ns[0] - 1) != 0
    left_out = int(np.sum(~is_first))
    return _trajectory(t_ns[is_first], fields[is_first], path), left_out


def _read(path: Path, topic: str | None) -> tuple[Stamps, Array]:
    """Stamps (N,) and `pose_fields` (N, 7) of a topic, unchecked."""
    with open_bag(path) as reader:
        rows = list(_rows(reader, path, topic))
    if not rows:
        raise SequenceError(f"no pose on {topic or 'its topic'} in {path}")
    stamps = [t for t, _ in rows]
    poses = [pose for _, pose in rows]
    return np.array(stamps, np.int64), np.array(poses, float)


def _trajectory(t_ns: Stamps, fields: Array, path: Path) -> Trajectory:
    _require_valid(t_ns, fields, path)
    norm = np.linalg.norm(fields[:, 3:], axis=1, keepdims=True)
    fields[:, 3:] /= norm
    return Trajectory(t_ns, poses_from_fields(fields))


def _suffix(path: Path) -> str | None:
    """The suffix of files with the first bytes of this one."""
    with path.open("rb") as file:
        start = file.read(LONGEST_MAGIC)
    for magic, suffix in MAGICS.items():
        if start.startswith(magic):
            return suffix
    return None


@contextmanager
def open_bag(path: Path) -> Iterator[AnyReader]:
    """A reader of any recording, whose errors become SequenceError.

    rosbags recognises files by their suffixes, so the file gets a link with the right one.
    """
    # rosbags checks the size of a chunk after it has decompressed it: a few kB can become many GB.
    DECOMPRESSORS.update({name: partial(decompressed, name) for name in ("zstd", "lz4")})
    with temporary_folder() as folder:
        link = path
        if not path.is_dir():
            link = folder / f"recording{_suffix(path)}"
            link.symlink_to(path.resolve())
        try:
            with AnyReader([link], default_typestore=TYPES) as reader:
                yield reader
        except VobenchError:
            raise
        except MemoryError as error:
            raise SequenceError(f"not a whole recording (it states more bytes than fit into memory): {path}") from error
        except Exception as error:  # a torn file makes its reader raise errors of a dozen kinds
            reason = str(error).splitlines()[0] if str(error) else "no reason given"
            raise SequenceError(f"not a whole recording ({type(error).__name__}: {reason}): {path}") from error


def _rows(
    reader: AnyReader,
    path: Path,
    topic: str | None,
) -> Iterator[tuple[int, PoseFields]]:
    """Stamps in ns and poses of a topic's messages."""
    name, _, frames = (topic or _only_topic(reader, path)).partition(":")
    connections = [connection for connection in reader.connections if connection.topic == name]
    if not connections:
        raise SequenceError(f"no topic {name!r} in {path}. With poses: {_listed_topics(reader)}")
    message_type = connections[0].msgtype
    if message_type in TRANSFORMS:
        yield from _transforms(reader, connections, frames, path)
        return
    if message_type not in POSES:
        known = _listed_topics(reader)
        raise SequenceError(f"{name} is {message_type}, which has no pose, in {path}. With poses: {known}")
    for connection, _, raw in reader.messages(connections):
        message: Any = reader.deserialize(raw, connection.msgtype)
        pose = POSES[connection.msgtype](message)
        yield stamp_ns(message), pose_fields(pose)


def _transforms(
    reader: AnyReader,
    connections: list[Any],
    frames: str,
    path: Path,
) -> Iterator[tuple[int, PoseFields]]:
    """Stamps in ns and poses of the frames `parent.child`, which may be empty where there is one pair only."""
    by_frames: dict[str, list[tuple[int, PoseFields]]] = {}
    for connection, _, raw in reader.messages(connections):
        message: Any = reader.deserialize(raw, connection.msgtype)
        for stamped in message.transforms:
            parent = stamped.header.frame_id.lstrip("/")
            child = stamped.child_frame_id.lstrip("/")
            row = (stamp_ns(stamped), pose_fields(stamped.transform))
            by_frames.setdefault(f"{parent}.{child}", []).append(row)
    if not frames and len(by_frames) == 1:
        frames = next(iter(by_frames))
    if frames not in by_frames:
        topic = connections[0].topic
        known = ", ".join(f"{topic}:{pair}" for pair in sorted(by_frames))
        raise SequenceError(f"name one of the transforms in {path}: {known or 'there is none'}")
    yield from by_frames[frames]


def _only_topic(reader: AnyReader, path: Path) -> str:
    """The only topic with poses, or else the only one with moving transforms. Raises SequenceError."""
    poses = set()
    moving = set()
    for connection in reader.connections:
        if connection.msgtype in POSES and connection.msgcount:
            poses.add(connection.topic)
        if connection.msgtype in TRANSFORMS:
            moving.add(connection.topic)
    moving.discard(TF_STATIC.name)
    candidates = poses or moving
    if len(candidates) != 1:
        raise SequenceError(f"name the topic with the poses of {path}: {_listed_topics(reader)}")
    return next(iter(candidates))


def _listed_topics(reader: AnyReader) -> str:
    """The topics with poses or transforms."""
    known = (*POSES, *TRANSFORMS)
    topics = {connection.topic for connection in reader.connections if connection.msgtype in known}
    return ", ".join(sorted(topics)) or "none"


def _require_valid(t_ns: Stamps, fields: Array, path: Path) -> None:
    """Raise SequenceError unless poses are finite with unit quaternions, and stamps increase."""
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(fields[:, 3:], axis=1)
    is_unit = np.abs(norm - 1) <= NORM_TOLERANCE
    is_valid = np.isfinite(fields).all(1) & is_unit
    if not is_valid.all():
        row = int(np.flatnonzero(~is_valid)[0])
        numbers = ", ".join(f"{value:g}" for value in fields[row])
        raise SequenceError(f"pose {row} of {path} should be finite with a unit quaternion, but is ({numbers})")
    late = np.flatnonzero(np.diff(t_ns) <= 0)
    if late.size:
        raise SequenceError(f"stamps must increase, but pose {late[0] + 1} is not after the one before it in {path}")


@dataclass(frozen=True, slots=True)
class TopicFacts:
    """A topic, and when its first and last messages were logged; stamps are None for a topic without messages."""

    name: str
    type_name: str
    count: int
    start_ns: int | None
    end_ns: int | None

    @property
    def rate_hz(self) -> float | None:
        """Messages a second on average, None for fewer than two instants."""
        if self.start_ns is None or self.end_ns is None or self.end_ns == self.start_ns:
            return None
        return (self.count - 1) / (self.end_ns - self.start_ns) * NS_PER_S


def topic_facts(path: Path) -> tuple[TopicFacts, ...]:
    """All topics of a bag of any origin, by name; no message is decoded. Raises SequenceError where it is torn."""
    stamps: dict[tuple[str, str], list[int]] = {}
    with open_bag(path) as reader:
        for connection in reader.connections:
            stamps[connection.topic, connection.msgtype] = []
        for connection, t_ns, _ in reader.messages():
            stamps[connection.topic, connection.msgtype].append(t_ns)
    facts = []
    for (name, type_name), logged_ns in sorted(stamps.items()):
        start_ns = min(logged_ns, default=None)
        end_ns = max(logged_ns, default=None)
        facts.append(TopicFacts(name, type_name, len(logged_ns), start_ns, end_ns))
    return tuple(facts)
