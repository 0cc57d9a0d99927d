"""A sequence as exporters see it: all that is in its two files, the pictures one pair at a time."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vobench.dataset.views import Views
from vobench.errors import SequenceError
from vobench.geometry.rig import Rig, Side
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuBias, ImuReadings
from vobench.sequence import (
    Sequence,
    has_truth,
    read_case,
    read_imu_bias,
    read_true_rig,
    read_truth,
    read_twist,
    truth_channels,
)
from vobench.sequence.picture import decode, encode
from vobench.trajectory.trajectory import Stamps, Trajectory

PNG = "png"


@dataclass(frozen=True, slots=True)
class Source:
    """What there is to export; None for what was not recorded.

    `truth` is the path of the body, `twist` (N, 6) its velocities in its own axes, linear m/s and angular rad/s.
    """

    folder: Path
    sequence: Sequence
    true_rig: Rig
    truth: Trajectory | None = None
    twist: Array | None = None
    bias: ImuBias | None = None
    imu: ImuReadings | None = None
    channels: tuple[str, ...] = ()
    case: Mapping[str, Any] | None = None

    @property
    def rig(self) -> Rig:
        """The rig as estimators are told it; an IMU without a reading is none."""
        return self.sequence.rig if self.imu else replace(self.sequence.rig, imu=None)


@dataclass(frozen=True, slots=True)
class PngFrame:
    """The pictures of one instant as PNG files, by the side of their camera."""

    index: int
    t_ns: int
    pictures: dict[Side, bytes]


def open_source(folder: Path) -> Source:
    """Look into a sequence's two files. Raises SequenceError where they are not whole."""
    sequence = Sequence.open(folder)
    imu = sequence.imu()
    readings = imu if len(imu.t_ns) else None
    if not has_truth(folder):
        return Source(folder, sequence, sequence.rig, imu=readings)
    truth, bias = read_truth(folder), read_imu_bias(folder)
    return Source(
        folder,
        sequence,
        read_true_rig(folder),
        truth if len(truth) else None,
        read_twist(folder),
        bias if len(bias.t_ns) else None,
        readings,
        truth_channels(folder),
        _case(folder),
    )


def _case(folder: Path) -> Mapping[str, Any] | None:
    """The case of a simulated sequence; None for somebody's recording."""
    try:
        case = json.loads(read_case(folder))
    except SequenceError:
        return None
    return case if isinstance(case, dict) else None


def png_frames(sequence: Sequence, views: Views) -> Iterator[PngFrame]:
    """The pictures as a layout shows them; bytes that are PNG already pass as they are."""
    for frame in sequence.encoded_frames():
        found: dict[Side, bytes | None] = {"left": frame.left, "right": frame.right}
        shown = {side: _shown(sequence.rig, views, side, found[side], frame.form) for side in views.rig.sides}
        yield PngFrame(frame.index, frame.t_ns, shown)


def _shown(rig: Rig, views: Views, side: Side, encoded: bytes | None, form: str) -> bytes:
    if encoded is None:
        raise SequenceError(f"a frame has no {side} picture, and the rig says there is one")
    if views.source_px is None and form == PNG:
        return bytes(encoded)
    picture = views.show(side, decode(encoded, rig.camera(side), f"a {side} picture"))
    return encode(picture, views.rig.camera(side), side)


def rate_hz(t_ns: Stamps) -> float:
    """How often something was recorded, on average; 0 for a single time."""
    span_ns = int(t_ns[-1]) - int(t_ns[0]) if len(t_ns) > 1 else 0
    return (len(t_ns) - 1) * 1e9 / span_ns if span_ns else 0.0
