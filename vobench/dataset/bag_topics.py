"""Selects the topics of a bag with the left and right images, the IMU readings and the ground truth."""

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
OTHER_IMAGES = ("depth", "disparity", "theora", "confidence", "mask")
TRUTH_WORDS = ("ground_truth", "groundtruth", "gt", "truth", "vicon", "mocap", "optitrack", "vrpn")

Types = Mapping[str, str]  # message type by topic


@dataclass(frozen=True, slots=True)
class SelectedTopics:
    """The topics to read; None for what a bag does not contain.

    `truth` names a topic of poses, or a transform as `topic:parent.child`, such as `/tf:map.base_link`.
    """

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
        topic, _, _ = (self.truth or "").partition(":")
        return topic

    @property
    def truth_frames(self) -> str:
        """The frames `parent.child` of a truth that is a transform; empty if they are not given."""
        _, _, frames = (self.truth or "").partition(":")
        return frames


def choose(types: Types, topics: Topics, path: str) -> SelectedTopics:
    """The topics that are given, and for the others, the only topic of the bag that fits.

    Raises InputError for a given topic that the bag does not contain, and if no image topic fits, or several do.
    """
    left, right = _image_topics(types, topics, path)
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
    notes = (f"The images are those of {source}.", *truth_notes, *imu_notes)
    return SelectedTopics(left, right, left_info, right_info, imu, truth, notes)


def _image_topics(
    types: Types,
    topics: Topics,
    path: str,
) -> tuple[str, str | None]:
    """The left and the right image topic. The right one is None for a single camera."""
    for topic in (topics.left, topics.right):
        if topic is not None:
            _require(types, topic, (RAW, COMPRESSED), path)
    image_topics = [topic for topic, message_type in types.items() if message_type in (RAW, COMPRESSED)]
    if topics.left is not None:
        return topics.left, topics.right or _only_partner(topics.left, image_topics)
    pair = _only_pair(image_topics, topics.right)
    if pair is None:
        raise _undecided(types, image_topics, path)
    return pair


def _only_pair(image_topics: list[str], right_topic: str | None) -> tuple[str, str | None] | None:
    """The only pair of topics, with the given right topic if any, or the only camera; None if several fit."""
    pairs = _pairs(image_topics)
    if right_topic is not None:
        pairs = [pair for pair in pairs if pair[1] == right_topic]
    if len(pairs) == 1:
        return pairs[0]
    cameras = [topic for topic in image_topics if not _contains(topic, OTHER_IMAGES)]
    is_single_camera = not pairs and len(cameras) == 1 and right_topic is None
    return (cameras[0], None) if is_single_camera else None


def _undecided(types: Types, image_topics: list[str], path: str) -> InputError:
    """The error about topics that must be named."""
    if not image_topics:
        return InputError(f"no images (Image or CompressedImage) in {path}; its topics: {_listed(types)}")
    return InputError(f"name the left and the right topic of {path}; with images: {', '.join(image_topics)}")


def _only_partner(left_topic: str, image_topics: list[str]) -> str | None:
    """The right topic for a left topic; None unless exactly one fits."""
    partners = [right for left, right in _pairs(image_topics) if left == left_topic]
    return partners[0] if len(partners) == 1 else None


def _pairs(image_topics: list[str]) -> list[tuple[str, str]]:
    """The pairs of image topics whose names differ only in left and right, without duplicates."""
    pairs = []
    for topic in image_topics:
        if _contains(topic, OTHER_IMAGES):
            continue
        for left, right in SIDES:
            partner = topic.replace(left, right)
            if left in topic and partner in image_topics:
                pairs.append((topic, partner))
    return list(dict.fromkeys(pairs))


def _contains(topic: str, words: tuple[str, ...]) -> bool:
    return any(word in topic.lower() for word in words)


def _info_of(types: Types, image_topic: str) -> str | None:
    """The camera_info topic of an image topic: the first one found in its namespace, or a parent of that."""
    parts = image_topic.split("/")
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
