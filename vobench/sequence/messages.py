"""The files, topics and ROS 2 messages of a sequence, and the serialisation of messages as CDR."""

import struct
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import (
    BrownConrady,
    Camera,
    DoubleSphere,
    Equirectangular,
    KannalaBrandt,
    Pinhole,
    camera_matrix,
)
from vobench.geometry.rig import Rig, projection, rectification
from vobench.geometry.se3 import Array
from vobench.sequence.picture import CHANNELS, MONO, RGB
from vobench.trajectory.nanoseconds import NS_PER_S

WORLD = "map"
BODY = "base_link"
LEFT = "cam_left"
RIGHT = "cam_right"
IMU_FRAME = "imu"
SENSORS_FILE = "sensors.mcap"
TRUTH_FILE = "truth.mcap"
CASE_ATTACHMENT = "case.json"
NAMES_ATTACHMENT = "truth_names.json"
PROVENANCE_NOTE = "vobench.provenance"
IMPORT_NOTE = "vobench.import"
WHEELS_NOTE = "vobench.wheels"
IMU_NOTE = "vobench.imu"
END_OF_STAMPS_NS = 2**31 * NS_PER_S  # ROS counts seconds in 31 bits
UNKNOWN = -1.0  # the first element of the covariance of a quantity without an estimate; see sensor_msgs/Imu


@dataclass(frozen=True, slots=True)
class Topic:
    """The name and message type of a topic. A subscriber that joins late receives the messages of a latched topic."""

    name: str
    type_name: str
    latched: bool = False


