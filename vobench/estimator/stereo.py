"""Stereo geometry and matching for two cameras with any lenses: rectified views, disparities and points.

view       a virtual pinhole camera at the centre of a camera; the views are rectified and have the same matrix K
rays       (N, 3) with z = 1 in the frame of a view
disparity  the column in the left view minus the column in the right view, in px
rho        the inverse depth, disparity / (K[0, 0] baseline), in 1/m
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.errors import VobenchError
from vobench.estimator.protocol import Image
from vobench.estimator.tracking import WINDOW_PX, Mask, Points, comparable, follow, inside, lucas_kanade
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.rig import Rig, rectification
from vobench.geometry.se3 import Array

Map = tuple[NDArray[np.float32], NDArray[np.float32]]

# On the plane z = 1, the size of a pixel grows with 1 / cos² of its angle to the axis. At 60° it is 4 times as large.
WIDEST_COSINE = 0.5
ROW_PX = 1.0  # largest difference in rows between a point's pixels in the two views
MIN_DISPARITY_PX = 0.5
OUTSIDE_PX = -1e4  # a coordinate outside of every picture

# Small pictures show disparities up to half the picture's width.
SMALL_WIDTH_PX = 180
SMALL_DISPARITIES = 96
SGBM_BLOCK_PX = 5
SGBM_SUBPIXELS = 16.0  # the matcher returns disparities in 1/16 px

# A point near a depth edge gets the disparity of the foreground (foreground fattening: Scharstein, Szeliski 2002). The
# effect is weaker in a smaller window. A point is omitted if a smaller window moves it by more than both limits.
SMALL_WINDOW_PX = 5
FATTENED_PX = 0.2
FATTENED_RATIO = 2.0


def flat_rays(camera: Camera, uv_px: ArrayLike) -> Array:
    """The rays (N, 3) with z = 1 through pixels (N, 2); NaN beyond WIDEST_COSINE and for pixels without a ray."""
    rays = camera.rays(uv_px)
    z = rays[:, 2:]
    return rays / np.where(z >= WIDEST_COSINE, z, np.nan)


@dataclass(frozen=True, slots=True)
class Eye:
    """A camera and its view, which is a pinhole with matrix K and the camera's picture size."""

    camera: Camera
    R_view_camera: Array
    K: Array

    @property
    def is_view(self) -> bool:
        """Whether the picture of the camera is identical to the view."""
        has_same_lens = isinstance(self.camera, Pinhole) and np.array_equal(self.camera.K, self.K)
        return has_same_lens and np.array_equal(self.R_view_camera, np.eye(3))

    def rays(self, uv_px: ArrayLike) -> Array:
        """The rays (N, 3) with z = 1, in the frame of the view, through pixels (N, 2) of the camera."""
        rays = flat_rays(self.camera, uv_px) @ self.R_view_camera.T
        return rays / rays[:, 2:]

    def in_view(self, uv_px: ArrayLike) -> Array:
        """The pixels (N, 2) of the view that correspond to pixels (N, 2) of the camera."""
        return (self.rays(uv_px) @ self.K.T)[:, :2]

    def project(self, points_m: Array) -> Array:
        """The pixels (N, 2) of the camera that show points (N, 3) in the frame of the view; NaN if invisible."""
        return self.camera.project(points_m @ self.R_view_camera)

    def from_view(self, uv_px: Array) -> Array:
        """The pixels (N, 2) of the camera that correspond to pixels (N, 2) of the view."""
        homogeneous = np.c_[uv_px, np.ones(len(uv_px))]
        return self.project(homogeneous @ np.linalg.inv(self.K).T)

    def small_map(self) -> Map | None:
        """The columns and rows in the small picture of the camera that correspond to the pixels of the small view.

        None if they are identical.
        """
        if self.is_view:
            return None
        width, height = small_size(self.camera.width_px, self.camera.height_px)
        ratio = np.array([self.camera.width_px / width, self.camera.height_px / height])
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        small_pixels = np.stack([columns, rows], -1).reshape(-1, 2)

        # Pixel centres are at integers, so a picture begins at -0.5.
        in_camera = self.from_view((small_pixels + 0.5) * ratio - 0.5)
        in_small_camera = (in_camera + 0.5) / ratio - 0.5
        finite = np.nan_to_num(in_small_camera, nan=OUTSIDE_PX).astype(np.float32)
        column_map, row_map = finite.T.reshape(2, height, width)
        return np.ascontiguousarray(column_map), np.ascontiguousarray(row_map)


