"""Recordings in bags: ROS 1, ROS 2, and MCAP files in ROS 2 form, whatever wrote them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from vobench.dataset.assemble import assemble
from vobench.dataset.bag_picture import encoding_note, picture
from vobench.dataset.bag_rig import Info, Tree, info_rig, is_rectified, plain, tree_of
from vobench.dataset.bag_topics import Chosen, choose
from vobench.dataset.calibration import chain_rig, find_imu
from vobench.dataset.files import require_themselves
from vobench.dataset.kalibr import read_imu
from vobench.dataset.options import Options
from vobench.dataset.picture import Picture
from vobench.dataset.picture_list import partners
from vobench.dataset.recording import Recording
from vobench.dataset.stream import PictureStream, Shot
from vobench.dataset.yaml_values import read_yaml
from vobench.errors import InputError
from vobench.geometry.rig import ImuCalibration, Rig
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sequence import messages as ros
from vobench.sequence.pose_topic import opened, read_first_poses
from vobench.trajectory.trajectory import Stamps

TF_STATIC, BASE = "/tf_static", "base_link"
MOST_WAITING = 64  # pictures held while their partner has not come yet

Notes = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Contents:
    """What one walk through a bag finds: stamps by topic, first messages by topic, the IMU's readings, /tf_static."""

    stamps: dict[str, Stamps]
    first: dict[str, Any]
    imu: ImuReadings | None
    tree: Tree


def read_bag(path: Path, options: Options, *, form: str) -> Recording:
    """The pictures, calibration, IMU and truth of a bag; pictures are read as one goes. Raises InputError."""
    require_themselves(path)
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
    unread = sorted(types.keys() - {*_topics(chosen), TF_STATIC, (chosen.truth or "").partition(":")[0]})
    notes = [*chosen.notes, "Stamps are those in the messages' headers.", *pairing, *rig_notes, *imu_notes]
    notes += encoding_note(found.first[chosen.left])
    if repeats:
        notes.append(f"{repeats} poses of {chosen.truth} repeat a stamp; the first pose of each stamp was kept.")
    if unread:
        notes.append(f"Topics that were not read: {', '.join(unread)}.")
    rig = replace(rig, imu=imu_calibration)
    return assemble(form, rig, stream, t_ns, truth=truth, imu=imu, notes=notes, calibration=calibration)


def _topics(chosen: Chosen) -> list[str]:
    named = (chosen.left, chosen.right, chosen.left_info, chosen.right_info, chosen.imu)
    return [topic for topic in named if topic]


def _walk(reader: Any, chosen: Chosen, path: Path) -> Contents:
    """Go through the chosen topics once; no picture is decoded, and none is kept."""
    truth = (chosen.truth or "").partition(":")[0]
    wanted = [c for c in reader.connections if c.topic in {*_topics(chosen), TF_STATIC, truth}]
    stamps: dict[str, list[int]] = {}
    first: dict[str, Any] = {}
    readings: list[tuple[float, ...]] = []
    static = []
    for connection, _, raw in reader.messages(wanted):
        topic = connection.topic
        if topic in first and topic in (truth, chosen.left_info, chosen.right_info):
            continue
        message = reader.deserialize(raw, connection.msgtype)
        if topic == TF_STATIC:
            static.append(message)
            continue
        if topic not in first:
            first[topic] = _without_pixels(message)
        if hasattr(message, "header"):
            stamps.setdefault(topic, []).append(ros.stamp_ns(message))
        if topic == chosen.imu:
            w, a = message.angular_velocity, message.linear_acceleration
            readings.append((w.x, w.y, w.z, a.x, a.y, a.z))
    unheard = next((topic for topic in (chosen.left, chosen.right) if topic and topic not in first), None)
    if unheard:
        raise InputError(f"{unheard} is said to have messages, but has none that can be read in {path}")
    known = {topic: _rising(np.array(found, np.int64), topic, path) for topic, found in stamps.items()}
    return Contents(known, first, _readings(chosen, known, readings, path), tree_of(static, str(path)))


def _without_pixels(message: Any) -> Any:
    """A message to keep: of a picture only how it is encoded, for its pixels may be a view of much more."""
    if not hasattr(message, "data"):
        return message
    return SimpleNamespace(header=message.header, encoding=getattr(message, "encoding", ""))


