"""A rig in a bag: static transforms, CameraInfo, and notes for what ROS has no message for."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from vobench.errors import InputError, SequenceError
from vobench.geometry.rig import ImuCalibration, Rig, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.sequence.bag import Bag
from vobench.sequence.bag_writer import BagWriter
from vobench.sequence.camera_info import parse_camera
from vobench.sequence.cdr import serialise
from vobench.sequence.message import pose_fields, poses_from_fields, tf_message
from vobench.sequence.topic import BODY, IMU_FRAME, IMU_NOTE, LEFT, RIGHT, TF_STATIC, WHEELS_NOTE, Topic

IMU_NUMBERS = tuple(field.name for field in fields(ImuCalibration) if field.name != "T_body_imu")


def write_mounts(bag: BagWriter, rig: Rig, t_ns: int) -> None:
    """Note the wheels and the IMU, and write where each sensor is on the body."""
    if wheels := rig.wheels:
        entries = {
            "radius_m": repr(float(wheels.radius_m)),
            "track_m": repr(float(wheels.track_m)),
            "ticks_per_revolution": str(wheels.ticks_per_revolution),
        }
        bag.note(WHEELS_NOTE, entries)
    if rig.imu:
        numbers = {name: repr(float(getattr(rig.imu, name))) for name in IMU_NUMBERS}
        bag.note(IMU_NOTE, numbers)

    T_body = {LEFT: rig.T_body_left}  # by the name of the child frame
    if rig.T_body_right is not None:
        T_body[RIGHT] = rig.T_body_right
    if rig.imu:
        T_body[IMU_FRAME] = rig.imu.T_body_imu
    transforms = tf_message(t_ns, BODY, T_body)
    bag.write(TF_STATIC, t_ns, serialise(transforms))


def read_rig(bag: Bag, info_topics: Sequence[Topic]) -> Rig:
    """The rig of a bag, by the topics of its left and right camera. Raises SequenceError where that is wrong."""
    bag.require((TF_STATIC, info_topics[0]))
    existing = [topic for topic in info_topics if bag.has(topic)]
    cameras = [parse_camera(_first(bag, topic)) for topic in existing]
    T_body = {}
    for stamped in _first(bag, TF_STATIC).transforms:
        T_body[stamped.child_frame_id] = poses_from_fields(pose_fields(stamped.transform))

    right = None
    T_body_right = None
    if len(cameras) > 1:
        right = cameras[1]
        T_body_right = _mount(bag, T_body, RIGHT)
    T_body_left = _mount(bag, T_body, LEFT)
    return Rig(cameras[0], right, T_body_left, T_body_right, _read_wheels(bag), _read_imu(bag, T_body))


def _first(bag: Bag, topic: Topic) -> Any:
    for _, message in bag.messages((topic,)):
        return message
    raise SequenceError(f"{topic.name} has no message in {bag.path}")


def _mount(
    bag: Bag,
    T_body: dict[str, Array],
    frame: str,
) -> Array:
    if frame not in T_body:
        raise SequenceError(f"{TF_STATIC.name} does not say where {frame} is mounted in {bag.path}")
    return T_body[frame]


def _read_wheels(bag: Bag) -> WheelGeometry | None:
    entries = bag.note(WHEELS_NOTE)
    if not entries:
        return None
    try:
        radius_m = float(entries["radius_m"])
        track_m = float(entries["track_m"])
        ticks = int(entries["ticks_per_revolution"])
        return WheelGeometry(radius_m, track_m, ticks)
    except (KeyError, ValueError, InputError) as error:
        wanted = "radius_m, track_m, ticks_per_revolution"
        raise SequenceError(f"the wheels are not described as {wanted} ({error!r}) in {bag.path}") from error


def _read_imu(bag: Bag, T_body: dict[str, Array]) -> ImuCalibration | None:
    entries = bag.note(IMU_NOTE)
    if not entries:
        return None
    try:
        numbers = [float(entries[name]) for name in IMU_NUMBERS]
    except (KeyError, ValueError) as error:
        wanted = ", ".join(IMU_NUMBERS)
        raise SequenceError(f"the IMU is not described as {wanted} ({error!r}) in {bag.path}") from error
    return ImuCalibration(_mount(bag, T_body, IMU_FRAME), *numbers)