TF_STATIC = Topic("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
LEFT_INFO = Topic(f"/{LEFT}/camera_info", "sensor_msgs/msg/CameraInfo")
RIGHT_INFO = Topic(f"/{RIGHT}/camera_info", "sensor_msgs/msg/CameraInfo")
LEFT_IMAGE = Topic(f"/{LEFT}/image/compressed", "sensor_msgs/msg/CompressedImage")
RIGHT_IMAGE = Topic(f"/{RIGHT}/image/compressed", "sensor_msgs/msg/CompressedImage")
EXPOSURE = Topic("/exposure", "vobench_msgs/msg/Exposure")
ENCODERS = Topic("/encoders", "vobench_msgs/msg/WheelTicks")
IMU = Topic("/imu", "sensor_msgs/msg/Imu")
TF = Topic("/tf", "tf2_msgs/msg/TFMessage")
ODOMETRY = Topic("/ground_truth/odometry", "nav_msgs/msg/Odometry")
IMU_BIAS = Topic("/ground_truth/imu_bias", "vobench_msgs/msg/ImuBias")
DISTURBANCE = Topic("/ground_truth/disturbance", "vobench_msgs/msg/Disturbance")

TRUE_LEFT_INFO = Topic(f"/ground_truth{LEFT_INFO.name}", LEFT_INFO.type_name, latched=True)
TRUE_RIGHT_INFO = Topic(f"/ground_truth{RIGHT_INFO.name}", RIGHT_INFO.type_name, latched=True)

INFO_TOPICS = (LEFT_INFO, RIGHT_INFO)
IMAGE_TOPICS = (LEFT_IMAGE, RIGHT_IMAGE)
TRUE_INFO_TOPICS = (TRUE_LEFT_INFO, TRUE_RIGHT_INFO)
SENSOR_TOPICS = (TF_STATIC, *INFO_TOPICS, *IMAGE_TOPICS, EXPOSURE, ENCODERS, IMU)
TRUTH_TOPICS = (TF_STATIC, TF, ODOMETRY)

# The names of camera models. ROS defines the first two, vobench the others.
PLUMB_BOB = "plumb_bob"
EQUIDISTANT = "equidistant"
DOUBLE_SPHERE = "double_sphere"
FOCAL_MODELS: dict[str, type[BrownConrady] | type[KannalaBrandt] | type[DoubleSphere]] = {
    PLUMB_BOB: BrownConrady,
    EQUIDISTANT: KannalaBrandt,
    DOUBLE_SPHERE: DoubleSphere,
}
ALL_AROUND = "equirectangular"


def model_name(camera: Camera) -> str:
    """The name of a camera's distortion model. A pinhole camera has PLUMB_BOB, with coefficients of 0."""
    if isinstance(camera, Equirectangular):
        return ALL_AROUND
    for name, model in FOCAL_MODELS.items():
        if isinstance(camera, model):
            return name
    return PLUMB_BOB


WHEEL_TICKS_DEFINITION = """\
# Counts of the two wheel encoders since the start of the recording. They increase when the robot drives forward.
std_msgs/Header header
int64 left
int64 right
"""

EXPOSURE_DEFINITION = """\
# Exposure time and gain of both pictures of a stereo pair. The stamp is the middle of the exposure.
std_msgs/Header header
float64 time_s
float64 gain_db
"""

IMU_BIAS_DEFINITION = """\
# Bias of the gyroscope (rad/s) and of the accelerometer (m/s^2) of an IMU, in the axes of the IMU.
std_msgs/Header header
geometry_msgs/Vector3 gyro
geometry_msgs/Vector3 accel
"""

DISTURBANCE_DEFINITION = """\
# Disturbances of a wheeled robot. The slip ratio of a wheel is 1 - ground speed / rim speed. side_slip_rad is the
# angle of the velocity to the left of the heading. The pushes are accelerations that the robot was not commanded.
std_msgs/Header header
float64 left_slip
float64 right_slip
float64 side_slip_rad
float64 push_mps2
float64 turn_push_radps2
"""

TYPES = get_typestore(Stores.ROS2_JAZZY)
for _definition, _topic in (
    (WHEEL_TICKS_DEFINITION, ENCODERS),
    (EXPOSURE_DEFINITION, EXPOSURE),
    (IMU_BIAS_DEFINITION, IMU_BIAS),
    (DISTURBANCE_DEFINITION, DISTURBANCE),
):
    TYPES.register(get_types_from_msg(_definition, _topic.type_name))


def sensor_topics(rig: Rig) -> tuple[Topic, ...]:
    """The topics that the sensor file of a recording with this rig can have."""
    camera_count = len(rig.sides)
    topics = [TF_STATIC, *INFO_TOPICS[:camera_count], *IMAGE_TOPICS[:camera_count], EXPOSURE]
    if rig.wheels:
        topics.append(ENCODERS)
    if rig.imu:
        topics.append(IMU)
    return tuple(topics)


def truth_topics(rig: Rig) -> tuple[Topic, ...]:
    """The topics that the truth file of a recording with this rig can have, except per-pixel ground truth."""
    camera_count = len(rig.sides)
    topics = [*TRUTH_TOPICS, *TRUE_INFO_TOPICS[:camera_count]]
    if rig.imu:
        topics.append(IMU_BIAS)
    if rig.wheels:
        topics.append(DISTURBANCE)
    return tuple(topics)


def _make(type_name: str, *fields: Any) -> Any:
    """A message of a type, with its fields in the order of the definition."""
    return TYPES.types[type_name](*fields)


def _quaternion(R: Array) -> Any:
    """The geometry_msgs/Quaternion of a rotation (3, 3)."""
    return _make("geometry_msgs/msg/Quaternion", *se3.to_quaternion(R).tolist())


def split_stamp(t_ns: int) -> tuple[int, int]:
    """A stamp as whole seconds and remaining nanoseconds, as in ROS.

    Raises SequenceError for a stamp before 1970 or after the end of ROS stamps in 2038.
    """
    if not 0 <= t_ns < END_OF_STAMPS_NS:
        raise SequenceError(f"a ROS stamp lies between 0 and {END_OF_STAMPS_NS - 1} ns (in 2038), got {t_ns} ns")
    return divmod(int(t_ns), NS_PER_S)


def header(t_ns: int, frame_id: str) -> Any:
    """A std_msgs/Header."""
    stamp = _make("builtin_interfaces/msg/Time", *split_stamp(t_ns))
    return _make("std_msgs/msg/Header", stamp, frame_id)


def transforms(
    t_ns: int,
    parent: str,
    T_parent_child: dict[str, Array],
) -> Any:
    """A tf2_msgs/TFMessage with the pose (4, 4) of each child frame in the frame `parent`."""
    stamped = []
    for child, T in T_parent_child.items():
        transform = _make("geometry_msgs/msg/Transform", vector(T[:3, 3]), _quaternion(T[:3, :3]))
        stamped.append(_make("geometry_msgs/msg/TransformStamped", header(t_ns, parent), child, transform))
    return _make(TF.type_name, stamped)


def camera_infos(t_ns: int, rig: Rig) -> tuple[Any, ...]:
    """The sensor_msgs/CameraInfo of each camera. For a pair that can be rectified, R and P rectify it."""
    if rig.right is None:
        return (camera_info(t_ns, LEFT, rig.left),)
    views = rectification(rig)
    if views is None:
        return camera_info(t_ns, LEFT, rig.left), camera_info(t_ns, RIGHT, rig.right)
    left = camera_info(t_ns, LEFT, rig.left, R=views.R_view_left, P=views.P_left)
    right = camera_info(t_ns, RIGHT, rig.right, R=views.R_view_right, P=views.P_right)
    return left, right


def camera_info(
    t_ns: int,
    frame_id: str,
    camera: Camera,
    *,
    R: Array | None = None,
    P: Array | None = None,
) -> Any:
    """A sensor_msgs/CameraInfo. R (3, 3) and P (3, 4) rectify a stereo pair; a single camera has none."""
    if R is None:
        R = np.eye(3)
    if P is None:
        P = projection(camera.K, 0.0)
    coefficients = np.zeros(5)
    if not isinstance(camera, Pinhole):
        coefficients = np.array([getattr(camera, name) for name in camera.coefficients])
    binning = 0  # means no binning
    region = _make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)  # means the full picture
    return _make(
        LEFT_INFO.type_name,
        header(t_ns, frame_id),
        camera.height_px,
        camera.width_px,
        model_name(camera),
        coefficients,
        _model_matrix(camera).ravel(),
        R.ravel(),
        P.ravel(),
        binning,
        binning,
        region,
    )


