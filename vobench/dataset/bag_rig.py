"""Reads the rig of a bag: camera intrinsics from CameraInfo messages, and extrinsics from /tf_static."""

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
UNIT_TOLERANCE = 1e-3  # the largest difference of a quaternion's norm from 1
ROTATION_TOLERANCE = 1e-3  # the largest error of a component of a rotation matrix

# The static transforms T_parent_child (4, 4), by the names of the parent and the child frame.
StaticTransforms = Mapping[tuple[str, str], Array]


def find_transform(
    transforms: StaticTransforms,
    start: str,
    end: str,
) -> Array | None:
    """The transform T_start_end between two frames, by a breadth-first search; None if they are not connected."""
    T_start_frames = {start: np.eye(4)}  # T_start_frame of every frame that has been reached
    queue = [start]
    while queue and end not in T_start_frames:
        frame = queue.pop(0)
        for (parent, child), T_parent_child in transforms.items():
            if frame == parent:
                neighbour = child
                T_frame_neighbour = T_parent_child
            elif frame == child:
                neighbour = parent
                T_frame_neighbour = se3.inverse(T_parent_child)
            else:
                continue
            if neighbour not in T_start_frames:
                T_start_frames[neighbour] = T_start_frames[frame] @ T_frame_neighbour
                queue.append(neighbour)
    return T_start_frames.get(end)


def static_transforms(messages: list[Any], path: str) -> StaticTransforms:
    """The transforms in TFMessages of a bag at `path`. Raises InputError if one is not a rigid transform."""
    transforms = {}
    for message in messages:
        for stamped in message.transforms:
            parent = frame_name(stamped.header.frame_id)
            child = frame_name(stamped.child_frame_id)
            fields = np.array(pose_fields(stamped.transform), float)  # x, y, z, qx, qy, qz, qw
            is_finite = bool(np.isfinite(fields).all())
            norm = float(np.linalg.norm(fields[3:]))
            if not is_finite or abs(norm - 1) > UNIT_TOLERANCE:
                raise InputError(f"/tf_static: {parent} to {child} should be finite with a unit quaternion in {path}")
            fields[3:] /= norm
            transforms[parent, child] = poses_from_fields(fields)
    return transforms


def frame_name(frame_id: str) -> str:
    """The name of a frame without leading slashes, which early versions of ROS 1 require."""
    return frame_id.lstrip("/")


@dataclass(frozen=True, slots=True)
class Info:
    """A CameraInfo message of ROS 1 or ROS 2.

    `topic` is the topic of the message.
    `message` is the message. Its matrices are called K, R, P and D in ROS 1, and k, r, p and d in ROS 2.
    `rectified` is whether the pictures of the camera are rectified.
    """

    topic: str
    message: Any
    rectified: bool

    def matrix(self, name: str, *shape: int) -> Array:
        """The matrix with the name k, r or p, as an array of the given shape. It is 0 for an uncalibrated camera.

        Raises InputError if the matrix does not have this shape or is not finite.
        """
        values = np.asarray(self._field(name), float)
        has_expected_size = values.size == np.prod(shape)
        if not has_expected_size or not np.isfinite(values).all():
            raise InputError(f"{self.topic}: {name.upper()} should be finite numbers, but is {values.tolist()}")
        return values.reshape(shape)

    def _field(self, name: str) -> Any:
        """The field with a name in lower case (ROS 2), or otherwise in upper case (ROS 1)."""
        if hasattr(self.message, name):
            return getattr(self.message, name)
        return getattr(self.message, name.upper())

    @property
    def R_rectified_camera(self) -> Array:
        """The rotation R (3, 3) from the camera to the rectified frame; the identity for an uncalibrated camera.

        Raises InputError if R is not a rotation.
        """
        R = self.matrix("r", 3, 3)
        if not R.any():
            return np.eye(3)
        if not se3.is_rotation(R, tolerance=ROTATION_TOLERANCE):
            raise InputError(f"{self.topic}: R should be a rotation, but is {R.tolist()}")
        return se3.nearest_rotation(R)

    @property
    def camera(self) -> Camera:
        """The camera model of the pictures. If they are rectified, it is a pinhole camera with the matrix P.

        Raises InputError if the message has no valid calibration.
        """
        message = self.message
        size_px = (int(message.width), int(message.height))
        if self.rectified:
            rectified_focal_px = focal_and_center_px(self.matrix("p", 3, 4))
            return focal_camera(size_px, rectified_focal_px, "none", [], place=self.topic)
        if message.distortion_model in VOBENCH_MODELS:
            return parse_camera(message)
        focal_px = focal_and_center_px(self.matrix("k", 3, 3))
        coefficients = [float(value) for value in self._field("d")]
        if not np.isfinite(coefficients).all():
            raise InputError(f"{self.topic}: D should be finite numbers, but is {coefficients}")
        return focal_camera(size_px, focal_px, message.distortion_model, coefficients, place=self.topic)


