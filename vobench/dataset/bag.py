"""ROS 1 and ROS 2 bags and foreign MCAP files, read, and ROS 2 bags written."""

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import cv2
import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, ReaderError, StoragePlugin, Writer

from vobench.dataset.bag_rig import Chosen, Info, Tree, between, choose, info_rig, plain, tree_of
from vobench.dataset.kalibr import chain_rig, find_imu, read_imu, read_yaml
from vobench.dataset.layout import Layout, Writing, head
from vobench.dataset.picture import Picture, require_themselves
from vobench.dataset.recording import Notes, PictureStream, ReadOptions, RecordedFrame, Recording, assemble, partners
from vobench.dataset.source import ExportSource, Views
from vobench.errors import InputError, SequenceError
from vobench.geometry.rig import ImuCalibration, Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sequence import messages as ros
from vobench.sequence.bag import MAGIC, Bag
from vobench.sequence.messages import TYPES
from vobench.sequence.recording import MAGICS, METADATA, opened, read_first_poses
from vobench.trajectory.trajectory import Stamps

# Channels and bytes of each; where the colours come the wrong way round; what makes mosaics grey.
GREY = {"mono8": 1, "8uc1": 1, "mono16": 2, "16uc1": 2}
COLOURS = {"bgr8": 3, "8uc3": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4}
MOSAICS = {
    "bayer_rggb8": cv2.COLOR_BayerRGGB2GRAY,
    "bayer_bggr8": cv2.COLOR_BayerBGGR2GRAY,
    "bayer_gbrg8": cv2.COLOR_BayerGBRG2GRAY,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2GRAY,
}


def picture(message: Any, name: str) -> Picture:
    """The picture of an Image or CompressedImage. Raises InputError for an encoding that is not read."""
    if not hasattr(message, "encoding"):
        return Picture(name, message.data.tobytes())
    encoding = message.encoding.lower()
    if encoding in GREY:
        return Picture(name, _pixels(message, name, 1, GREY[encoding])[..., 0])
    if encoding in COLOURS:
        pixels = _pixels(message, name, COLOURS[encoding], 1)[..., :3]
        return Picture(name, np.ascontiguousarray(pixels[..., ::-1] if encoding.startswith("rgb") else pixels))
    if encoding in MOSAICS:
        return Picture(name, np.asarray(cv2.cvtColor(_pixels(message, name, 1, 1)[..., 0], MOSAICS[encoding])))
    known = ", ".join((*GREY, *COLOURS, *MOSAICS))
    raise InputError(f"the encoding {message.encoding!r} is not read. Known: {known}: {name}")


def _pixels(message: Any, name: str, channels: int, size: int) -> NDArray[Any]:
    """Pixels (H, W, channels) of `size` bytes each; rows may be longer than their pixels need."""
    height = int(message.height)
    width = int(message.width)
    step = int(message.step)
    needed = width * channels * size
    if height < 1 or width < 1 or step < needed or message.data.size < height * step:
        raise InputError(
            f"{message.data.size} bytes are no {width} x {height} picture in {message.encoding} "
            f"with {step} bytes a row: {name}"
        )
    rows = np.asarray(message.data[: height * step], np.uint8).reshape(height, step)[:, :needed]
    if size == 1:
        return rows.reshape(height, width, channels).copy()
    order = ">u2" if message.is_bigendian else "<u2"
    words = np.ascontiguousarray(rows).view(order).reshape(height, width, channels)
    return words.astype(np.uint16)


BASE = "base_link"
MOST_PROFILE = 256
READ = "read are MCAP files in ROS 2 form (profile ros2, CDR messages)"
MOST_WAITING = 64  # pictures held while their partner has not come yet


@dataclass(frozen=True, slots=True)
class Contents:
    """What one walk through a bag finds: stamps by topic, first messages by topic, the IMU's readings, /tf_static."""

    stamps: dict[str, Stamps]
    first: dict[str, Any]
    imu: ImuReadings | None
    tree: Tree


