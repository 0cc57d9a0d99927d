"""Topics and rig of a bag: which topics are the eyes, IMU and truth; lenses by CameraInfo, mounts by /tf_static."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vobench.dataset.kalibr import focal_camera
from vobench.dataset.recording import Topics
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sequence import messages as ros
from vobench.sequence.messages import ALL_AROUND, DOUBLE_SPHERE
from vobench.sequence.recording import POSES

RAW = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
INFO = "sensor_msgs/msg/CameraInfo"
IMU = "sensor_msgs/msg/Imu"
# What tells a left from a right topic.
SIDES = (
    ("left", "right"),
    *((f"{name}0", f"{name}1") for name in ("cam", "camera", "image", "cam_", "camera_", "image_", "video", "fisheye")),
    *((f"{name}1", f"{name}2") for name in ("cam", "camera", "image", "cam_", "camera_", "infra", "fisheye")),
)
NO_PICTURES = ("depth", "disparity", "theora", "confidence", "mask")
TRUE_WORDS = ("ground_truth", "groundtruth", "gt", "truth", "vicon", "mocap", "optitrack", "vrpn")

Types = Mapping[str, str]  # message type by topic


@dataclass(frozen=True, slots=True)
class Chosen:
    """The topics to read; None for what there is not."""

    left: str
    right: str | None
    left_info: str | None
    right_info: str | None
    imu: str | None
    truth: str | None
    notes: tuple[str, ...] = ()


def choose(types: Types, topics: Topics, path: str) -> Chosen:
    """The topics that are named, and for the others those that can be no others. Raises InputError if open."""
    left, right = _eyes(types, topics, path)
    for named, allowed in ((topics.left_info, INFO), (topics.right_info, INFO), (topics.imu, IMU)):
        if named is not None:
            _require(types, named, (allowed,), path)
    imus = [topic for topic, kind in types.items() if kind == IMU]
    imu = topics.imu or (imus[0] if len(imus) == 1 else None)
    truth, notes = _truth(types, topics)
    if len(imus) > 1 and imu is None:
        notes = (*notes, f"No IMU was read: name one of {', '.join(imus)}.")
    return Chosen(
        left,
        right,
        topics.left_info or _info_of(types, left),
        topics.right_info or (_info_of(types, right) if right else None),
        imu,
        truth,
        (f"The pictures are those of {left}{f' and {right}' if right else ', one camera'}.", *notes),
    )


def _eyes(types: Types, topics: Topics, path: str) -> tuple[str, str | None]:
    for named in (topics.left, topics.right):
        if named is not None:
            _require(types, named, (RAW, COMPRESSED), path)
    pictures = [topic for topic, kind in types.items() if kind in (RAW, COMPRESSED)]
    if topics.left is not None:
        partner = [right for left, right in _pairs(pictures) if left == topics.left]
        return topics.left, topics.right or (partner[0] if len(partner) == 1 else None)
    pairs = [pair for pair in _pairs(pictures) if topics.right in (None, pair[1])]
    if len(pairs) == 1:
        return pairs[0]
    seen = [topic for topic in pictures if not any(word in topic.lower() for word in NO_PICTURES)]
    if not pairs and len(seen) == 1 and topics.right is None:
        return seen[0], None
    if not pictures:
        raise InputError(f"no pictures (Image or CompressedImage) in {path}; its topics: {_listed(types)}")
    raise InputError(f"name the left and the right topic of {path}; with pictures: {', '.join(pictures)}")


def _pairs(pictures: list[str]) -> list[tuple[str, str]]:
    found = [
        (topic, topic.replace(left, right))
        for topic in pictures
        for left, right in SIDES
        if left in topic and not any(word in topic.lower() for word in NO_PICTURES)
    ]
    return list(dict.fromkeys(pair for pair in found if pair[1] in pictures))


def _info_of(types: Types, picture: str) -> str | None:
    """The camera_info nearest to a picture's topic, going up by its slashes."""
    parts = picture.split("/")
    names = ("/".join([*parts[:end], "camera_info"]) for end in range(len(parts), 0, -1))
    return next((name for name in names if types.get(name) == INFO), None)