def _readings(
    chosen: Chosen, stamps: dict[str, Stamps], rows: list[tuple[float, ...]], path: Path
) -> ImuReadings | None:
    if not rows or chosen.imu is None:
        return None
    values = np.array(rows, float)
    bad = np.flatnonzero(~np.isfinite(values).all(1))
    if bad.size:
        raise InputError(
            f"reading {bad[0]} of {chosen.imu} should be finite, but is {values[bad[0]].tolist()} in {path}"
        )
    return ImuReadings(stamps[chosen.imu], values[:, :3].copy(), values[:, 3:].copy())


def _rising(t_ns: Stamps, topic: str, path: Path) -> Stamps:
    late = np.flatnonzero(np.diff(t_ns) <= 0)
    if late.size:
        at = int(late[0])
        raise InputError(
            f"{topic}: stamps must increase, but message {at + 1} has {t_ns[at + 1]} ns after {t_ns[at]} ns in {path}"
        )
    return t_ns


def _shots(path: Path, chosen: Chosen, found: Contents, options: Options) -> tuple[Any, Stamps, Notes]:
    """The pictures in pairs, their stamps (N,), and what pairing them took."""
    left_ns = found.stamps[chosen.left]
    places = {chosen.left: {int(t): index for index, t in enumerate(left_ns)}}
    notes: Notes = ()
    if chosen.right is not None:
        right_ns = found.stamps[chosen.right]
        at_left, at_right, notes = partners(left_ns, right_ns, options.within_ns, str(path))
        places = {
            topic: {int(t): index for index, t in enumerate(stamps)}
            for topic, stamps in ((chosen.left, left_ns[at_left]), (chosen.right, right_ns[at_right]))
        }
        left_ns = left_ns[at_left]
    return partial(_pictures, path, places, left_ns), left_ns, notes


def _pictures(path: Path, places: dict[str, dict[int, int]], t_ns: Stamps) -> Iterator[Shot]:
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
                yield Shot(int(t_ns[due]), tuple(shot[topic] for topic in places))
                due += 1


def _frame(message: Any) -> str:
    return plain(message.header.frame_id)


def _body(chosen: Chosen, found: Contents) -> tuple[str | None, Notes]:
    """The frame that the truth is of, else base_link, where the cameras hang on it; None is the left camera."""
    left = _frame(found.first[chosen.left])
    truth, _, pair = (chosen.truth or "").partition(":")
    stated = pair.rpartition(".")[2] or plain(getattr(found.first.get(truth), "child_frame_id", ""))
    for frame in (stated, BASE):
        if frame and found.tree.between(frame, left) is not None:
            whose = (
                "" if frame == stated or not truth else f", and {truth}, which names no frame, was taken to be of it"
            )
            return frame, (f"The body is {frame}{whose}.",)
    if stated:
        return None, (f"The body is the left camera; where {stated} is, of which the truth is, is not said.",)
    return None, (f"The body is the left camera{', and the truth was taken to be of it' if truth else ''}.",)


def _rig(path: Path, chosen: Chosen, found: Contents, body: str | None, options: Options) -> tuple[Rig, str, Notes]:
    """The cameras by Kalibr's chain where one is given, or by the bag; and what says so."""
    if options.calibration is not None:
        about = "imu" if read_yaml(options.calibration).has("cam0", "T_cam_imu") else "left"
        rig, notes = chain_rig(options.calibration, 2 if chosen.right else 1, "imu" if about == "imu" else "left")
        whose = "the IMU" if about == "imu" else "the left camera"
        said = f"The calibration is that of {options.calibration.name}, and the body {whose}, whatever the bag says."
        return rig, str(options.calibration), (said, *notes)
    eyes = []
    for topic, info in ((chosen.left, chosen.left_info), (chosen.right, chosen.right_info)):
        if topic is not None:
            if info is None or info not in found.first:
                raise InputError(
                    f"no camera_info for {topic}: name its topic or a camchain.yaml of Kalibr's for {path}"
                )
            eyes.append((Info(info, found.first[info], is_rectified(topic)), _frame(found.first[topic])))
    rig, notes = info_rig(eyes, found.tree, body)
    if any(info.rectified for info, _ in eyes):
        notes = (*notes, "The topics say that the pictures are rectified: the calibration is their matrix P.")
    return rig, str(path), notes


def _imu(
    path: Path, chosen: Chosen, found: Contents, body: str | None, options: Options
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
        T_body_imu = found.tree.between(body or _frame(found.first[chosen.left]), frame)
    if T_body_imu is None:
        return None, None, (f"{chosen.imu} was dropped: nothing says where it sits.",)
    return found.imu, read_imu(noise, T_body_imu), (f"The IMU's noise is that of {noise.name}.",)
