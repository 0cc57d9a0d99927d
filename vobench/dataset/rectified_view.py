"""The rectified views of a rig, and how they are resampled from the recorded pictures."""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from vobench.dataset.read_back import PIXEL_TOLERANCE, pixel_difference
from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole, focal_and_center_px, pixel_grid
from vobench.geometry.rig import Rig, Side, rectification, side_by_side
from vobench.geometry.se3 import Array
from vobench.sequence.picture import Image

FAR_PX = 30_000.0  # outside of every picture; replaces NaN, for which OpenCV returns an arbitrary pixel


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
    view = _rectified_pair(rig) if rig.right else _rectified_mono(rig)
    if pixel_difference(rig, view.rig) < PIXEL_TOLERANCE:
        return Views(view.rig)

    pinhole = view.rig.left
    rays_view = pinhole.rays(pixel_grid(pinhole))  # (H, W, 3), the same for both views
    source_px = {}
    for side in rig.sides:
        rays_camera = rays_view @ view.R_view_camera[side]
        source_px[side] = rig.camera(side).project(rays_camera)
    return Views(view.rig, source_px)


class _RectifiedRig(NamedTuple):
    """A rig of parallel pinhole cameras, and the rotation (3, 3) from each recorded camera to its view."""

    rig: Rig
    R_view_camera: dict[Side, Array]


def _rectified_mono(rig: Rig) -> _RectifiedRig:
    """The pinhole camera with the direction of the only camera of a rig."""
    R_view_left = np.eye(3)
    T_body_left = _turned(rig.T_body_left, R_view_left)
    return _RectifiedRig(Rig(_pinhole(rig.left), None, T_body_left, None), {"left": R_view_left})


def _rectified_pair(rig: Rig) -> _RectifiedRig:
    """The rectified cameras of a stereo pair. Raises SequenceError if the pair cannot be rectified."""
    parallel = rectification(rig)
    if parallel is None:
        raise SequenceError(
            "the right camera is not to the right of the left one and looking the same way, so the pair cannot be "
            "rectified, which KITTI requires; the forms euroc and ros2 export it unchanged"
        )
    pinhole = _pinhole(rig.left)
    T_body_left = _turned(rig.T_body_left, parallel.R_view_left)
    T_body_right = T_body_left @ side_by_side(parallel.baseline_m)
    R_view_camera: dict[Side, Array] = {"left": parallel.R_view_left, "right": parallel.R_view_right}
    return _RectifiedRig(Rig(pinhole, pinhole, T_body_left, T_body_right), R_view_camera)


def _pinhole(camera: Camera) -> Pinhole:
    """The pinhole camera with the size, focal lengths and principal point of a camera."""
    return Pinhole(camera.width_px, camera.height_px, *focal_and_center_px(camera.K))


def _turned(T_body_camera: Array, R_view_camera: Array) -> Array:
    """The pose (4, 4) of the view of a camera, which shares its optical centre."""
    return T_body_camera @ se3.transform(R_view_camera.T, np.zeros(3))