def _truth(types: Types, topics: Topics) -> tuple[str | None, tuple[str, ...]]:
    if topics.truth is not None:
        return topics.truth, (f"The truth is {topics.truth}.",)
    poses = [topic for topic, kind in types.items() if kind in POSES]
    true = [topic for topic in poses if any(word in topic.lower() for word in TRUE_WORDS)]
    if len(true) == 1:
        return true[0], (f"The truth is {true[0]}, for it calls itself so.",)
    if len(poses) == 1:
        return poses[0], (f"The truth was taken to be {poses[0]}, the only topic with poses.",)
    if poses:
        return None, (f"No truth was read: name one of {', '.join(poses)}.",)
    return None, ()


def _require(types: Types, topic: str, allowed: tuple[str, ...], path: str) -> None:
    if topic not in types:
        raise InputError(f"no topic {topic!r} in {path}; its topics: {_listed(types)}")
    if types[topic] not in allowed:
        raise InputError(f"{topic} should be {' or '.join(allowed)}, but is {types[topic]} in {path}")


def _listed(types: Types) -> str:
    return ", ".join(f"{topic} ({kind})" for topic, kind in sorted(types.items())) or "none"


OUR_OWN = (DOUBLE_SPHERE, ALL_AROUND)  # lenses that ROS has no name for


Tree = Mapping[tuple[str, str], Array]  # frames that never move: T_parent_child by the names of both


def between(tree: Tree, a: str, b: str) -> Array | None:
    """T_a_b; None where nothing says so."""
    reached = {a: np.eye(4)}
    edge = [a]
    while edge and b not in reached:
        at = edge.pop(0)
        for (parent, child), T in tree.items():
            other, T_at_other = (child, T) if parent == at else (parent, se3.inverse(T))
            if at in (parent, child) and other not in reached:
                reached[other] = reached[at] @ T_at_other
                edge.append(other)
    return reached.get(b)


def tree_of(messages: list[Any], path: str) -> Tree:
    """The transforms of TFMessages. Raises InputError for one that is no rigid transform."""
    links = {}
    for stamped in (stamped for message in messages for stamped in message.transforms):
        parent = plain(stamped.header.frame_id)
        child = plain(stamped.child_frame_id)
        fields = np.array(ros.pose_fields(stamped.transform), float)
        norm = float(np.linalg.norm(fields[3:])) if np.isfinite(fields).all() else 0.0
        if abs(norm - 1) > 1e-3:
            raise InputError(f"/tf_static: {parent} to {child} should be finite with a unit quaternion in {path}")
        fields[3:] /= norm
        links[parent, child] = ros.poses(fields)
    return links


def plain(frame: str) -> str:
    """A frame's name without the slash that ROS 1 once began it with."""
    return frame.lstrip("/")


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
        coefficients = m.d if hasattr(m, "d") else m.D  # ROS 2, or ROS 1
        d = [] if self.rectified else [float(value) for value in coefficients]
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
    """The rig of cameras, each with its frame's name, on `body`, None for the left camera. Raises InputError."""
    (left, left_frame), *others = eyes
    mount = between(tree, body, left_frame) if body else None
    T_body_left = np.eye(4) if mount is None else mount
    if mount is not None and left.rectified:  # the tree knows the camera, and not its rectified picture
        T_body_left = mount @ se3.transform(left.turn.T, np.zeros(3))
    if not others:
        return Rig(left.camera, None, T_body_left, None), ()
    right, right_frame = others[0]
    T_left_right = None if left.rectified or right.rectified else between(tree, left_frame, right_frame)
    notes: tuple[str, ...] = ()
    if T_left_right is None or left_frame == right_frame:
        T_left_right = by_projection(left, right)
        notes = (f"Where the right camera is was taken from R and P of {left.topic} and {right.topic}.",)
    return Rig(left.camera, right.camera, T_body_left, T_body_left @ T_left_right), notes