def read_bag(path: Path, options: ReadOptions, *, form: str) -> Recording:
    """The pictures, calibration, IMU and truth of a bag; pictures are read as one goes. Raises InputError."""
    require_themselves(path)
    if form == "mcap":
        _require_ros2(path)
    with opened(path) as reader:
        types = {connection.topic: connection.msgtype for connection in reader.connections if connection.msgcount}
        chosen = choose(types, options.topics, str(path))
        found = _walk(reader, chosen, path)
    shots, t_ns, pairing = _shots(path, chosen, found, options)
    stream = PictureStream.open(shots)
    truth, repeats = read_first_poses(path, chosen.truth) if chosen.truth else (None, 0)
    body, body_notes = _body(chosen, found)
    rig, calibration, rig_notes = _rig(path, chosen, found, body, options)
    rig_notes = rig_notes if options.calibration else (*body_notes, *rig_notes)
    imu, imu_calibration, imu_notes = _imu(path, chosen, found, body, options)
    unread = sorted(types.keys() - {*_topics(chosen), ros.TF_STATIC.name, (chosen.truth or "").partition(":")[0]})
    notes = [*chosen.notes, "Stamps are those in the messages' headers.", *pairing, *rig_notes, *imu_notes]
    encoding = getattr(found.first[chosen.left], "encoding", "")
    if encoding.lower() in MOSAICS:
        notes.append(f"The colour mosaic ({encoding}) was turned grey by OpenCV's bilinear interpolation.")
    if repeats:
        notes.append(f"{repeats} poses of {chosen.truth} repeat a stamp; the first pose of each stamp was kept.")
    if unread:
        notes.append(f"Topics that were not read: {', '.join(unread)}.")
    rig = replace(rig, imu=imu_calibration)
    return assemble(form, rig, stream, t_ns, truth=truth, imu=imu, notes=notes, calibration=calibration)


def _require_ros2(path: Path) -> None:
    """Raise InputError where an MCAP file holds messages of another kind. Source: mcap.dev/spec, Header."""
    start = head(path)
    at = len(MAGIC) + 13
    if len(start) < at or start[len(MAGIC)] != Opcode.HEADER:
        raise InputError(f"an MCAP file should begin with its header, this one does not: {path}")
    (length,) = struct.unpack_from("<I", start, at - 4)
    profile = start[at : at + min(length, MOST_PROFILE)].decode("utf-8", "replace")
    if profile == "ros2":
        return
    if profile == "ros1":
        raise InputError(f"an MCAP file with ROS 1 messages; {READ}, so turn it into a ROS 1 .bag or ROS 2: {path}")
    said = f"of the profile {profile!r}" if profile else "that names no profile (Protobuf or JSON, as a rule)"
    raise InputError(f"an MCAP file {said}; {READ}, so turn its messages into sensor_msgs first: {path}")


def _topics(chosen: Chosen) -> list[str]:
    named = (chosen.left, chosen.right, chosen.left_info, chosen.right_info, chosen.imu)
    return [topic for topic in named if topic]


def _walk(reader: Any, chosen: Chosen, path: Path) -> Contents:
    """Go through the chosen topics once; no picture is decoded, and none is kept."""
    truth = (chosen.truth or "").partition(":")[0]
    wanted = [c for c in reader.connections if c.topic in {*_topics(chosen), ros.TF_STATIC.name, truth}]
    stamps: dict[str, list[int]] = {}
    first: dict[str, Any] = {}
    readings: list[tuple[float, ...]] = []
    static = []
    for connection, _, raw in reader.messages(wanted):
        topic = connection.topic
        if topic in first and topic in (truth, chosen.left_info, chosen.right_info):
            continue
        message = reader.deserialize(raw, connection.msgtype)
        if topic == ros.TF_STATIC.name:
            static.append(message)
            continue
        if topic not in first:
            first[topic] = _without_pixels(message)
        if hasattr(message, "header"):
            stamps.setdefault(topic, []).append(ros.stamp_ns(message))
        if topic == chosen.imu:
            w = message.angular_velocity
            a = message.linear_acceleration
            readings.append((w.x, w.y, w.z, a.x, a.y, a.z))
    unheard = next((topic for topic in (chosen.left, chosen.right) if topic and topic not in first), None)
    if unheard:
        raise InputError(f"{unheard} is said to have messages, but has none that can be read in {path}")
    known = {topic: _rising(np.array(found, np.int64), topic, path) for topic, found in stamps.items()}
    imu = _readings(chosen.imu, known[chosen.imu], readings, path) if chosen.imu and readings else None
    return Contents(known, first, imu, tree_of(static, str(path)))


def _without_pixels(message: Any) -> Any:
    """A message to keep: of a picture only how it is encoded, for its pixels may be a view of much more."""
    if not hasattr(message, "data"):
        return message
    return SimpleNamespace(header=message.header, encoding=getattr(message, "encoding", ""))


def _readings(topic: str, t_ns: Stamps, rows: list[tuple[float, ...]], path: Path) -> ImuReadings:
    values = np.array(rows, float)
    bad = np.flatnonzero(~np.isfinite(values).all(1))
    if bad.size:
        raise InputError(f"reading {bad[0]} of {topic} should be finite, but is {values[bad[0]].tolist()} in {path}")
    return ImuReadings(t_ns, values[:, :3].copy(), values[:, 3:].copy())