@dataclass(frozen=True, slots=True)
class StereoPair:
    """Two cameras whose views have the same matrix K, and their baseline. Their pictures are not rectified.

    `left` and `right` are the cameras, each with the view to which its pixels correspond.
    `baseline_m` is the distance between the cameras in metres.
    `small_maps` lead from the pixels of small left and right views to those of small pictures, as `Eye.small_map`.
    """

    left: Eye
    right: Eye
    baseline_m: float
    small_maps: tuple[Map | None, Map | None]

    @property
    def K(self) -> Array:
        """The matrix (3, 3) of both views."""
        return self.left.K

    @property
    def focal_baseline(self) -> float:
        """The disparity in px of a point at a depth of one metre."""
        return float(self.K[0, 0] * self.baseline_m)

    def seen(self, points: Points) -> Mask:
        """Whether the left view can show each point (N, 2) of the left picture."""
        in_view = self.left.in_view(points)
        return np.asarray(np.isfinite(in_view).all(1))

    def match(
        self,
        left: Image,
        right: Image,
        points: Points,
        *,
        margin_px: int,
        window_px: int = WINDOW_PX,
        row_px: float = ROW_PX,
        with_edges: bool = True,
    ) -> tuple[Points, Array]:
        """The pixels (N, 2) in the right picture that match points (N, 2) in the left one, and disparities (N,).

        A disparity is NaN without a match. The rows of matching points differ by at most `row_px`. Points near depth
        edges are omitted unless `with_edges` is set.
        """
        left, right = comparable(left, right)
        guess = self._coarse_match(left, right, points)
        matched, found = follow(left, right, points, guess, window_px=window_px)
        disparity_px = self.disparity(points, matched, row_px=row_px)
        good = found & inside(matched, right, margin_px) & np.isfinite(disparity_px)
        if not with_edges and good.any():
            rematched, found_again = lucas_kanade(left, right, points, matched, window_px=SMALL_WINDOW_PX, levels=0)
            moved_px = np.abs(rematched - matched)[:, 0]  # (N,), approximately along the row
            limit_px = max(FATTENED_PX, FATTENED_RATIO * float(np.median(moved_px[good])))
            good &= found_again & (moved_px < limit_px)
        return matched, np.where(good, disparity_px, np.nan)

    def disparity(self, points: Points, matched: Points, *, row_px: float = ROW_PX) -> Array:
        """The disparities (N,) in px of left and right pixels (N, 2); NaN if rows differ or it is too small."""
        columns_px, rows_px = (self.left.in_view(points) - self.right.in_view(matched)).T
        with np.errstate(invalid="ignore"):
            good = (np.abs(rows_px) < row_px) & (columns_px > MIN_DISPARITY_PX)
        return np.where(good, columns_px, np.nan)

    def points(self, uv_px: ArrayLike, disparity_px: Array) -> Array:
        """The points (N, 3) in m, in the frame of the left view, of left pixels (N, 2) with disparities (N,)."""
        with np.errstate(divide="ignore"):
            depth_m = self.focal_baseline / disparity_px
            return self.left.rays(uv_px) * depth_m[:, None]

    def T_left(self, T_view: Array) -> Array:
        """The motion of the left camera that corresponds to a motion of the left view."""
        T_view_left = self.T_view_left
        return se3.inverse(T_view_left) @ T_view @ T_view_left

    @property
    def T_view_left(self) -> Array:
        """The pose of the left camera in the frame of the left view, which is a rotation."""
        return se3.transform(self.left.R_view_camera, np.zeros(3))

    def _coarse_match(self, left: Image, right: Image, points: Points) -> Points:
        """Approximate pixels (N, 2) of the points in the right picture; their left pixels if there is no estimate."""
        in_view = self.left.in_view(points)
        left_map, right_map = self.small_maps
        small_left = _small(left, left_map)
        small_right = _small(right, right_map)
        shift_px = coarse_disparity(small_left, small_right, in_view, left.shape[1])
        guess = self.right.from_view(shifted_left(in_view, shift_px))
        return np.where(np.isfinite(guess), guess, points).astype(np.float32)


