"""Per-pixel ground truth as ROS pictures: one topic for each camera and channel, raw and thus lossless."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import SequenceError
from vobench.geometry.camera import Camera
from vobench.geometry.rig import SIDES, Side
from vobench.sensor.pixel_truth import CHANNELS, Channel, TruthFrame, TruthNames
from vobench.sequence.message import header_message
from vobench.sequence.message_type import new_message
from vobench.sequence.topic import LEFT, RIGHT, Topic

FRAME_IDS: dict[Side, str] = {"left": LEFT, "right": RIGHT}

IMAGE = "sensor_msgs/msg/Image"
MASK_IS_SET = 255  # what viewers show as white


def truth_topic(side: Side, channel: str) -> Topic:
    """The topic of one camera's channel."""
    return Topic(f"/ground_truth/{FRAME_IDS[side]}/{channel}", IMAGE)


def pixel_truth_topics(channels: Iterable[str] = tuple(CHANNELS), sides: Iterable[Side] = SIDES) -> tuple[Topic, ...]:
    """The topics of channels of cameras, those of the left camera first."""
    channels = tuple(channels)
    return tuple(truth_topic(side, channel) for side in sides for channel in channels)


def truth_image(
    t_ns: int,
    side: Side,
    channel: str,
    values: NDArray[np.generic],
) -> Any:
    """A sensor_msgs/Image of a channel's values (H, W) or (H, W, n); masks as 0 and 255."""
    height, width = values.shape[:2]
    is_mask = values.dtype == np.bool_
    pixels = values.astype(np.uint8) * np.uint8(MASK_IS_SET) if is_mask else values
    data = np.ascontiguousarray(pixels).reshape(-1).view(np.uint8)
    encoding = _encoding(CHANNELS[channel])
    return new_message(
        IMAGE,
        header=header_message(t_ns, FRAME_IDS[side]),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=data.size // height,
        data=data,
    )


def truth_values(channel: str, message: Any) -> NDArray[np.generic]:
    """A channel's values as they were written. Raises SequenceError where the picture is of another kind."""
    kind = CHANNELS[channel]
    stored_type = np.uint8 if kind.dtype is np.bool_ else kind.dtype
    stored = np.dtype(stored_type).newbyteorder("<")
    shape = kind.shape(message.height, message.width)
    expected_bytes = np.prod(shape) * stored.itemsize
    if message.encoding != _encoding(kind) or message.data.size != expected_bytes:
        raise SequenceError(
            f"truth channel {channel} should be {_encoding(kind)}, got {message.data.size} bytes of "
            f"{message.height} × {message.width} {message.encoding}"
        )
    pixels = message.data.view(stored).reshape(shape)
    values: NDArray[np.generic] = pixels.astype(kind.dtype)
    return values


def check_truth(
    frame: TruthFrame,
    channels: tuple[str, ...],
    camera: Camera,
    side: Side,
) -> None:
    """Raise SequenceError unless the frame has exactly these channels, in the camera's size and their own types."""
    actual = {}
    for name, values in frame.channels().items():
        actual[name] = (values.shape, values.dtype.name)
    expected = {}
    for name in channels:
        kind = CHANNELS[name]
        shape = kind.shape(camera.height_px, camera.width_px)
        expected[name] = (shape, np.dtype(kind.dtype).name)
    for name in (*expected, *actual):
        if actual.get(name) != expected.get(name):
            what = f"truth channel {name} of the {side} camera"
            raise SequenceError(f"{what} should be {expected.get(name)}, got {actual.get(name)}")


def names_to_json(names: TruthNames) -> bytes:
    """The file with the names that is attached to the truth."""
    return json.dumps(asdict(names), ensure_ascii=False, indent=1).encode()


def names_from_json(data: bytes) -> TruthNames:
    """The names of an attached file. Raises SequenceError where it is something else."""
    try:
        entries = json.loads(data)
        instances = tuple(map(str, entries["instance"]))
        materials = tuple(map(str, entries["material"]))
        return TruthNames(instances, materials)
    except (ValueError, KeyError, TypeError) as error:
        raise SequenceError(
            f"the names of the truth's ids are not lists of instances and materials: {error!r}"
        ) from error


def _encoding(channel: Channel) -> str:
    if channel.dtype is np.bool_:
        return "mono8"
    number = "32F" if channel.dtype is np.float32 else "16U"
    return f"{number}C{channel.depth}"
