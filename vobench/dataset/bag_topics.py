"""Selects the topics of a bag with the left and right pictures, the IMU readings and the ground truth."""

from collections.abc import Mapping
from dataclasses import dataclass

from vobench.dataset.recording import Topics
from vobench.errors import InputError
from vobench.sequence.recording import POSES

RAW = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
INFO = "sensor_msgs/msg/CameraInfo"
IMU = "sensor_msgs/msg/Imu"
COUNTED_FROM_0 = ("cam", "camera", "image", "cam_", "camera_", "image_", "video", "fisheye")
COUNTED_FROM_1 = ("cam", "camera", "image", "cam_", "camera_", "infra", "fisheye")
# The parts of topic names that distinguish left from right.
SIDES = (
    ("left", "right"),
    *((f"{name}0", f"{name}1") for name in COUNTED_FROM_0),
    *((f"{name}1", f"{name}2") for name in COUNTED_FROM_1),
)
NO_PICTURES = ("depth", "disparity", "theora", "confidence", "mask")
TRUTH_WORDS = ("ground_truth", "groundtruth", "gt", "truth", "vicon", "mocap", "optitrack", "vrpn")

Types = Mapping[str, str]  # message type by topic


@dataclass(frozen=True, slots=True)
class Chosen:
    """The topics to read; None for what a bag does not contain."""

    left: str
    right: str | None
    left_info: str | None
    right_info: str | None
    imu: str | None
    truth: str | None
    notes: tuple[str, ...] = ()

    @property
    def sensors(self) -> list[str]:
        """The topics of the cameras, of their calibration, and of the IMU."""
        topics = (self.left, self.right, self.left_info, self.right_info, self.imu)
        return [topic for topic in topics if topic]

    @property
    def truth_topic(self) -> str:
        """The topic of the truth, without the frames of a transform; empty if there is none."""
        return (self.truth or "").partition(":")[0]

    @property
    def truth_frames(self) -> str:
        """The frames `parent.child` of a truth that is a transform; empty if they are not given."""
        return (self.truth or "").partition(":")[2]


def choose(types: Types, topics: Topics, path: str) -> Chosen:
    """The topics that are given, and for the others, the only topic of the bag that fits.

    Raises InputError for a given topic that the bag does not contain, and if no or several topics of pictures fit.
    """
    left, right = _picture_topics(types, topics, path)
    for topic, message_type in ((topics.left_info, INFO), (topics.right_info, INFO), (topics.imu, IMU)):
        if topic is not None:
            _require(types, topic, (message_type,), path)
    left_info = topics.left_info or _info_of(types, left)
    right_info = topics.right_info
    if right_info is None and right is not None:
        right_info = _info_of(types, right)

    source = f"{left} and {right}" if right else f"{left}, one camera"
    imu, imu_notes = _imu_topic(types, topics)
    truth, truth_notes = _truth_topic(types, topics)
    notes = (f"The pictures are those of {source}.", *truth_notes, *imu_notes)
    return Chosen(left, right, left_info, right_info, imu, truth, notes)


def _picture_topics(
    types: Types,
    topics: Topics,
    path: str,
) -> tuple[str, str | None]:
    """The topics of the left and the right pictures. The right one is None for a single camera."""
    for topic in (topics.left, topics.right):
        if topic is not None:
            _require(types, topic, (RAW, COMPRESSED), path)
    with_pictures = [topic for topic, message_type in types.items() if message_type in (RAW, COMPRESSED)]
    if topics.left is not None:
        return topics.left, topics.right or _only_partner(topics.left, with_pictures)
    chosen = _only_pair(with_pictures, topics.right)
    if chosen is None:
        raise _undecided(types, with_pictures, path)
    return chosen


def _only_pair(with_pictures: list[str], right_topic: str | None) -> tuple[str, str | None] | None:
    """The only pair of topics, with the given right topic if any, or the only camera; None if several fit."""
    pairs = _pairs(with_pictures)
    if right_topic is not None:
        pairs = [pair for pair in pairs if pair[1] == right_topic]
    if len(pairs) == 1:
        return pairs[0]
    cameras = [topic for topic in with_pictures if not _contains(topic, NO_PICTURES)]
    is_single_camera = not pairs and len(cameras) == 1 and right_topic is None
    return (cameras[0], None) if is_single_camera else None


def _undecided(types: Types, with_pictures: list[str], path: str) -> InputError:
    """The error about topics that must be named."""
    if not with_pictures:
        return InputError(f"no pictures (Image or CompressedImage) in {path}; its topics: {_listed(types)}")
    return InputError(f"name the left and the right topic of {path}; with pictures: {', '.join(with_pictures)}")


def _only_partner(left_topic: str, with_pictures: list[str]) -> str | None:
    """The right topic for a left topic; None unless exactly one fits."""
    partners = [right for left, right in _pairs(with_pictures) if left == left_topic]
    return partners[0] if len(partners) == 1 else None


def _pairs(with_pictures: list[str]) -> list[tuple[str, str]]:
    """The pairs of topics of pictures whose names differ only in left and right, without duplicates."""
    pairs = []
    for topic in with_pictures:
        if _contains(topic, NO_PICTURES):
            continue
        for left, right in SIDES:
            partner = topic.replace(left, right)
            if left in topic and partner in with_pictures:
                pairs.append((topic, partner))
    return list(dict.fromkeys(pairs))


def _contains(topic: str, words: tuple[str, ...]) -> bool:
    return any(word in topic.lower() for word in words)


def _info_of(types: Types, picture_topic: str) -> str | None:
    """The camera_info topic of a topic of pictures: the first one found in its namespace, or a parent of that."""
    parts = picture_topic.split("/")
    for end in range(len(parts), 0, -1):
        name = "/".join([*parts[:end], "camera_info"])
        if types.get(name) == INFO:
            return name
    return None


def _imu_topic(types: Types, topics: Topics) -> tuple[str | None, tuple[str, ...]]:
    if topics.imu is not None:
        return topics.imu, ()
    imus = [topic for topic, message_type in types.items() if message_type == IMU]
    if len(imus) > 1:
        return None, (f"No IMU was read: name one of {', '.join(imus)}.",)
    return (imus[0] if imus else None), ()


def _truth_topic(types: Types, topics: Topics) -> tuple[str | None, tuple[str, ...]]:
    if topics.truth is not None:
        return topics.truth, (f"The truth is {topics.truth}.",)
    with_poses = [topic for topic, message_type in types.items() if message_type in POSES]
    named_truth = [topic for topic in with_poses if _contains(topic, TRUTH_WORDS)]
    if len(named_truth) == 1:
        return named_truth[0], (f"The truth is {named_truth[0]}, chosen by its name.",)
    if len(with_poses) == 1:
        return with_poses[0], (f"The truth was assumed to be {with_poses[0]}, the only topic with poses.",)
    if with_poses:
        return None, (f"No truth was read: name one of {', '.join(with_poses)}.",)
    return None, ()


def _require(
    types: Types,
    topic: str,
    allowed: tuple[str, ...],
    path: str,
) -> None:
    """Raise InputError unless a topic exists and has one of the allowed message types."""
    if topic not in types:
        raise InputError(f"no topic {topic!r} in {path}; its topics: {_listed(types)}")
    if types[topic] not in allowed:
        raise InputError(f"{topic} should be {' or '.join(allowed)}, but is {types[topic]} in {path}")


def _listed(types: Types) -> str:
    topics = [f"{topic} ({message_type})" for topic, message_type in sorted(types.items())]
    return ", ".join(topics) or "none"
