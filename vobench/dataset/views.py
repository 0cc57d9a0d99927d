"""The pictures that a layout holds: those recorded, or those of two virtual pinholes side by side."""

from dataclasses import dataclass

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