def _model_matrix(camera: Camera) -> Array:
    """The matrix (3, 3) of the focal lengths and principal point that are parameters of the camera model.

    For a double sphere it differs from `camera.K`, which has the focal lengths at the optical axis.
    """
    if isinstance(camera, DoubleSphere):
        return camera_matrix(camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px)
    return camera.K


def image(
    t_ns: int,
    frame_id: str,
    encoded: bytes,
    form: str,
    colour: str = MONO,
) -> Any:
    """A sensor_msgs/CompressedImage with a picture that is `encoded` as `form`, which is png or jpeg.

    The `format` field of a grey picture is `form`. For other pictures it follows ROS's compressed_image_transport, as
    in "rgb8; png compressed bgr8".
    """
    format_name = form
    if colour != MONO:
        compressed_as = "bgr8" if colour == RGB else MONO
        format_name = f"{colour}; {form} compressed {compressed_as}"
    return message(LEFT_IMAGE, t_ns, frame_id, format_name, np.frombuffer(encoded, np.uint8))


def message(
    topic: Topic,
    t_ns: int,
    frame_id: str,
    *fields: Any,
) -> Any:
    """A message of the topic's type that consists of a header and `fields`."""
    return _make(topic.type_name, header(t_ns, frame_id), *fields)


def vector(xyz: ArrayLike) -> Any:
    """The geometry_msgs/Vector3 of a vector (3,)."""
    return _make("geometry_msgs/msg/Vector3", *np.asarray(xyz, float).tolist())


def imu(
    t_ns: int,
    gyro_radps: ArrayLike,
    accel_mps2: ArrayLike,
    variances: tuple[float, float],
) -> Any:
    """A sensor_msgs/Imu with the angular velocity (3,) and the acceleration (3,) of one reading.

    `variances` are the variance of the gyroscope and that of the accelerometer, per axis; 0 if they are unknown.
    """
    orientation = _make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    gyro_variance, accel_variance = variances
    gyro_covariance = np.eye(3).ravel() * gyro_variance
    accel_covariance = np.eye(3).ravel() * accel_variance
    return message(
        IMU,
        t_ns,
        IMU_FRAME,
        orientation,
        _unknown_covariance(9),
        vector(gyro_radps),
        gyro_covariance,
        vector(accel_mps2),
        accel_covariance,
    )


def _unknown_covariance(size: int) -> Array:
    """The covariance (size,) of a quantity that the message does not estimate."""
    covariance = np.zeros(size)
    covariance[0] = UNKNOWN
    return covariance


def odometry(
    t_ns: int,
    T_world_body: Array,
    twist_body: ArrayLike | None,
) -> Any:
    """A nav_msgs/Odometry with the pose (4, 4) of the body in the world.

    `twist_body` (6,) is the linear velocity (m/s) and the angular velocity (rad/s) in the body's axes, None if unknown.
    """
    position = _make("geometry_msgs/msg/Point", *T_world_body[:3, 3].tolist())
    pose = _make("geometry_msgs/msg/Pose", position, _quaternion(T_world_body[:3, :3]))
    exact_covariance = np.zeros(36)
    linear_mps = np.zeros(3)
    angular_radps = np.zeros(3)
    twist_covariance = _unknown_covariance(36)
    if twist_body is not None:
        linear_mps, angular_radps = np.asarray(twist_body, float).reshape(2, 3)
        twist_covariance = exact_covariance
    twist = _make("geometry_msgs/msg/Twist", vector(linear_mps), vector(angular_radps))
    return _make(
        ODOMETRY.type_name,
        header(t_ns, WORLD),
        BODY,
        _make("geometry_msgs/msg/PoseWithCovariance", pose, exact_covariance),
        _make("geometry_msgs/msg/TwistWithCovariance", twist, twist_covariance),
    )


def stamp_ns(message: Any) -> int:
    """The stamp in a message's header."""
    stamp = message.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def pose_fields(message: Any) -> tuple[float, ...]:
    """The translation and quaternion (x, y, z, qx, qy, qz, qw) of a Transform or Pose message."""
    t = message.translation if hasattr(message, "translation") else message.position
    q = message.rotation if hasattr(message, "rotation") else message.orientation
    translation = (t.x, t.y, t.z)
    quaternion = (q.x, q.y, q.z, q.w)
    return translation + quaternion


