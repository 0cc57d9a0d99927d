"""Reads the rig of a bag: lenses from CameraInfo messages, and mounts from /tf_static."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vobench.dataset.distortion import focal_camera
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, focal_and_center_px
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sequence.camera_info import DOUBLE_SPHERE, EQUIRECTANGULAR, parse_camera
from vobench.sequence.message import pose_fields, poses_from_fields

VOBENCH_MODELS = (DOUBLE_SPHERE, EQUIRECTANGULAR)  # the camera models for which ROS has no name
UNIT_TOLERANCE = 1e-3  # the tolerance for the norm of a quaternion
ROTATION_TOLERANCE = 1e-3

Tree = Mapping[tuple[str, str], Array]  # T_parent_child of static frames, by the names of both


def between(
    tree: Tree,
    start: str,
    end: str,
) -> Array | None:
    """T_start_end along the transforms of a tree; None if they do not connect the two frames."""
    T_start = {start: np.eye(4)}  # T_start_frame of every frame that has been reached
    queue = [start]
    while queue and end not in T_start:
        frame = queue.pop(0)
        for (parent, child), T_parent_child in tree.items():
            if frame == parent:
                neighbour = child
                T_frame_neighbour = T_parent_child
            elif frame == child:
                neighbour = parent
                T_frame_neighbour = se3.inverse(T_parent_child)
            else:
                continue
            if neighbour not in T_start:
                T_start[neighbour] = T_start[frame] @ T_frame_neighbour
                queue.append(neighbour)
    return T_start.get(end)


def tree_of(messages: list[Any], path: str) -> Tree:
    """The transforms in TFMessages. Raises InputError if one is not a rigid transform."""
    tree = {}
    for message in messages:
        for stamped in message.transforms:
            parent = plain(stamped.header.frame_id)
            child = plain(stamped.child_frame_id)
            fields = np.array(pose_fields(stamped.transform), float)  # x, y, z, qx, qy, qz, qw
            norm = float(np.linalg.norm(fields[3:])) if np.isfinite(fields).all() else 0.0
            if abs(norm - 1) > UNIT_TOLERANCE:
                raise InputError(f"/tf_static: {parent} to {child} should be finite with a unit quaternion in {path}")
            fields[3:] /= norm
            tree[parent, child] = poses_from_fields(fields)
    return tree


def plain(frame: str) -> str:
    """The name of a frame without the leading slash that early versions of ROS 1 require."""
    return frame.lstrip("/")


@dataclass(frozen=True, slots=True)
class Info:
    """A CameraInfo message of ROS 1 or ROS 2, and whether its pictures are rectified.

    The fields are called K, R, P and D in ROS 1, and k, r, p and d in ROS 2.
    """

    topic: str
    message: Any
    rectified: bool

    def matrix(self, name: str, *shape: int) -> Array:
        """The matrix k, r or p, which is 0 for an uncalibrated camera. Raises InputError."""
        values = np.asarray(self._field(name), float)
        if values.size != np.prod(shape) or not np.isfinite(values).all():
            raise InputError(f"{self.topic}: {name.upper()} should be finite numbers, but is {values.tolist()}")
        return values.reshape(shape)

    def _field(self, name: str) -> Any:
        if hasattr(self.message, name):
            return getattr(self.message, name)
        return getattr(self.message, name.upper())

    @property
    def R_rectified_camera(self) -> Array:
        """R (3, 3), or the identity for an uncalibrated camera. Raises InputError if R is not a rotation."""
        R = self.matrix("r", 3, 3)
        if not R.any():
            return np.eye(3)
        if not se3.is_rotation(R, tolerance=ROTATION_TOLERANCE):
            raise InputError(f"{self.topic}: R should be a rotation, but is {R.tolist()}")
        return se3.nearest_rotation(R)

    @property
    def camera(self) -> Camera:
        """The camera of the pictures, which is the pinhole with matrix P if they are rectified. Raises InputError."""
        message = self.message
        size_px = (int(message.width), int(message.height))
        if self.rectified:
            return focal_camera(size_px, focal_and_center_px(self.matrix("p", 3, 4)), "none", [], place=self.topic)
        if message.distortion_model in VOBENCH_MODELS:
            return parse_camera(message)
        focal_px = focal_and_center_px(self.matrix("k", 3, 3))
        coefficients = [float(value) for value in self._field("d")]
        if not np.isfinite(coefficients).all():
            raise InputError(f"{self.topic}: D should be finite numbers, but is {coefficients}")
        return focal_camera(size_px, focal_px, message.distortion_model, coefficients, place=self.topic)


def by_projection(left: Info, right: Info) -> Array:
    """T_left_right from R and P of both cameras, as the stereo calibration of ROS defines them.

    Raises InputError if P has no baseline.
    Source: the comments in sensor_msgs/CameraInfo. R rotates into the rectified frame, and Tx = -fx baseline.
    """
    P = right.matrix("p", 3, 4)
    baseline_m = -P[0, 3] / P[0, 0] if P[0, 0] > 0 else 0.0
    if baseline_m <= 0:
        raise InputError(f"neither /tf_static nor P of {right.topic} says where the right camera is; give a camchain")
    R_view_left = np.eye(3) if left.rectified else left.R_rectified_camera
    R_view_right = np.eye(3) if right.rectified else right.R_rectified_camera
    position_m = R_view_left.T @ [baseline_m, 0.0, 0.0]
    return se3.transform(R_view_left.T @ R_view_right, position_m)


@dataclass(frozen=True, slots=True)
class FramedInfo:
    """A CameraInfo message, and the name of its camera's frame in /tf_static."""

    info: Info
    frame: str


def info_rig(
    cameras: Sequence[FramedInfo],
    tree: Tree,
    body: str | None,
) -> tuple[Rig, tuple[str, ...]]:
    """The rig of one or two cameras, and notes on it.

    `body` is the name of the body's frame, None for that of the left camera.
    Raises InputError if the calibration of a camera or the pose of the right camera is unknown.
    """
    left = cameras[0]
    T_body_left = _T_body_left(left, tree, body)
    if len(cameras) == 1:
        return Rig(left.info.camera, None, T_body_left, None), ()

    right = cameras[1]
    # /tf_static contains the frames of the cameras, not those of rectified pictures.
    is_rectified = left.info.rectified or right.info.rectified
    T_left_right = None if is_rectified else between(tree, left.frame, right.frame)
    notes: tuple[str, ...] = ()
    if T_left_right is None or left.frame == right.frame:
        T_left_right = by_projection(left.info, right.info)
        topics = f"{left.info.topic} and {right.info.topic}"
        notes = (f"The position of the right camera was derived from R and P of {topics}.",)
    return Rig(left.info.camera, right.info.camera, T_body_left, T_body_left @ T_left_right), notes


def _T_body_left(
    left: FramedInfo,
    tree: Tree,
    body: str | None,
) -> Array:
    T_body_camera = between(tree, body, left.frame) if body else None
    if T_body_camera is None:
        return np.eye(4)
    if not left.info.rectified:
        return T_body_camera
    R_camera_rectified = left.info.R_rectified_camera.T
    return T_body_camera @ se3.transform(R_camera_rectified, np.zeros(3))
