"""ROS 2 messages: the topics of a sequence, and geometry to and from their fields."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array

WORLD, BODY, LEFT, RIGHT = "map", "base_link", "cam_left", "cam_right"
NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic's name and message type; a latched one is replayed to late listeners."""

    name: str
    type_name: str
    latched: bool = False


TF_STATIC = Topic("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
LEFT_INFO = Topic(f"/{LEFT}/camera_info", "sensor_msgs/msg/CameraInfo")
RIGHT_INFO = Topic(f"/{RIGHT}/camera_info", "sensor_msgs/msg/CameraInfo")
LEFT_IMAGE = Topic(f"/{LEFT}/image/compressed", "sensor_msgs/msg/CompressedImage")
RIGHT_IMAGE = Topic(f"/{RIGHT}/image/compressed", "sensor_msgs/msg/CompressedImage")
ENCODERS = Topic("/encoders", "vobench_msgs/msg/WheelTicks")
TF = Topic("/tf", "tf2_msgs/msg/TFMessage")
ODOMETRY = Topic("/ground_truth/odometry", "nav_msgs/msg/Odometry")

SENSOR_TOPICS = (TF_STATIC, LEFT_INFO, RIGHT_INFO, LEFT_IMAGE, RIGHT_IMAGE, ENCODERS)
TRUTH_TOPICS = (TF_STATIC, TF, ODOMETRY)

WHEEL_TICKS_DEFINITION = """\
# Counts of the two wheel encoders since the start of the recording, positive when the robot drives ahead.
std_msgs/Header header
int64 left
int64 right
"""

TYPES = get_typestore(Stores.ROS2_JAZZY)
TYPES.register(get_types_from_msg(WHEEL_TICKS_DEFINITION, ENCODERS.type_name))


def _make(type_name: str, *fields: Any) -> Any:
    return TYPES.types[type_name](*fields)


def _vector(xyz: ArrayLike) -> Any:
    return _make("geometry_msgs/msg/Vector3", *np.asarray(xyz, float).tolist())


def _quaternion(R: Array) -> Any:
    return _make("geometry_msgs/msg/Quaternion", *se3.to_quaternion(R).tolist())


def header(t_ns: int, frame_id: str) -> Any:
    """A std_msgs/Header; ROS splits a stamp into seconds and nanoseconds."""
    stamp = _make("builtin_interfaces/msg/Time", *divmod(int(t_ns), NS_PER_S))
    return _make("std_msgs/msg/Header", stamp, frame_id)


def transforms(t_ns: int, parent: str, T_parent_child: dict[str, Array]) -> Any:
    """A tf2_msgs/TFMessage that hangs each child frame on `parent`."""
    stamped = [
        _make(
            "geometry_msgs/msg/TransformStamped",
            header(t_ns, parent),
            child,
            _make("geometry_msgs/msg/Transform", _vector(T[:3, 3]), _quaternion(T[:3, :3])),
        )
        for child, T in T_parent_child.items()
    ]
    return _make(TF.type_name, stamped)


def mounts(rig: Rig) -> Any:
    """Where the two cameras sit on the body, for /tf_static."""
    return transforms(0, BODY, {LEFT: rig.T_body_left, RIGHT: rig.T_body_right})


def camera_info(t_ns: int, frame_id: str, camera: Pinhole, *, shift_m: float = 0.0) -> Any:
    """A sensor_msgs/CameraInfo without distortion, of a camera `shift_m` to the right of its pair's left one."""
    projection = np.hstack([camera.K, [[-camera.fx_px * shift_m], [0.0], [0.0]]])
    region = _make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)  # all of the picture
    return _make(
        LEFT_INFO.type_name,
        header(t_ns, frame_id),
        camera.height_px,
        camera.width_px,
        "plumb_bob",
        np.zeros(5),
        camera.K.ravel(),
        np.eye(3).ravel(),
        projection.ravel(),
        0,
        0,
        region,
    )


def png_image(t_ns: int, frame_id: str, png: bytes) -> Any:
    """A sensor_msgs/CompressedImage that holds a PNG."""
    return _make(LEFT_IMAGE.type_name, header(t_ns, frame_id), "png", np.frombuffer(png, np.uint8))


def wheel_ticks(t_ns: int, left: int, right: int) -> Any:
    """One encoder reading as a vobench_msgs/WheelTicks."""
    return _make(ENCODERS.type_name, header(t_ns, BODY), int(left), int(right))


def odometry(t_ns: int, T_world_body: Array, twist_body: ArrayLike) -> Any:
    """A nav_msgs/Odometry: the body's pose in the world, its (6,) twist (m/s, rad/s) in its own axes."""
    unknown = np.zeros(36)  # ground truth states no covariance
    position = _make("geometry_msgs/msg/Point", *T_world_body[:3, 3].tolist())
    pose = _make("geometry_msgs/msg/Pose", position, _quaternion(T_world_body[:3, :3]))
    linear, angular = np.asarray(twist_body, float).reshape(2, 3)
    twist = _make("geometry_msgs/msg/Twist", _vector(linear), _vector(angular))
    return _make(
        ODOMETRY.type_name,
        header(t_ns, WORLD),
        BODY,
        _make("geometry_msgs/msg/PoseWithCovariance", pose, unknown),
        _make("geometry_msgs/msg/TwistWithCovariance", twist, unknown),
    )


def stamp_ns(message: Any) -> int:
    """The stamp in a message's header."""
    stamp = message.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def pose_fields(message: Any) -> tuple[float, ...]:
    """Translation and quaternion (x, y, z, qx, qy, qz, qw) of a Transform or a Pose."""
    t = message.translation if hasattr(message, "translation") else message.position
    q = message.rotation if hasattr(message, "rotation") else message.orientation
    return t.x, t.y, t.z, q.x, q.y, q.z, q.w


def poses(fields: ArrayLike) -> Array:
    """Transforms (..., 4, 4) from `pose_fields` (..., 7)."""
    values = np.asarray(fields, float)
    return se3.transform(se3.from_quaternion(values[..., 3:]), values[..., :3])


def pinhole(message: Any) -> Pinhole:
    """The camera of a CameraInfo. Raises SequenceError where its lens bends lines."""
    if np.any(message.d):
        raise SequenceError(
            f"camera {message.header.frame_id} has distortion {message.d.tolist()}, but should have none"
        )
    fx, _, cx, _, fy, cy = message.k[:6].tolist()
    return Pinhole(int(message.width), int(message.height), fx, fy, cx, cy)
