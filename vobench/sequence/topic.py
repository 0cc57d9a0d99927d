"""The files of a sequence, and the coordinate frames, topics, attachments and notes in them."""

from dataclasses import dataclass

from vobench.geometry.rig import Rig

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
