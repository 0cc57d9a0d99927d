"""The content of a sequence that is exported: its rig, readings, ground truth, and rectified pictures."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from vobench.dataset.read_back import PIXEL_TOLERANCE, pixel_difference
from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole, pixel_grid
from vobench.geometry.rig import Rig, Side, rectification, side_by_side
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuBias, ImuReadings
from vobench.sequence import (
    Sequence,
    has_case,
    has_truth,
    read_case,
    read_imu_bias,
    read_true_rig,
    read_truth,
    read_twist,
    truth_channels,
)
from vobench.sequence.picture import Image, decode, encode
from vobench.sequence.topic import CASE_ATTACHMENT, TRUTH_FILE
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory

FAR_PX = 30_000.0  # outside of every picture; replaces NaN, for which OpenCV returns an arbitrary pixel
PNG = "png"


@dataclass(frozen=True, slots=True)
class Views:
    """The rig of the exported pictures, and how they are resampled from the recorded ones.

    `source_px` maps each side to the positions (H, W, 2) of the exported pixels in the recorded picture. A position is
    NaN if no point of the recorded picture corresponds to it. None exports the pictures without resampling.
    """

    rig: Rig
    source_px: dict[Side, Array] | None = None

    def rays_of(self, side: Side, camera: Camera) -> Array:
        """The rays (H, W, 3) of the exported pixels in the frame of the recording camera; NaN if there is none."""
        if self.source_px is None:
            return camera.rays(pixel_grid(camera))
        return camera.rays(self.source_px[side])

    def show(self, side: Side, picture: Image) -> Image:
        """A recorded picture, resampled by linear interpolation; pixels outside of it are black."""
        if self.source_px is None:
            return picture
        finite_px = np.nan_to_num(self.source_px[side], nan=-FAR_PX)
        pixels = np.clip(finite_px, -FAR_PX, FAR_PX).astype(np.float32)
        u, v = np.moveaxis(pixels, -1, 0)
        shown = cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return shown.astype(np.uint8, copy=False)

    def dark_share(self, side: Side, recorded: Camera) -> float:
        """The share of exported pixels that lie outside of the recorded picture."""
        if self.source_px is None:
            return 0.0
        pixels = self.source_px[side]
        last_px = (recorded.width_px - 1, recorded.height_px - 1)
        inside = (pixels >= 0) & (pixels <= last_px)
        return 1.0 - float(inside.all(-1).mean())


def rectified(rig: Rig) -> Views:
    """The rectified views of a rig. Pictures are not resampled if the rig is already rectified.

    Raises SequenceError if the pair cannot be rectified.
    """
    rectified_rig = _rectified_rig(rig)
    if pixel_difference(rig, rectified_rig.rig) < PIXEL_TOLERANCE:
        return Views(rectified_rig.rig)
    view = rectified_rig.rig.left
    rays_view = view.rays(pixel_grid(view))  # (H, W, 3), the same for both views
    source_px = {}
    for side in rig.sides:
        rays_camera = rays_view @ rectified_rig.R_view_camera[side]
        source_px[side] = rig.camera(side).project(rays_camera)
    return Views(rectified_rig.rig, source_px)


class _RectifiedRig(NamedTuple):
    """A rig of parallel pinhole cameras, and the rotation (3, 3) from each recorded camera to its view."""

    rig: Rig
    R_view_camera: dict[Side, Array]


def _rectified_rig(rig: Rig) -> _RectifiedRig:
    """The rectified cameras of a rig. Raises SequenceError if the pair cannot be rectified."""
    views = rectification(rig)
    if rig.right and views is None:
        raise SequenceError(
            "the right camera is not to the right of the left one and looking the same way, so the pair cannot be "
            "rectified, which KITTI requires; the forms euroc and ros2 export it unchanged"
        )

    fx_fy_cx_cy_px = rig.left.K[[0, 1, 0, 1], [0, 1, 2, 2]]
    pinhole = Pinhole(rig.left.width_px, rig.left.height_px, *fx_fy_cx_cy_px.tolist())
    R_view_left = np.eye(3) if views is None else views.R_view_left
    T_body_left = rig.T_body_left @ se3.transform(R_view_left.T, np.zeros(3))
    if views is None:
        return _RectifiedRig(Rig(pinhole, None, T_body_left, None), {"left": R_view_left})

    T_body_right = T_body_left @ side_by_side(views.baseline_m)
    R_view_camera: dict[Side, Array] = {"left": R_view_left, "right": views.R_view_right}
    return _RectifiedRig(Rig(pinhole, pinhole, T_body_left, T_body_right), R_view_camera)


@dataclass(frozen=True, slots=True)
class ExportSource:
    """A sequence with its readings and ground truth. What was not recorded is None.

    `truth` is the trajectory of the body.
    `twist` (N, 6) is the linear velocity (m/s) and the angular velocity (rad/s) of the body, in the axes of the body.
    `channels` lists the recorded channels of per-pixel ground truth.
    `case` is the description of the simulated case.
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
        """The nominal calibration, without the IMU if it has no readings."""
        rig = self.sequence.rig
        return rig if self.imu else replace(rig, imu=None)