def stereo_transform_from_projection(left: Info, right: Info) -> Array:
    """The transform T_left_right from R and P of both cameras, as the stereo calibration of ROS defines them.

    R rotates from the camera to the rectified frame, and P[0, 3] is -fx times the baseline.
    Raises InputError if P has no baseline.
    Source: the comments in sensor_msgs/CameraInfo.
    """
    P = right.matrix("p", 3, 4)
    focal_px = P[0, 0]
    baseline_m = -P[0, 3] / focal_px if focal_px > 0 else 0.0
    if baseline_m <= 0:
        raise InputError(f"neither /tf_static nor P of {right.topic} says where the right camera is; give a camchain")
    # The frames of rectified pictures are rectified already.
    R_rectified_left = np.eye(3) if left.rectified else left.R_rectified_camera
    R_rectified_right = np.eye(3) if right.rectified else right.R_rectified_camera
    R_left_right = R_rectified_left.T @ R_rectified_right
    t_left_right = R_rectified_left.T @ [baseline_m, 0.0, 0.0]
    return se3.transform(R_left_right, t_left_right)


@dataclass(frozen=True, slots=True)
class FramedInfo:
    """A CameraInfo message with the frame of its camera.

    `info` is the message.
    `frame` is the name of the camera's frame in /tf_static.
    """

    info: Info
    frame: str


def info_rig(
    cameras: Sequence[FramedInfo],
    transforms: StaticTransforms,
    body: str | None,
) -> tuple[Rig, tuple[str, ...]]:
    """The rig of one or two cameras, and notes about it for the user.

    `cameras` are the left camera and, for a stereo rig, the right camera.
    `transforms` are the static transforms of the bag.
    `body` is the name of the body frame; None for the frame of the left camera.
    Raises InputError if the calibration of a camera or the pose of the right camera is unknown.
    """
    left = cameras[0]
    T_body_left = _T_body_left(left, transforms, body)
    if len(cameras) == 1:
        return Rig(left.info.camera, None, T_body_left, None), ()

    right = cameras[1]
    # /tf_static contains the frames of the cameras, not those of rectified pictures.
    is_rectified = left.info.rectified or right.info.rectified
    # A frame that both cameras share contains no information about the baseline.
    has_shared_frame = left.frame == right.frame
    T_left_right = None
    if not is_rectified and not has_shared_frame:
        T_left_right = find_transform(transforms, left.frame, right.frame)

    notes: tuple[str, ...] = ()
    if T_left_right is None:
        T_left_right = stereo_transform_from_projection(left.info, right.info)
        topics = f"{left.info.topic} and {right.info.topic}"
        notes = (f"The position of the right camera was derived from R and P of {topics}.",)
    T_body_right = T_body_left @ T_left_right
    return Rig(left.info.camera, right.info.camera, T_body_left, T_body_right), notes


def _T_body_left(
    left: FramedInfo,
    transforms: StaticTransforms,
    body: str | None,
) -> Array:
    """The pose (4, 4) of the left camera, or of its rectified frame, on the body; the identity if it is unknown."""
    T_body_camera = find_transform(transforms, body, left.frame) if body else None
    if T_body_camera is None:
        return np.eye(4)
    if not left.info.rectified:
        return T_body_camera
    R_camera_rectified = left.info.R_rectified_camera.T
    T_camera_rectified = se3.transform(R_camera_rectified, np.zeros(3))
    return T_body_camera @ T_camera_rectified
