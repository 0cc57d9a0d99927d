"""Creates the ROS 2 messages of a sequence, and reads their stamps and poses."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.sequence.message_type import new_message
from vobench.sequence.picture import MONO, RGB
from vobench.sequence.topic import BODY, IMU, IMU_FRAME, LEFT_IMAGE, ODOMETRY, TF, WORLD, Topic
from vobench.trajectory.nanoseconds import NS_PER_S

END_OF_STAMPS_NS = 2**31 * NS_PER_S  # ROS counts seconds in 31 bits
# The covariances of a message that are not plain variances:
#
#   of a quantity that is ...    first element    other elements
#   known without errors         0                0
#   not estimated                NOT_ESTIMATED    0
#
# The second row is the rule of sensor_msgs/Imu.
NOT_ESTIMATED = -1.0
ROTATION_ELEMENTS = 9  # of the covariance (3, 3) of a rotation
POSE_ELEMENTS = 36  # of the covariance (6, 6) of a pose or a twist


def split_stamp(t_ns: int) -> tuple[int, int]:
    """A stamp as whole seconds and remaining nanoseconds, as in ROS.

    Raises SequenceError for a stamp before 1970 or after the end of ROS stamps in 2038.
    """
    if not 0 <= t_ns < END_OF_STAMPS_NS:
        raise SequenceError(f"a ROS stamp lies between 0 and {END_OF_STAMPS_NS - 1} ns (in 2038), got {t_ns} ns")
    return divmod(int(t_ns), NS_PER_S)


def header_message(t_ns: int, frame_id: str) -> Any:
    """A std_msgs/Header."""
    sec, nanosec = split_stamp(t_ns)
    stamp = new_message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return new_message("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def stamped_message(topic: Topic, t_ns: int, frame_id: str, **fields: Any) -> Any:
    """A message of the topic's type with a header, and the other fields of the type by name."""
    return new_message(topic.type_name, header=header_message(t_ns, frame_id), **fields)


def vector_message(xyz: ArrayLike) -> Any:
    """The geometry_msgs/Vector3 of a vector (3,)."""
    x, y, z = np.asarray(xyz, float).tolist()
    return new_message("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def _quaternion_message(R: Array) -> Any:
    """The geometry_msgs/Quaternion of a rotation (3, 3)."""
    x, y, z, w = se3.to_quaternion(R).tolist()
    return new_message("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def tf_message(t_ns: int, parent: str, T_parent_child: dict[str, Array]) -> Any:
    """A tf2_msgs/TFMessage with the pose (4, 4) of each child frame in the frame `parent`."""
    stamped = []
    for child, T in T_parent_child.items():
        transform = new_message(
            "geometry_msgs/msg/Transform",
            translation=vector_message(T[:3, 3]),
            rotation=_quaternion_message(T[:3, :3]),
        )
        stamped.append(
            new_message(
                "geometry_msgs/msg/TransformStamped",
                header=header_message(t_ns, parent),
                child_frame_id=child,
                transform=transform,
            )
        )
    return new_message(TF.type_name, transforms=stamped)


def image_message(
    t_ns: int,
    frame_id: str,
    encoded: bytes,
    *,
    codec: str,
    colour: str = MONO,
) -> Any:
    """A sensor_msgs/CompressedImage with a picture that is `encoded` as `codec`, which is png or jpeg.

    The `format` field of a grey picture is `codec`. For other pictures it follows ROS's compressed_image_transport, as
    in "rgb8; png compressed bgr8".
    """
    format_name = codec
    if colour != MONO:
        compressed_as = "bgr8" if colour == RGB else MONO
        format_name = f"{colour}; {codec} compressed {compressed_as}"
    data = np.frombuffer(encoded, np.uint8)
    # All image topics have the same type.
    return stamped_message(LEFT_IMAGE, t_ns, frame_id, format=format_name, data=data)


def imu_message(
    t_ns: int,
    gyro_radps: ArrayLike,
    accel_mps2: ArrayLike,
    *,
    gyro_variance: float = 0.0,
    accel_variance: float = 0.0,
) -> Any:
    """A sensor_msgs/Imu with the angular velocity (3,) and the acceleration (3,) of one reading.

    The variances are those of one axis in (rad/s)² and (m/s²)²; 0 means that they are unknown.
    """
    no_rotation = new_message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    return stamped_message(
        IMU,
        t_ns,
        IMU_FRAME,
        orientation=no_rotation,
        orientation_covariance=_not_estimated(ROTATION_ELEMENTS),
        angular_velocity=vector_message(gyro_radps),
        angular_velocity_covariance=np.eye(3).ravel() * gyro_variance,
        linear_acceleration=vector_message(accel_mps2),
        linear_acceleration_covariance=np.eye(3).ravel() * accel_variance,
    )


def _not_estimated(element_count: int) -> Array:
    """The covariance (element_count,) of a quantity that the message does not estimate."""
    covariance = np.zeros(element_count)
    covariance[0] = NOT_ESTIMATED
    return covariance


def odometry_message(
    t_ns: int,
    T_world_body: Array,
    twist_body: ArrayLike | None,
) -> Any:
    """A nav_msgs/Odometry with the exact pose (4, 4) of the body in the world.

    `twist_body` (6,) is the linear velocity (m/s) and the angular velocity (rad/s) in the body's axes, None if unknown.
    """
    return stamped_message(
        ODOMETRY,
        t_ns,
        WORLD,
        child_frame_id=BODY,
        pose=_exact_pose_message(T_world_body),
        twist=_twist_message(twist_body),
    )


def _exact_pose_message(T_world_body: Array) -> Any:
    """The geometry_msgs/PoseWithCovariance of a pose (4, 4) without errors."""
    x, y, z = T_world_body[:3, 3].tolist()
    position = new_message("geometry_msgs/msg/Point", x=x, y=y, z=z)
    pose = new_message(
        "geometry_msgs/msg/Pose",
        position=position,
        orientation=_quaternion_message(T_world_body[:3, :3]),
    )
    return new_message("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(POSE_ELEMENTS))


def _twist_message(twist_body: ArrayLike | None) -> Any:
    """The geometry_msgs/TwistWithCovariance of an exact or unknown twist."""
    linear_mps = np.zeros(3)
    angular_radps = np.zeros(3)
    covariance = _not_estimated(POSE_ELEMENTS)
    if twist_body is not None:
        linear_mps, angular_radps = np.asarray(twist_body, float).reshape(2, 3)
        covariance = np.zeros(POSE_ELEMENTS)
    twist = new_message(
        "geometry_msgs/msg/Twist",
        linear=vector_message(linear_mps),
        angular=vector_message(angular_radps),
    )
    return new_message("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=covariance)


def stamp_ns(message: Any) -> int:
    """The stamp in a message's header."""
    stamp = message.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


class PoseFields(NamedTuple):
    """The translation and the quaternion of a pose message."""

    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float


def pose_fields(message: Any) -> PoseFields:
    """The fields of a geometry_msgs/Transform or geometry_msgs/Pose."""
    is_transform = hasattr(message, "translation")
    t = message.translation if is_transform else message.position
    q = message.rotation if is_transform else message.orientation
    return PoseFields(t.x, t.y, t.z, q.x, q.y, q.z, q.w)


def poses_from_fields(fields: ArrayLike) -> Array:
    """Transforms (..., 4, 4) from rows (..., 7) in the order of PoseFields."""
    values = np.asarray(fields, float)
    positions_m = values[..., :3]
    quaternions = values[..., 3:]
    return se3.transform(se3.from_quaternion(quaternions), positions_m)
