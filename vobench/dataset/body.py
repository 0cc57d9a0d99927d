"""Builds rigs from mounted cameras, and changes the body of a rig."""

from dataclasses import dataclass, replace

from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class MountedCamera:
    """A camera and its pose T_body_camera (4, 4)."""

    camera: Camera
    T_body_camera: Array


def mounted_rig(left: MountedCamera, right: MountedCamera | None = None) -> Rig:
    """The rig of one or two cameras."""
    if right is None:
        return Rig(left.camera, None, left.T_body_camera, None)
    return Rig(left.camera, right.camera, left.T_body_camera, right.T_body_camera)


def on_body(rig: Rig, T_body_old: Array) -> Rig:
    """The same rig on another body. T_body_old (4, 4) is the pose of the old body. Wheels are dropped."""
    T_body_left = T_body_old @ rig.T_body_left
    T_body_right = None if rig.T_body_right is None else T_body_old @ rig.T_body_right
    imu = rig.imu
    if imu is not None:
        imu = replace(imu, T_body_imu=T_body_old @ imu.T_body_imu)
    return Rig(rig.left, rig.right, T_body_left, T_body_right, imu=imu)
