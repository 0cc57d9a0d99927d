"""What is true of every pixel, as pictures on the same time line as the run."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from vobench.sensor.truth import CHANNELS, TruthFrame, TruthNames
from vobench.sensor.truth_picture import picture
from vobench.sequence import StereoTruth
from vobench.viewer.blueprint import truth_entity
from vobench.viewer.timeline import time_columns

UNSET, SET = (0, 0, 0, 0), (255, 255, 255, 160)


@dataclass(frozen=True, slots=True)
class TruthView:
    """The channels that were recorded, what their ids mean, and a fresh pass over the frames."""

    channels: tuple[str, ...]
    names: TruthNames
    frames: Callable[[], Iterable[StereoTruth]]


def log_truth(stream: rr.RecordingStream, view: TruthView) -> None:
    """Log all channels of both cameras, one frame in memory at a time."""
    for side in ("left", "right"):
        for channel in view.channels:
            if classes := _classes(channel, view.names):
                stream.log(truth_entity(side, channel), rr.AnnotationContext(classes), static=True)
    for frame in view.frames():
        times = time_columns(np.array([frame.index]), np.array([frame.t_ns]))
        for side, truth in (("left", frame.left), ("right", frame.right)):
            _log_side(stream, times, side, truth)


def _log_side(stream: rr.RecordingStream, times: list[rr.TimeColumn], side: str, truth: TruthFrame | None) -> None:
    for channel, values in truth.channels().items() if truth else ():
        stream.send_columns(truth_entity(side, channel), times, _columns(channel, values))


def _columns(channel: str, values: NDArray[np.generic]) -> Any:
    """Depth as depth, ids, counts and masks as classes, directions as colours."""
    if channel == "depth":
        return rr.DepthImage.columns(buffer=[_bytes(values)], format=[_format(values, "F32")], meter=[1.0])
    if CHANNELS[channel].depth == 1:
        classes = values.astype(np.uint16)
        return rr.SegmentationImage.columns(buffer=[_bytes(classes)], format=[_format(classes, "U16")])
    colors = picture(channel, values)
    return rr.Image.columns(buffer=[_bytes(colors)], format=[_format(colors, "U8", rr.ColorModel.RGB)])


def _format(values: NDArray[np.generic], kind: str, colors: rr.ColorModel | None = None) -> rr.components.ImageFormat:
    height, width = values.shape[:2]
    datatype = getattr(rr.ChannelDatatype, kind)
    return rr.components.ImageFormat(width, height, color_model=colors, channel_datatype=datatype)


def _bytes(values: NDArray[np.generic]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(values).reshape(-1).view(np.uint8)


def _classes(channel: str, names: TruthNames) -> list[rr.AnnotationInfo]:
    """What an id, a count or a mask's value is called, and its colour; none for other channels."""
    if channel in {"instance", "material"}:
        table = names.instance if channel == "instance" else names.material
        colors = picture(channel, np.arange(len(table), dtype=np.uint16)[None])[0]
        return [rr.AnnotationInfo(i, name, tuple(colors[i].tolist())) for i, name in enumerate(table)]
    if CHANNELS[channel].dtype is np.bool_:
        return [rr.AnnotationInfo(0, "", UNSET), rr.AnnotationInfo(1, channel, SET)]
    if channel == "shadow":
        return [rr.AnnotationInfo(0, "lit", UNSET), rr.AnnotationInfo(1, "one light hidden", SET)]
    return []
