"""Poses and topics of anybody's recording: MCAP, ROS 2 and ROS 1 bags."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

from vobench import stop
from vobench.errors import SequenceError, VobenchError
from vobench.geometry.se3 import Array
from vobench.sequence import messages as ros
from vobench.sequence.bag import unpack
from vobench.trajectory.trajectory import Stamps, Trajectory

MAGICS = {b"\x89MCAP": ".mcap", b"#ROSBAG V2.0": ".bag", b"SQLite format 3\x00": ".db3"}
METADATA = "metadata.yaml"  # what makes a folder a ROS 2 bag
POSES = {
    "geometry_msgs/msg/PoseStamped": lambda m: m.pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: m.pose.pose,
    "geometry_msgs/msg/TransformStamped": lambda m: m.transform,
    "nav_msgs/msg/Odometry": lambda m: m.pose.pose,
}
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
NORM_TOLERANCE = 1e-3


def is_recording(path: Path) -> bool:
    """Whether a file begins as MCAP, ROS bag or SQLite, or a folder is a ROS 2 bag."""
    return (path / METADATA).is_file() if path.is_dir() else _suffix(path) is not None


def read_poses(path: Path, topic: str | None) -> Trajectory:
    """The poses of a topic, or `/tf:parent.child`; None: of the only one with poses. Raises SequenceError."""
    return _trajectory(*_read(path, topic), path)


def read_first_poses(path: Path, topic: str | None) -> tuple[Trajectory, int]:
    """The same, of poses in a row that have one stamp the first; and how many that left out."""
    t_ns, fields = _read(path, topic)
    first = np.diff(t_ns, prepend=t_ns[0] - 1) != 0
    return _trajectory(t_ns[first], fields[first], path), int(np.sum(~first))


def _read(path: Path, topic: str | None) -> tuple[Stamps, Array]:
    """Stamps (N,) and `pose_fields` (N, 7) of a topic, as they are."""
    with opened(path) as reader:
        rows = list(_rows(reader, path, topic))
    if not rows:
        raise SequenceError(f"no pose on {topic or 'its topic'} in {path}")
    return np.array([t for t, _ in rows], np.int64), np.array([pose for _, pose in rows], float)


def _trajectory(t_ns: Stamps, fields: Array, path: Path) -> Trajectory:
    _require_valid(t_ns, fields, path)
    fields[:, 3:] /= np.linalg.norm(fields[:, 3:], axis=1, keepdims=True)
    return Trajectory(t_ns, ros.poses(fields))


def _suffix(path: Path) -> str | None:
    with path.open("rb") as file:
        start = file.read(16)
    return next((suffix for magic, suffix in MAGICS.items() if start.startswith(magic)), None)


@contextmanager
def opened(path: Path) -> Iterator[AnyReader]:
    """A reader of any recording; rosbags goes by endings, so the file gets one. Its errors become SequenceError."""
    # rosbags looks at the size of a chunk after it has unpacked it: a few kB can make many GB.
    DECOMPRESSORS.update({packing: partial(unpack, packing) for packing in ("zstd", "lz4")})
    folder = Path(mkdtemp(prefix="vobench-bag-"))
    with stop.undone(lambda: stop.remove(folder)):
        link = path
        if not path.is_dir():
            link = folder / f"recording{_suffix(path)}"
            link.symlink_to(path.resolve())
        try:
            with AnyReader([link], default_typestore=ros.TYPES) as reader:
                yield reader
        except VobenchError:
            raise
        except MemoryError as error:
            raise SequenceError(f"not a whole recording (it states more bytes than fit into memory): {path}") from error
        except Exception as error:  # a torn file makes its reader raise errors of a dozen kinds
            reason = str(error).splitlines()[0] if str(error) else "no reason given"
            raise SequenceError(f"not a whole recording ({type(error).__name__}: {reason}): {path}") from error


def _rows(reader: AnyReader, path: Path, topic: str | None) -> Iterator[tuple[int, tuple[float, ...]]]:
    name, _, frames = (topic or _only_topic(reader, path)).partition(":")
    chosen = [connection for connection in reader.connections if connection.topic == name]
    if not chosen:
        raise SequenceError(f"no topic {name!r} in {path}. With poses: {_known(reader)}")
    if chosen[0].msgtype in TRANSFORMS:
        yield from _transforms(reader, chosen, frames, path)
        return
    if chosen[0].msgtype not in POSES:
        raise SequenceError(
            f"{name} is {chosen[0].msgtype}, which has no pose, in {path}. With poses: {_known(reader)}"
        )
    for connection, _, raw in reader.messages(chosen):
        message: Any = reader.deserialize(raw, connection.msgtype)
        yield ros.stamp_ns(message), ros.pose_fields(POSES[connection.msgtype](message))


def _transforms(
    reader: AnyReader, chosen: list[Any], frames: str, path: Path
) -> Iterator[tuple[int, tuple[float, ...]]]:
    """The poses of one child frame in its parent; `frames` may be left out where there is one pair only."""
    found: dict[str, list[tuple[int, tuple[float, ...]]]] = {}
    for connection, _, raw in reader.messages(chosen):
        message: Any = reader.deserialize(raw, connection.msgtype)
        for stamped in message.transforms:
            pair = f"{stamped.header.frame_id.lstrip('/')}.{stamped.child_frame_id.lstrip('/')}"
            found.setdefault(pair, []).append((ros.stamp_ns(stamped), ros.pose_fields(stamped.transform)))
    if not frames and len(found) == 1:
        frames = next(iter(found))
    if frames not in found:
        topics = ", ".join(f"{chosen[0].topic}:{pair}" for pair in sorted(found))
        raise SequenceError(f"name one of the transforms in {path}: {topics or 'there is none'}")
    yield from found[frames]


def _only_topic(reader: AnyReader, path: Path) -> str:
    poses = sorted({c.topic for c in reader.connections if c.msgtype in POSES and c.msgcount})
    moving = sorted({c.topic for c in reader.connections if c.msgtype in TRANSFORMS and c.topic != ros.TF_STATIC.name})
    if len(poses or moving) != 1:
        raise SequenceError(f"name the topic with the poses of {path}: {_known(reader)}")
    return (poses or moving)[0]


def _known(reader: AnyReader) -> str:
    return ", ".join(sorted({c.topic for c in reader.connections if c.msgtype in (*POSES, *TRANSFORMS)})) or "none"


def _require_valid(t_ns: Stamps, fields: Array, path: Path) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(fields[:, 3:], axis=1)
    bad = np.flatnonzero(~np.isfinite(fields).all(1) | ~(np.abs(norm - 1) <= NORM_TOLERANCE))
    if bad.size:
        stated = ", ".join(f"{value:g}" for value in fields[bad[0]])
        raise SequenceError(f"pose {bad[0]} of {path} should be finite with a unit quaternion, but is ({stated})")
    late = np.flatnonzero(np.diff(t_ns) <= 0)
    if late.size:
        raise SequenceError(f"stamps must increase, but pose {late[0] + 1} is not after the one before it in {path}")


@dataclass(frozen=True, slots=True)
class TopicFacts:
    """A topic, and when its first and last message were logged; stamps are None where it has none."""

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
        return (self.count - 1) / (self.end_ns - self.start_ns) * 1e9


def topic_facts(path: Path) -> tuple[TopicFacts, ...]:
    """All topics of a bag of any make, by name; no message is decoded. Raises SequenceError where it is torn."""
    stamps: dict[tuple[str, str], list[int]] = {}
    with opened(path) as reader:
        for connection in reader.connections:
            stamps[connection.topic, connection.msgtype] = []
        for connection, t_ns, _ in reader.messages():
            stamps[connection.topic, connection.msgtype].append(t_ns)
    return tuple(
        TopicFacts(*names, len(found), min(found, default=None), max(found, default=None))
        for names, found in sorted(stamps.items())
    )