@dataclass(frozen=True, slots=True)
class PngFrame:
    """The pictures of one frame as PNG files, one per camera."""

    index: int
    t_ns: int
    pictures: dict[Side, bytes]


def open_source(folder: Path) -> ExportSource:
    """Open the sequence in a folder for an export. Raises SequenceError if one of its files is incomplete."""
    sequence = Sequence.open(folder)
    imu = sequence.imu()
    readings = imu if len(imu.t_ns) else None
    if not has_truth(folder):
        return ExportSource(folder, sequence, sequence.rig, imu=readings)

    truth = read_truth(folder)
    bias = read_imu_bias(folder)
    return ExportSource(
        folder=folder,
        sequence=sequence,
        true_rig=read_true_rig(folder),
        truth=truth if len(truth) else None,
        twist=read_twist(folder),
        bias=bias if len(bias.t_ns) else None,
        imu=readings,
        channels=truth_channels(folder),
        case=_case(folder),
    )


def _case(folder: Path) -> Mapping[str, Any] | None:
    """The description of the simulated case; None if the sequence has none.

    Raises SequenceError if the attachment is damaged or is not JSON.
    """
    if not has_case(folder):
        return None
    text = read_case(folder)
    try:
        case = json.loads(text)
    except ValueError as error:  # the text is not JSON, or not UTF-8
        raise SequenceError(f"the attachment {CASE_ATTACHMENT} is not JSON ({error}): {folder / TRUTH_FILE}") from None
    return case if isinstance(case, dict) else None


def png_frames(sequence: Sequence, views: Views) -> Iterator[PngFrame]:
    """The pictures of a sequence in these views, as PNG files. PNG files that are not resampled are not decoded."""
    for frame in sequence.encoded_frames():
        recorded: dict[Side, bytes | None] = {"left": frame.left, "right": frame.right}
        pictures = {}
        for side in views.rig.sides:
            pictures[side] = _as_png(sequence.rig, views, side, recorded[side], frame.form)
        yield PngFrame(frame.index, frame.t_ns, pictures)


def _as_png(
    rig: Rig,
    views: Views,
    side: Side,
    encoded: bytes | None,
    form: str,
) -> bytes:
    if encoded is None:
        raise SequenceError(f"a frame has no {side} picture, but the rig has a {side} camera")
    if views.source_px is None and form == PNG:
        return bytes(encoded)
    recorded = decode(encoded, rig.camera(side), f"a {side} picture")
    return encode(views.show(side, recorded), views.rig.camera(side), side)


def rate_hz(t_ns: Stamps) -> float:
    """The mean rate of stamps (N,); 0 for fewer than two different stamps."""
    if len(t_ns) < 2:
        return 0.0
    span_ns = int(t_ns[-1]) - int(t_ns[0])
    if span_ns == 0:
        return 0.0
    return (len(t_ns) - 1) * float(NS_PER_S) / span_ns
