"""A sequence as the writers of layouts see it: its rig, pictures, truth and readings, and rectified views."""

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
    has_truth,
    read_case,
    read_imu_bias,
    read_true_rig,
    read_truth,
    read_twist,
    truth_channels,
)
from vobench.sequence.messages import CASE_ATTACHMENT, TRUTH_FILE
from vobench.sequence.picture import Image, decode, encode
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory

FAR_PX = 30_000.0  # outside any picture; OpenCV resamples NaN from an arbitrary pixel


@dataclass(frozen=True, slots=True)
class Views:
    """The rig of exported pictures, and how these are resampled from the recorded ones.

    source_px: the position (H, W, 2) in the recorded picture of each pixel, NaN if it shows nothing; None if pictures
    are exported as recorded.
    """

    rig: Rig
    source_px: dict[Side, Array] | None = None

    def rays_of(self, side: Side, camera: Camera) -> Array:
        """Rays (H, W, 3) of this view's pixels in the frame of the recording camera; NaN for pixels without one."""
        if self.source_px is None:
            return camera.rays(pixel_grid(camera))
        return camera.rays(self.source_px[side])

    def show(self, side: Side, picture: Image) -> Image:
        """A recorded picture in this view: linear between its pixels, black where it shows nothing."""
        if self.source_px is None:
            return picture
        finite_px = np.nan_to_num(self.source_px[side], nan=-FAR_PX)
        pixels = np.clip(finite_px, -FAR_PX, FAR_PX).astype(np.float32)
        u, v = np.moveaxis(pixels, -1, 0)
        shown = cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return shown.astype(np.uint8, copy=False)

    def dark_share(self, side: Side, recorded: Camera) -> float:
        """The share of this view's pixels that lie outside the recorded picture."""
        if self.source_px is None:
            return 0.0
        pixels = self.source_px[side]
        last_px = (recorded.width_px - 1, recorded.height_px - 1)
        inside = (pixels >= 0) & (pixels <= last_px)
        return 1.0 - float(inside.all(-1).mean())


def rectified(rig: Rig) -> Views:
    """The rectified pair of a rig; pictures of a rig that is rectified already are left as recorded.

    Raises SequenceError where the pair cannot be rectified.
    """
    flat = _rectified_rig(rig)
    if pixel_difference(rig, flat.rig) < PIXEL_TOLERANCE:
        return Views(flat.rig)
    rays = flat.rig.left.rays(pixel_grid(flat.rig.left))  # (H, W, 3), the same for both views
    source_px = {}
    for side in rig.sides:
        rays_camera = rays @ flat.R_view_camera[side]
        source_px[side] = rig.camera(side).project(rays_camera)
    return Views(flat.rig, source_px)


class _Rectified(NamedTuple):
    """A rig of pinholes side by side, without wheels and IMU, and the rotation of each from the recorded camera."""

    rig: Rig
    R_view_camera: dict[Side, Array]


def _rectified_rig(rig: Rig) -> _Rectified:
    views = rectification(rig)
    if rig.right and views is None:
        raise SequenceError(
            "the right camera is not to the right of the left one and looking the same way, so the pair cannot be "
            "rectified, as KITTI needs it; the forms euroc and ros2 keep it as it is"
        )

    fx_fy_cx_cy_px = rig.left.K[[0, 1, 0, 1], [0, 1, 2, 2]]
    pinhole = Pinhole(rig.left.width_px, rig.left.height_px, *fx_fy_cx_cy_px.tolist())
    R_view_left = np.eye(3) if views is None else views.R_view_left
    T_body_left = rig.T_body_left @ se3.transform(R_view_left.T, np.zeros(3))
    if views is None:
        return _Rectified(Rig(pinhole, None, T_body_left, None), {"left": R_view_left})

    T_body_right = T_body_left @ side_by_side(views.baseline_m)
    R_view_camera: dict[Side, Array] = {"left": R_view_left, "right": views.R_view_right}
    return _Rectified(Rig(pinhole, pinhole, T_body_left, T_body_right), R_view_camera)


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
        """The reported calibration; an IMU without a reading is left out."""
        rig = self.sequence.rig
        return rig if self.imu else replace(rig, imu=None)


@dataclass(frozen=True, slots=True)
class PngFrame:
    """The pictures of one instant as PNG files, by the side of their camera."""

    index: int
    t_ns: int
    pictures: dict[Side, bytes]


def open_source(folder: Path) -> ExportSource:
    """What a sequence's two files hold for an export. Raises SequenceError where they are not whole."""
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
    try:
        text = read_case(folder)
    except SequenceError:
        return None
    try:
        case = json.loads(text)
    except ValueError as error:  # of JSON, or of UTF-8
        raise SequenceError(f"the attachment {CASE_ATTACHMENT} is not JSON ({error}): {folder / TRUTH_FILE}") from None
    return case if isinstance(case, dict) else None


def png_frames(sequence: Sequence, views: Views) -> Iterator[PngFrame]:
    """The pictures as PNG files of these views; files that are PNG already and not resampled are kept."""
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
    """The mean rate of stamps (N,); 0 if they span no time."""
    if len(t_ns) < 2:
        return 0.0
    span_ns = int(t_ns[-1]) - int(t_ns[0])
    if span_ns == 0:
        return 0.0
    return (len(t_ns) - 1) * float(NS_PER_S) / span_ns