def shifted_left(uv_px: Array, shift_px: Array) -> Array:
    """Pixels (N, 2) shifted to the left by a number of columns (N,)."""
    return uv_px - np.stack([shift_px, np.zeros_like(shift_px)], -1)


def stereo_pair(rig: Rig, name: str) -> StereoPair:
    """The stereo pair of a rig, for the estimator `name`.

    Raises VobenchError unless both cameras look the same way, side by side, with pictures of one size.
    """
    views = rectification(rig)
    if views is None:
        position = ", ".join(f"{x:.4g}" for x in rig.T_left_right[:3, 3])
        turned_deg = np.rad2deg(se3.rotation_angle(rig.T_left_right[:3, :3]))
        raise VobenchError(
            f"{name} needs the right camera to the right of the left and both looking the same way, within 30 "
            f"deg; it is at ({position}) m and turned by {turned_deg:.3g} deg"
        )
    right_camera = rig.camera("right")
    left_size = (rig.left.width_px, rig.left.height_px)
    right_size = (right_camera.width_px, right_camera.height_px)
    if left_size != right_size:
        raise VobenchError(f"{name} needs two images of one size, got {left_size} and {right_size} px")
    left = Eye(rig.left, views.R_view_left, views.K)
    right = Eye(right_camera, views.R_view_right, views.K)
    small_maps = (left.small_map(), right.small_map())
    return StereoPair(left, right, views.baseline_m, small_maps)


def coarse_disparity(left: Image, right: Image, uv_px: Array, width_px: int) -> Array:
    """The disparities (N,) in px at pixels (N, 2) of a view with width `width_px`, from small pictures of both views.

    It finds disparities that are too large for Lucas-Kanade alone. Source: Hirschmüller (2008).
    """
    # The matcher omits columns for which the largest disparity would leave the picture, so the picture is padded.
    widen = (0, 0, SMALL_DISPARITIES, 0, cv2.BORDER_REPLICATE)
    wide_left = cv2.copyMakeBorder(left, *widen)
    wide_right = cv2.copyMakeBorder(right, *widen)
    matcher = cv2.StereoSGBM.create(0, SMALL_DISPARITIES, SGBM_BLOCK_PX, P1=200, P2=800, uniquenessRatio=5)
    coarse_px = matcher.compute(wide_left, wide_right)[:, SMALL_DISPARITIES:] / SGBM_SUBPIXELS
    is_known = coarse_px >= 0
    coarse_px[~is_known] = np.median(coarse_px[is_known]) if is_known.any() else 0.0

    ratio = _shrink_ratio(width_px)
    height, width = left.shape
    columns, rows = (np.nan_to_num(uv_px) / ratio).astype(int).T
    columns = columns.clip(0, width - 1)
    rows = rows.clip(0, height - 1)
    disparity_px: Array = coarse_px[rows, columns] * ratio
    return disparity_px


def small_size(width_px: int, height_px: int) -> tuple[int, int]:
    """The width and height of the small version of a picture."""
    ratio = _shrink_ratio(width_px)
    return width_px // ratio, height_px // ratio


def _shrink_ratio(width_px: int) -> int:
    return max(1, round(width_px / SMALL_WIDTH_PX))


def _small(image: Image, small_map: Map | None) -> Image:
    """The small version of a picture, resampled to the view."""
    height_px, width_px = image.shape
    small = cv2.resize(image, small_size(width_px, height_px), interpolation=cv2.INTER_AREA)
    if small_map is not None:
        small = cv2.remap(small, *small_map, interpolation=cv2.INTER_LINEAR)
    return small.astype(np.uint8, copy=False)


def predicted(eye: Eye, points: Points, rho: Array, T_now_last: Array) -> Points:
    """The predicted pixels (N, 2) of points (N, 2) with inverse depths rho (N,) after a motion of the view.

    A point with unknown depth (NaN) gets the median depth. A point that would leave the view keeps its pixel.
    """
    known = np.isfinite(rho)
    typical_rho = np.median(rho[known]) if known.any() else 0.0
    rho = np.where(known, rho, typical_rho)
    R = T_now_last[:3, :3]
    t_m = T_now_last[:3, 3]
    moved = eye.rays(points) @ R.T + rho[:, None] * t_m
    there = eye.project(moved)
    is_seen = np.isfinite(there.sum(1, keepdims=True))
    return np.where(is_seen, there, points).astype(np.float32)
