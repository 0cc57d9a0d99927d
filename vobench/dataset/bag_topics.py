"""Which topics of a bag are the two eyes, their calibration, the IMU and the truth."""

from collections.abc import Mapping
from dataclasses import dataclass

from vobench.dataset.options import Topics
from vobench.errors import InputError
from vobench.sequence.pose_topic import POSES

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
INFO, IMU = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Imu"
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
    """The topics that are named, and for the others those that can be no others.

    Raises InputError, with the topics there are, where that leaves the pictures open.
    """
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
    """Topics that differ by what tells left from right alone."""
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
    """The topic of poses that is named, that calls itself true, or that is the only one."""
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