def _rising(t_ns: Stamps, topic: str, path: Path) -> Stamps:
    late = np.flatnonzero(np.diff(t_ns) <= 0)
    if late.size:
        at = int(late[0])
        raise InputError(
            f"{topic}: stamps must increase, but message {at + 1} has {t_ns[at + 1]} ns after {t_ns[at]} ns in {path}"
        )
    return t_ns


def _shots(path: Path, chosen: Chosen, found: Contents, options: ReadOptions) -> tuple[Any, Stamps, Notes]:
    stamps = {chosen.left: found.stamps[chosen.left]}
    notes = Notes()
    if chosen.right is not None:
        left_ns = found.stamps[chosen.left]
        right_ns = found.stamps[chosen.right]
        at_left, at_right, notes = partners(left_ns, right_ns, options.within_ns, str(path))
        stamps = {chosen.left: left_ns[at_left], chosen.right: right_ns[at_right]}
    places = {topic: {int(t): index for index, t in enumerate(t_ns)} for topic, t_ns in stamps.items()}
    return partial(_pictures, path, places, stamps[chosen.left]), stamps[chosen.left], notes


def _pictures(path: Path, places: dict[str, dict[int, int]], t_ns: Stamps) -> Iterator[RecordedFrame]:
    """Shots in order; a picture waits for its partner, and few may wait at once."""
    waiting: dict[int, dict[str, Picture]] = {}
    due = 0
    with opened(path) as reader:
        for connection, _, raw in reader.messages([c for c in reader.connections if c.topic in places]):
            message: Any = reader.deserialize(raw, connection.msgtype)
            index = places[connection.topic].get(ros.stamp_ns(message))
            if index is None:
                continue
            name = f"picture {index} of {connection.topic} in {path}"
            waiting.setdefault(index, {})[connection.topic] = picture(message, name)
            if len(waiting) > MOST_WAITING:
                raise InputError(f"left and right pictures lie more than {MOST_WAITING} apart in {path}")
            while len(waiting.get(due, ())) == len(places):
                shot = waiting.pop(due)
                yield RecordedFrame(int(t_ns[due]), tuple(shot[topic] for topic in places))
                due += 1


def _frame(message: Any) -> str:
    return plain(message.header.frame_id)


def _body(chosen: Chosen, found: Contents) -> tuple[str | None, Notes]:
    """The frame that the truth is of, else base_link, where the cameras hang on it; None is the left camera."""
    left = _frame(found.first[chosen.left])
    truth, _, pair = (chosen.truth or "").partition(":")
    stated = pair.rpartition(".")[2] or plain(getattr(found.first.get(truth), "child_frame_id", ""))
    for frame in (stated, BASE):
        if frame and between(found.tree, frame, left) is not None:
            taken = truth and frame != stated
            whose = f", and {truth}, which names no frame, was taken to be of it" if taken else ""
            return frame, (f"The body is {frame}{whose}.",)
    if stated:
        return None, (f"The body is the left camera; where {stated} is, of which the truth is, is not said.",)
    return None, (f"The body is the left camera{', and the truth was taken to be of it' if truth else ''}.",)


def _rig(path: Path, chosen: Chosen, found: Contents, body: str | None, options: ReadOptions) -> tuple[Rig, str, Notes]:
    if options.calibration is not None:
        has_imu = read_yaml(options.calibration).has("cam0", "T_cam_imu")
        rig, notes = chain_rig(options.calibration, 2 if chosen.right else 1, None if has_imu else np.eye(4))
        whose = "the IMU" if has_imu else "the left camera"
        said = f"The calibration is that of {options.calibration.name}, and the body {whose}, whatever the bag says."
        return rig, str(options.calibration), (said, *notes[1:])
    eyes = []
    for topic, info in ((chosen.left, chosen.left_info), (chosen.right, chosen.right_info)):
        if topic is None:
            continue
        if info is None or info not in found.first:
            raise InputError(f"no camera_info for {topic}: name its topic or a camchain.yaml of Kalibr's for {path}")
        is_rectified = "rect" in topic.replace("unrect", "")
        eyes.append((Info(info, found.first[info], is_rectified), _frame(found.first[topic])))
    rig, notes = info_rig(eyes, found.tree, body)
    if any(info.rectified for info, _ in eyes):
        notes = (*notes, "The topics say that the pictures are rectified: the calibration is their matrix P.")
    return rig, str(path), notes


