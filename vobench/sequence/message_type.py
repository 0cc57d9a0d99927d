"""The ROS 2 message types of a sequence: those of ROS 2 Jazzy, and four of vobench's own."""

from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from vobench.sequence.topic import DISTURBANCE, ENCODERS, EXPOSURE, IMU_BIAS

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


def _known_types() -> Typestore:
    """The types of ROS 2 Jazzy and of vobench."""
    types = get_typestore(Stores.ROS2_JAZZY)
    definition_by_topic = {
        ENCODERS: WHEEL_TICKS_DEFINITION,
        EXPOSURE: EXPOSURE_DEFINITION,
        IMU_BIAS: IMU_BIAS_DEFINITION,
        DISTURBANCE: DISTURBANCE_DEFINITION,
    }
    for topic, definition in definition_by_topic.items():
        types.register(get_types_from_msg(definition, topic.type_name))
    return types


TYPES = _known_types()  # created on import: every reader and writer of a sequence needs it


def new_message(type_name: str, **fields: Any) -> Any:
    """A message of a type, with all fields of its definition by name."""
    create: Any = TYPES.types[type_name]
    return create(**fields)
