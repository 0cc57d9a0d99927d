"""Logs per-pixel ground truth to a Rerun recording, as one entity per camera and channel."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from vobench.report.entity import truth_entity
from vobench.report.rerun_stream import time_columns
from vobench.sensor.pixel_truth import CHANNELS, TruthNames, picture
from vobench.sequence import StereoTruth

TRANSPARENT = (0, 0, 0, 0)
TRANSLUCENT_WHITE = (255, 255, 255, 160)
MASKS = [name for name, channel in CHANNELS.items() if channel.dtype is np.bool_]


class ValueNames(NamedTuple):
    """The names of the values 0 and 1 of a channel. Rerun chooses the colours of larger values itself."""

    zero: str
    one: str


# A mask has the value 1 in the pixels that it is named for. The shadow channel counts hidden lights.
VALUE_NAMES = {mask: ValueNames("", mask) for mask in MASKS}
VALUE_NAMES["shadow"] = ValueNames("lit", "one light hidden")


@dataclass(frozen=True, slots=True)
class TruthView:
    """The per-pixel ground truth of a sequence.

    `channels` lists the recorded channels, such as depth; a single frame may lack some of them.
    `names` are the names of the instance and material ids.
    `frames` returns an iterator over all frames.
    """

    channels: tuple[str, ...]
    names: TruthNames
    frames: Callable[[], Iterable[StereoTruth]]


def log_truth(stream: rr.RecordingStream, view: TruthView) -> None:
    """Log all channels of both cameras, and the names of their classes. Only one frame is in memory at a time."""
    _log_classes(stream, view)
    for frame in view.frames():
        _log_frame(stream, frame)


def _log_classes(stream: rr.RecordingStream, view: TruthView) -> None:
    """Log the names and colours of the classes of each recorded channel, which hold for all frames."""
    for side in ("left", "right"):
        for channel in view.channels:
            classes = _classes(channel, view.names)
            if classes:
                stream.log(truth_entity(side, channel), rr.AnnotationContext(classes), static=True)


def _log_frame(stream: rr.RecordingStream, frame: StereoTruth) -> None:
    """Log the channels of one frame."""
    times = time_columns(np.array([frame.index]), np.array([frame.t_ns]))
    for side, truth in (("left", frame.left), ("right", frame.right)):
        if truth is None:
            continue
        for channel, values in truth.channels().items():
            stream.send_columns(truth_entity(side, channel), times, _columns(channel, values))


def _columns(channel: str, values: NDArray[np.generic]) -> Any:
    """The columns of one frame of a channel, given its values (H, W) or (H, W, C).

    Depth is logged as a depth image; ids, counts and masks as classes; and directions as colours.
    """
    if channel == "depth":
        depth_format = _format(values, rr.ChannelDatatype.F32)
        return rr.DepthImage.columns(buffer=[_bytes(values)], format=[depth_format], meter=[1.0])
    if values.ndim == 2:  # one value per pixel: an id, a count or a mask
        classes = values.astype(np.uint16)
        class_format = _format(classes, rr.ChannelDatatype.U16)
        return rr.SegmentationImage.columns(buffer=[_bytes(classes)], format=[class_format])
    colours = picture(channel, values)
    colour_format = _format(colours, rr.ChannelDatatype.U8, rr.ColorModel.RGB)
    return rr.Image.columns(buffer=[_bytes(colours)], format=[colour_format])


def _format(
    values: NDArray[np.generic],
    datatype: rr.ChannelDatatype,
    colour_model: rr.ColorModel | None = None,
) -> rr.components.ImageFormat:
    """The size and the type of the pixels of an image (H, W) or (H, W, 3)."""
    height_px, width_px = values.shape[:2]
    return rr.components.ImageFormat(width_px, height_px, color_model=colour_model, channel_datatype=datatype)


def _bytes(values: NDArray[np.generic]) -> NDArray[np.uint8]:
    """The bytes of an image, row by row, as Rerun's buffers need them."""
    return np.ascontiguousarray(values).reshape(-1).view(np.uint8)


def _classes(channel: str, names: TruthNames) -> list[rr.AnnotationInfo]:
    """The name and the colour of each class of a channel; empty for a channel without classes."""
    id_names = {"instance": names.instance, "material": names.material}
    if channel in id_names:
        return _named_ids(channel, id_names[channel])
    if channel in VALUE_NAMES:
        names_of_values = VALUE_NAMES[channel]
        return [
            rr.AnnotationInfo(0, names_of_values.zero, TRANSPARENT),
            rr.AnnotationInfo(1, names_of_values.one, TRANSLUCENT_WHITE),
        ]
    return []


def _named_ids(channel: str, names: tuple[str, ...]) -> list[rr.AnnotationInfo]:
    """The name of each id, and its colour in pictures of the channel."""
    ids = np.arange(len(names), dtype=np.uint16)
    one_row = ids[None]  # (1, N), a picture with one pixel for each id
    colours = picture(channel, one_row)[0].tolist()
    return [rr.AnnotationInfo(index, names[index], tuple(colour)) for index, colour in enumerate(colours)]