def _imu(
    path: Path, chosen: Chosen, found: Contents, body: str | None, options: ReadOptions
) -> tuple[ImuReadings | None, ImuCalibration | None, Notes]:
    """The readings and their calibration; neither where nothing says how noisy the IMU is, or where it sits."""
    if found.imu is None or chosen.imu is None:
        return None, None, ()
    noise = find_imu(path, options)
    if noise is None:
        why = "a bag does not say how noisy an IMU is; name Kalibr's imu.yaml"
        return None, None, (f"{chosen.imu} was dropped: {why}.",)
    T_body_imu: Array | None = np.eye(4)
    if options.calibration is None:
        frame = _frame(found.first[chosen.imu])
        T_body_imu = between(found.tree, body or _frame(found.first[chosen.left]), frame)
    if T_body_imu is None:
        return None, None, (f"{chosen.imu} was dropped: nothing says where it sits.",)
    return found.imu, read_imu(noise, T_body_imu), (f"The IMU's noise is that of {noise.name}.",)


TRUE_TF_STATIC = f"/ground_truth{ros.TF_STATIC.name}"
VERSION: Final = 8  # of rosbag2's metadata; ROS 2 Iron and later read it


def write_ros2(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Write every message of both files, bit for bit, and say what became of the rest."""
    del views  # a bag holds the pictures as they were recorded
    paths = [path for path in (source.folder / ros.SENSORS_FILE, source.folder / ros.TRUTH_FILE) if path.is_file()]
    mounts = [tuple(bytes(data) for _, data in Bag.open(path).raw((ros.TF_STATIC,))) for path in paths]
    folder.rmdir()  # rosbags makes its own
    writer = Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    for name, text in _records(paths).items():
        writer.set_custom_data(name, text)
    try:
        with AnyReader(paths, default_typestore=TYPES) as reader, writer:
            _copy(reader, writer, true_mounts_differ=len(set(mounts)) > 1)
    except (AnyReaderError, ReaderError) as error:
        raise SequenceError(f"rosbags does not read this sequence ({error}): {source.folder}") from error
    notes = ["Notes and attachments (wheels, IMU, case, versions) became custom_data of metadata.yaml."]
    if len(set(mounts)) > 1:
        notes.append(f"The true mounts differ from those told: they are on {TRUE_TF_STATIC}.")
    return notes


def _records(paths: list[Path]) -> dict[str, str]:
    records = {}
    for path in paths:
        bag = Bag.open(path)
        for name in (ros.WHEELS_NOTE, ros.IMU_NOTE, ros.PROVENANCE_NOTE, ros.IMPORT_NOTE):
            if entries := bag.note(name):
                records[name] = json.dumps(entries, sort_keys=True)
        for name in (ros.CASE_ATTACHMENT, ros.NAMES_ATTACHMENT):
            if bag.has_attachment(name):
                records[name] = bag.attachment(name).decode()
    return records


def _copy(reader: AnyReader, writer: Writer, *, true_mounts_differ: bool) -> None:
    """Every message at its time; both files' /tf_static would be one topic, so the truth's is renamed or dropped."""
    names = [_name(connection, reader, true_mounts_differ=true_mounts_differ) for connection in reader.connections]
    into = {
        id(connection): writer.add_connection(
            name,
            connection.msgtype,
            msgdef=connection.msgdef.data,
            rihs01=TYPES.hash_rihs01(connection.msgtype),
            offered_qos_profiles=getattr(connection.ext, "offered_qos_profiles", ()),
        )
        for connection, name in zip(reader.connections, names, strict=True)
        if name and connection.msgcount
    }
    for connection, t_ns, data in reader.messages():
        if id(connection) in into:
            writer.write(into[id(connection)], t_ns, data)


def _name(connection: Connection, reader: AnyReader, *, true_mounts_differ: bool) -> str | None:
    """A topic's name in the bag; None for a message that is there already, for the sensors' file comes first."""
    if connection.topic != ros.TF_STATIC.name or connection.owner is reader.connections[0].owner:
        return connection.topic
    return TRUE_TF_STATIC if true_mounts_differ else None


def _begins(path: Path, suffix: str) -> bool:
    """Whether a file begins as those of an ending do; a sensors.mcap is a sequence of our own."""
    magic = next(magic for magic, known in MAGICS.items() if known == suffix)
    return path.name != ros.SENSORS_FILE and head(path).startswith(magic)


HEEDS = frozenset({"calibration", "imu", "within_ns", "topics"})
LAYOUTS = (
    Layout(
        "ros2",
        f"a ROS 2 bag: a folder with {METADATA}, or a .db3 file",
        lambda path: (path / METADATA).is_file() or _begins(path, ".db3"),
        partial(read_bag, form="ros2"),
        HEEDS,
        Writing(write_ros2, topics=(ros.LEFT_IMAGE.name, ros.RIGHT_IMAGE.name, ros.IMU.name), keeps=None),
    ),
    Layout("ros1", "a ROS 1 bag: a .bag file", partial(_begins, suffix=".bag"), partial(read_bag, form="ros1"), HEEDS),
    Layout("mcap", "an .mcap file", partial(_begins, suffix=".mcap"), partial(read_bag, form="mcap"), HEEDS),
)