def poses(fields: ArrayLike) -> Array:
    """Transforms (..., 4, 4) from values (..., 7) of `pose_fields`."""
    values = np.asarray(fields, float)
    return se3.transform(se3.from_quaternion(values[..., 3:]), values[..., :3])


def camera(message: Any) -> Camera:
    """The camera that a CameraInfo message describes.

    Raises SequenceError for an unknown distortion model, or a wrong number of coefficients.
    """
    size_px = (int(message.width), int(message.height))
    coefficients = [float(value) for value in message.d]
    name = message.distortion_model
    if name == ALL_AROUND:
        return Equirectangular(*size_px)
    fx_px, _, cx_px, _, fy_px, cy_px = message.k[:6].tolist()
    if name == PLUMB_BOB and not any(coefficients):
        return Pinhole(*size_px, fx_px, fy_px, cx_px, cy_px)
    model = FOCAL_MODELS.get(name)
    if model is None or len(coefficients) != len(model.coefficients):
        models = [f"{key} ({len(kind.coefficients)})" for key, kind in FOCAL_MODELS.items()]
        known = ", ".join(models)
        raise SequenceError(
            f"camera {message.header.frame_id} has the distortion model '{name}' with {len(coefficients)} "
            f"coefficients. Known: {known}, {ALL_AROUND} (0)"
        )
    return model(*size_px, fx_px, fy_px, cx_px, cy_px, *coefficients)


# A serialised message starts with four bytes for its byte order. If it has a header, the stamp follows.
STAMP = struct.Struct("<iI")
STAMP_BEGIN = 4
STAMP_END = STAMP_BEGIN + STAMP.size
LENGTH = struct.Struct("<I")
LITTLE_ENDIAN = b"\x00\x01"


def serialise(message: Any) -> bytes:
    """A message as CDR bytes, in little-endian order."""
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__, little_endian=True))


def with_stamp(template: bytes, t_ns: int) -> bytes:
    """A copy of the serialised message `template` with another stamp. The message must begin with a header."""
    stamp = STAMP.pack(*split_stamp(t_ns))
    return b"".join((template[:STAMP_BEGIN], stamp, template[STAMP_END:]))


def with_picture(template: bytes, t_ns: int, encoded: bytes) -> bytes:
    """A copy of the serialised CompressedImage `template` with another stamp, and with a picture.

    The template must have an empty picture, which is the last field of the message.
    """
    stamp = STAMP.pack(*split_stamp(t_ns))
    frame_and_format = template[STAMP_END : -LENGTH.size]
    length = LENGTH.pack(len(encoded))
    return b"".join((template[:STAMP_BEGIN], stamp, frame_and_format, length, encoded))


class StampedPicture(NamedTuple):
    """The content of a serialised CompressedImage."""

    t_ns: int
    form: str
    colour: str
    encoded: memoryview


def picture_in(data: memoryview) -> StampedPicture:
    """The content of a serialised CompressedImage. Raises ValueError if the data has another form."""
    if data[: len(LITTLE_ENDIAN)] != LITTLE_ENDIAN:
        raise ValueError("a picture's message is not in little-endian CDR")
    sec, nanosec = STAMP.unpack_from(data, STAMP_BEGIN)
    _, offset = _read_string(data, STAMP_END)  # the name of the frame
    format_name, offset = _read_string(data, offset)

    colour, _, codec = format_name.rpartition("; ")
    colour = colour or MONO
    form = codec.partition(" ")[0]
    if colour not in CHANNELS:
        raise ValueError(f"a picture has the unknown format {format_name!r}")
    begin, end = _sequence_bounds(data, offset)
    return StampedPicture(sec * NS_PER_S + nanosec, form, colour, data[begin:end])


def _read_string(data: memoryview, offset: int) -> tuple[str, int]:
    """The string at an offset, and the offset after the zero byte that ends it."""
    begin, end = _sequence_bounds(data, offset)
    text_end = max(begin, end - 1)
    return bytes(data[begin:text_end]).decode(), end


def _sequence_bounds(data: memoryview, offset: int) -> tuple[int, int]:
    """The offsets of the begin and end of a sequence of bytes.

    Its length is stored before it, at the first multiple of four that is not less than `offset`.
    Raises ValueError if the data ends before the sequence.
    """
    length_offset = offset + -offset % LENGTH.size
    (length,) = LENGTH.unpack_from(data, length_offset)
    begin = length_offset + LENGTH.size
    end: int = begin + length
    if end > len(data):
        raise ValueError(f"a message of {len(data)} bytes states {length} more at {length_offset}")
    return begin, end
