"""A rig as a bag tells it: static transforms, CameraInfo, and notes for what ROS has no message for."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from vobench.errors import InputError, SequenceError
from vobench.geometry.rig import ImuCalibration, Rig, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.sequence import messages as ros
from vobench.sequence.bag import Bag, BagWriter
from vobench.sequence.messages import serialise

IMU_NUMBERS = tuple(field.name for field in fields(ImuCalibration) if field.name != "T_body_imu")


def write_mounts(bag: BagWriter, rig: Rig, t_ns: int) -> None:
    """Note the wheels and the IMU, and write where everything sits on the body."""
    if wheels := rig.wheels:
        lengths = {"radius_m": repr(float(wheels.radius_m)), "track_m": repr(float(wheels.track_m))}
        bag.note(ros.WHEELS_NOTE, {**lengths, "ticks_per_revolution": str(wheels.ticks_per_revolution)})
    if rig.imu:
        bag.note(ros.IMU_NOTE, {name: repr(float(getattr(rig.imu, name))) for name in IMU_NUMBERS})
    T_body = dict(zip((ros.LEFT, ros.RIGHT), (rig.T_body_camera(side) for side in rig.sides), strict=False))
    if rig.imu:
        T_body[ros.IMU_FRAME] = rig.imu.T_body_imu
    bag.write(ros.TF_STATIC, t_ns, serialise(ros.transforms(t_ns, ros.BODY, T_body)))


def read_rig(bag: Bag, info_topics: Sequence[ros.Topic]) -> Rig:
    """The rig of a bag, its left and right camera by their topics. Raises SequenceError where that is wrong."""
    bag.require((ros.TF_STATIC, *info_topics[:1]))
    cameras = [ros.camera(_first(bag, topic)) for topic in info_topics if bag.has(topic)]
    stamped = _first(bag, ros.TF_STATIC).transforms
    T_body = {t.child_frame_id: ros.poses(ros.pose_fields(t.transform)) for t in stamped}
    left = cameras[0]
    right = cameras[1] if len(cameras) > 1 else None
    T_body_right = _mount(bag, T_body, ros.RIGHT) if right else None
    return Rig(left, right, _mount(bag, T_body, ros.LEFT), T_body_right, _read_wheels(bag), _read_imu(bag, T_body))


def _first(bag: Bag, topic: ros.Topic) -> Any:
    for _, message in bag.messages((topic,)):
        return message
    raise SequenceError(f"{topic.name} has no message in {bag.path}")


def _mount(bag: Bag, T_body: dict[str, Array], frame: str) -> Array:
    if frame not in T_body:
        raise SequenceError(f"{ros.TF_STATIC.name} does not say where {frame} is mounted in {bag.path}")
    return T_body[frame]


def _read_wheels(bag: Bag) -> WheelGeometry | None:
    entries = bag.note(ros.WHEELS_NOTE)
    if not entries:
        return None
    try:
        radius_m = float(entries["radius_m"])
        track_m = float(entries["track_m"])
        return WheelGeometry(radius_m, track_m, int(entries["ticks_per_revolution"]))
    except (KeyError, ValueError, InputError) as error:
        raise SequenceError(
            f"the wheels are not described as radius, track and ticks ({error!r}) in {bag.path}"
        ) from error


def _read_imu(bag: Bag, T_body: dict[str, Array]) -> ImuCalibration | None:
    entries = bag.note(ros.IMU_NOTE)
    if not entries:
        return None
    try:
        numbers = [float(entries[name]) for name in IMU_NUMBERS]
    except (KeyError, ValueError) as error:
        raise SequenceError(
            f"the IMU is not described as {', '.join(IMU_NUMBERS)} ({error!r}) in {bag.path}"
        ) from error
    return ImuCalibration(_mount(bag, T_body, ros.IMU_FRAME), *numbers)
