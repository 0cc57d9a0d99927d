"""The rig of a bag: lenses by CameraInfo, places by /tf_static or by a stereo pair's projection matrices."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vobench.dataset.lens import focal_camera
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sequence import messages as ros
from vobench.sequence.messages import ALL_AROUND, DOUBLE_SPHERE

OUR_OWN = (DOUBLE_SPHERE, ALL_AROUND)  # lenses that ROS has no name for


@dataclass(frozen=True, slots=True)
class Tree:
    """Frames that never move against each other: T_parent_child by the names of both."""

    links: Mapping[tuple[str, str], Array]

    def between(self, a: str, b: str) -> Array | None:
        """T_a_b; None where nothing says so."""
        reached = {a: np.eye(4)}
        edge = [a]
        while edge and b not in reached:
            at = edge.pop(0)
            for (parent, child), T in self.links.items():
                other, T_at_other = (child, T) if parent == at else (parent, se3.inverse(T))
                if at in (parent, child) and other not in reached:
                    reached[other] = reached[at] @ T_at_other
                    edge.append(other)
        return reached.get(b)


def tree_of(messages: list[Any], path: str) -> Tree:
    """The transforms of TFMessages. Raises InputError for one that is no rigid transform."""
    links = {}
    for stamped in (stamped for message in messages for stamped in message.transforms):
        parent, child = plain(stamped.header.frame_id), plain(stamped.child_frame_id)
        fields = np.array(ros.pose_fields(stamped.transform), float)
        norm = float(np.linalg.norm(fields[3:])) if np.isfinite(fields).all() else 0.0
        if abs(norm - 1) > 1e-3:
            raise InputError(f"/tf_static: {parent} to {child} should be finite with a unit quaternion in {path}")
        fields[3:] /= norm
        links[parent, child] = ros.poses(fields)
    return Tree(links)


def plain(frame: str) -> str:
    """A frame's name without the slash that ROS 1 once began it with."""
    return frame.lstrip("/")


def is_rectified(topic: str) -> bool:
    """Whether a topic's name says that its pictures are rectified."""
    return "rect" in topic.replace("unrect", "")


@dataclass(frozen=True, slots=True)
class Info:
    """What a CameraInfo says, by the names that ROS 1 and ROS 2 share when small."""

    topic: str
    message: Any
    rectified: bool

    def matrix(self, name: str, *shape: int) -> Array:
        """K, R or P; zeros mean that nobody calibrated. Raises InputError."""
        found = getattr(self.message, name, None)
        values = np.asarray(getattr(self.message, name.upper()) if found is None else found, float)
        if values.size != np.prod(shape) or not np.isfinite(values).all():
            raise InputError(f"{self.topic}: {name.upper()} should be finite numbers, but is {values.tolist()}")
        return values.reshape(shape)

    @property
    def turn(self) -> Array:
        """R (3, 3), which turns a camera's axes into its rectified ones; zeros stand for none. Raises InputError."""
        R = self.matrix("r", 3, 3)
        if not R.any():
            return np.eye(3)
        if not se3.is_rotation(R, tolerance=1e-3):
            raise InputError(f"{self.topic}: R should be a rotation, but is {R.tolist()}")
        return se3.nearest_rotation(R)

    @property
    def camera(self) -> Camera:
        """The lens of the pictures: that of P where they are rectified. Raises InputError."""
        m = self.message
        if m.distortion_model in OUR_OWN and not self.rectified:
            return ros.camera(m)
        K = self.matrix("p", 3, 4) if self.rectified else self.matrix("k", 3, 3)
        d = [] if self.rectified else [float(value) for value in (m.d if hasattr(m, "d") else m.D)]
        if not np.isfinite(d).all():
            raise InputError(f"{self.topic}: D should be finite numbers, but is {d}")
        focal = [float(value) for value in (K[0, 0], K[1, 1], K[0, 2], K[1, 2])]
        model = "none" if self.rectified else m.distortion_model
        return focal_camera((int(m.width), int(m.height)), focal, model, d, place=self.topic)


def by_projection(left: Info, right: Info) -> Array:
    """T_left_right by R and P of both, as ROS's stereo calibration states it. Raises InputError where it doesn't.

    Source: the comments of sensor_msgs/CameraInfo: R turns into the rectified frame, Tx = -fx baseline.
    """
    P = right.matrix("p", 3, 4)
    baseline_m = -P[0, 3] / P[0, 0] if P[0, 0] > 0 else 0.0
    if baseline_m <= 0:
        raise InputError(f"neither /tf_static nor P of {right.topic} says where the right camera is; give a camchain")
    R_left, R_right = (np.eye(3) if info.rectified else info.turn for info in (left, right))
    return se3.transform(R_left.T @ R_right, R_left.T @ [baseline_m, 0.0, 0.0])


def info_rig(eyes: list[tuple[Info, str]], tree: Tree, body: str | None) -> tuple[Rig, tuple[str, ...]]:
    """The rig of one or two cameras, each with its frame's name, on `body`, or on the left camera where that is None.

    Raises InputError where a camera is none, or nothing says where the right one is.
    """
    (left, left_frame), *others = eyes
    mount = tree.between(body, left_frame) if body else None
    T_body_left = np.eye(4) if mount is None else mount
    if mount is not None and left.rectified:  # the tree knows the camera, and not its rectified picture
        T_body_left = mount @ se3.transform(left.turn.T, np.zeros(3))
    if not others:
        return Rig(left.camera, None, T_body_left, None), ()
    right, right_frame = others[0]
    T_left_right = None if left.rectified or right.rectified else tree.between(left_frame, right_frame)
    notes: tuple[str, ...] = ()
    if T_left_right is None or left_frame == right_frame:
        T_left_right = by_projection(left, right)
        notes = (f"Where the right camera is was taken from R and P of {left.topic} and {right.topic}.",)
    return Rig(left.camera, right.camera, T_body_left, T_body_left @ T_left_right), notes
