"""A sequence as the writers of layouts see it: its rig, readings, and pictures as recorded or rectified."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.dataset.reproject import PIXEL_TOLERANCE, pixel_difference
from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.rectify import rectification
from vobench.geometry.rig import Rig, Side, side_by_side
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

Grey = NDArray[np.uint8]
FAR_PX = 30_000.0  # outside of any picture that OpenCV resamples, which takes NaN for any place


@dataclass(frozen=True, slots=True)
class Views:
    """The rig of some pictures, and where their pixels (H, W, 2) lie in the recorded ones; None: as recorded."""

    rig: Rig
    source_px: dict[Side, Array] | None = None

    def rays_of(self, side: Side, camera: Camera) -> Array:
        """Directions (H, W, 3) that light came from, in the axes of the camera that recorded; NaN for none."""
        pixels = self.source_px[side] if self.source_px else camera.pixel_grid()
        return camera.rays(pixels)

    def show(self, side: Side, picture: Grey) -> Grey:
        """A recorded picture in this view: linear between its pixels, black where it shows nothing."""
        if self.source_px is None:
            return picture
        places = np.clip(np.nan_to_num(self.source_px[side], nan=-FAR_PX), -FAR_PX, FAR_PX).astype(np.float32)
        u, v = np.moveaxis(places, -1, 0)
        shown = cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return shown.astype(np.uint8, copy=False)

    def dark_share(self, side: Side, recorded: Camera) -> float:
        """The share of this view's pixels that lie outside the recorded picture."""
        if self.source_px is None:
            return 0.0
        last = (recorded.width_px - 1, recorded.height_px - 1)
        inside = (self.source_px[side] >= 0) & (self.source_px[side] <= last)
        return 1.0 - float(inside.all(-1).mean())


def rectified(rig: Rig) -> Views:
    """The pinholes side by side that stand for a rig; as recorded where it is such a pair to 1e-6 px.

    Raises SequenceError where nothing rectifies the pair.
    """
    flat, turns = _flat(rig)
    if pixel_difference(rig, flat) < PIXEL_TOLERANCE:
        return Views(flat)
    return Views(flat, {side: _source_px(flat.left, rig.camera(side), turns[side]) for side in rig.sides})


def _flat(rig: Rig) -> tuple[Rig, dict[Side, Array]]:
    """The pinholes, and nothing else that the rig has; and how each of them is turned: R_view_camera."""
    views = rectification(rig)
    if rig.right and views is None:
        raise SequenceError(
            "the right camera is not to the right of the left one and looking the same way, so nothing rectifies "
            "the pair as KITTI needs it; euroc and ros2 keep it as it is"
        )
    R_view_left = views.R_view_left if views else np.eye(3)
    K = rig.left.K
    hole = Pinhole(rig.left.width_px, rig.left.height_px, *K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist())
    T_body_left = rig.T_body_left @ se3.transform(R_view_left.T, np.zeros(3))
    if views is None:
        return Rig(hole, None, T_body_left, None), {"left": R_view_left}
    T_body_right = T_body_left @ side_by_side(views.baseline_m)
    return Rig(hole, hole, T_body_left, T_body_right), {"left": R_view_left, "right": views.R_view_right}


def _source_px(view: Camera, camera: Camera, R_view_camera: Array) -> Array:
    """Where a view's pixels (H, W, 2) lie in the camera's picture; NaN for what its lens does not see."""
    return camera.project(view.rays(view.pixel_grid()) @ R_view_camera)


PNG = "png"


@dataclass(frozen=True, slots=True)
class ExportSource:
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


def open_source(folder: Path) -> ExportSource:
    """Look into a sequence's two files. Raises SequenceError where they are not whole."""
    sequence = Sequence.open(folder)
    imu = sequence.imu()
    readings = imu if len(imu.t_ns) else None
    if not has_truth(folder):
        return ExportSource(folder, sequence, sequence.rig, imu=readings)
    truth, bias = read_truth(folder), read_imu_bias(folder)
    return ExportSource(
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
