"""A stereo pair of any two lenses: its rectified views, disparities, and points.

view       a virtual pinhole at a camera's centre, rectified: both views have the same rows and the same matrix K
rays       (N, 3) with z = 1 in the view's axes
disparity  column in the left view less column in the right one, px; inverse depth rho = disparity / (K[0, 0] baseline)
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

# On the plane z = 1 a pixel grows with 1 / cos² of the angle to the axis; at 60° it is four times as tall.
WIDEST_COSINE = 0.5
ROW_PX = 1.0  # largest difference in rows between a point's pixels in the two views
MIN_DISPARITY_PX = 0.5
OUTSIDE_PX = -1e4  # a pixel that no picture has

# Small pictures show disparities up to half the picture's width.
SMALL_WIDTH_PX = 180
SMALL_DISPARITIES = 96
SGBM_BLOCK_PX = 5
SGBM_SUBPIXELS = 16.0  # units of the matcher's disparities in a pixel

# A point on a depth edge gets the disparity of the foreground (foreground fattening: Scharstein, Szeliski 2002), less
# so in a smaller window. A point is left out if such a window moves it by more than this, and by more than most.
SMALL_WINDOW_PX = 5
FATTENED_PX = 0.2
FATTENED_RATIO = 2.0


def flat_rays(camera: Camera, uv_px: ArrayLike) -> Array:
    """Rays (N, 3) with z = 1 through pixels (N, 2); NaN beyond WIDEST_COSINE, or where the lens has no ray."""
    rays = camera.rays(uv_px)
    z = rays[:, 2:]
    return rays / np.where(z >= WIDEST_COSINE, z, np.nan)


@dataclass(frozen=True, slots=True)
class Eye:
    """A camera and its view, a pinhole of matrix K with the camera's picture size."""

    camera: Camera
    R_view_camera: Array
    K: Array

    @property
    def is_view(self) -> bool:
        """Whether the camera's picture is the view already."""
        has_same_lens = isinstance(self.camera, Pinhole) and np.array_equal(self.camera.K, self.K)
        return has_same_lens and np.array_equal(self.R_view_camera, np.eye(3))

    def rays(self, uv_px: ArrayLike) -> Array:
        """Rays (N, 3) in the view's axes with z = 1 through the camera's pixels (N, 2)."""
        rays = flat_rays(self.camera, uv_px) @ self.R_view_camera.T
        return rays / rays[:, 2:]

    def in_view(self, uv_px: ArrayLike) -> Array:
        """The view's pixels (N, 2) of the camera's pixels."""
        return (self.rays(uv_px) @ self.K.T)[:, :2]

    def project(self, points_m: Array) -> Array:
        """The camera's pixels (N, 2) of points (N, 3) in the view's axes; NaN where it cannot see them."""
        return self.camera.project(points_m @ self.R_view_camera)

    def from_view(self, uv_px: Array) -> Array:
        """The camera's pixels (N, 2) of the view's pixels."""
        homogeneous = np.c_[uv_px, np.ones(len(uv_px))]
        return self.project(homogeneous @ np.linalg.inv(self.K).T)

    def small_map(self) -> Map | None:
        """Columns and rows in the camera's small picture of the small view's pixels; None if they are the same."""
        if self.is_view:
            return None
        width, height = small_size(self.camera.width_px, self.camera.height_px)
        ratio = np.array([self.camera.width_px / width, self.camera.height_px / height])
        columns, rows = np.meshgrid(np.arange(width), np.arange(height))
        small_pixels = np.stack([columns, rows], -1).reshape(-1, 2)

        # Pixel centres lie at whole numbers, so that a picture begins at -0.5.
        in_camera = self.from_view((small_pixels + 0.5) * ratio - 0.5)
        in_small_camera = (in_camera + 0.5) / ratio - 0.5
        finite = np.nan_to_num(in_small_camera, nan=OUTSIDE_PX).astype(np.float32)
        column_map, row_map = finite.T.reshape(2, height, width)
        return np.ascontiguousarray(column_map), np.ascontiguousarray(row_map)


@dataclass(frozen=True, slots=True)
class StereoPair:
    """Both eyes, with the same view matrix K, and the distance between them. Pictures are not rectified."""

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
        """Disparity in px of a point one metre away."""
        return float(self.K[0, 0] * self.baseline_m)

    def seen(self, points: Points) -> Mask:
        """Which points (N, 2) of the left picture are in the view."""
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
        """Pixels (N, 2) in the right picture of points (N, 2) in the left one, and disparities (N,), NaN for no match.

        Rows of the view may differ by `row_px`. Without `with_edges`, points on depth edges have no match.
        """
        left, right = comparable(left, right)
        guess = self._coarse_match(left, right, points)
        matched, found = follow(left, right, points, guess, window_px=window_px)
        disparity_px = self.disparity(points, matched, row_px=row_px)
        good = found & inside(matched, right, margin_px) & np.isfinite(disparity_px)
        if not with_edges and good.any():
            rematched, found_again = lucas_kanade(left, right, points, matched, window_px=SMALL_WINDOW_PX, levels=0)
            moved_px = np.abs(rematched - matched)[:, 0]  # along rows, or nearly so
            limit_px = max(FATTENED_PX, FATTENED_RATIO * float(np.median(moved_px[good])))
            good &= found_again & (moved_px < limit_px)
        return matched, np.where(good, disparity_px, np.nan)

    def disparity(self, points: Points, matched: Points, *, row_px: float = ROW_PX) -> Array:
        """Disparity (N,) in px of left and right pixels (N, 2); NaN if rows differ or the disparity is too small."""
        columns_px, rows_px = (self.left.in_view(points) - self.right.in_view(matched)).T
        with np.errstate(invalid="ignore"):
            good = (np.abs(rows_px) < row_px) & (columns_px > MIN_DISPARITY_PX)
        return np.where(good, columns_px, np.nan)

    def points(self, uv_px: ArrayLike, disparity_px: Array) -> Array:
        """Points (N, 3) in m, in the view's axes, of left pixels (N, 2) with a disparity."""
        with np.errstate(divide="ignore"):
            depth_m = self.focal_baseline / disparity_px
            return self.left.rays(uv_px) * depth_m[:, None]

    def T_left(self, T_view: Array) -> Array:
        """A motion in the view's axes as the same motion in the left camera's."""
        T_view_left = self.T_view_left
        return se3.inverse(T_view_left) @ T_view @ T_view_left

    @property
    def T_view_left(self) -> Array:
        """The left camera's pose in the view's axes: a rotation."""
        return se3.transform(self.left.R_view_camera, np.zeros(3))

    def _coarse_match(self, left: Image, right: Image, points: Points) -> Points:
        """Rough pixels (N, 2) of the points in the right picture; their left pixels where nothing is known."""
        in_view = self.left.in_view(points)
        left_map, right_map = self.small_maps
        small_left = _small(left, left_map)
        small_right = _small(right, right_map)
        shift_px = coarse_disparity(small_left, small_right, in_view, left.shape[1])
        guess = self.right.from_view(shifted_left(in_view, shift_px))
        return np.where(np.isfinite(guess), guess, points).astype(np.float32)


def shifted_left(uv_px: Array, shift_px: Array) -> Array:
    """Pixels (N, 2) moved left by so many columns (N,)."""
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
        raise VobenchError(f"{name} needs two pictures of one size, got {left_size} and {right_size} px")
    left = Eye(rig.left, views.R_view_left, views.K)
    right = Eye(right_camera, views.R_view_right, views.K)
    small_maps = (left.small_map(), right.small_map())
    return StereoPair(left, right, views.baseline_m, small_maps)


def coarse_disparity(left: Image, right: Image, uv_px: Array, width_px: int) -> Array:
    """Disparity (N,) in px at pixels (N, 2) of a view `width_px` wide, from small pictures of both views.

    It finds disparities far beyond the reach of Lucas-Kanade alone. Source: Hirschmüller (2008).
    """
    # The matcher skips columns from which the largest disparity would leave the picture, so the picture is widened.
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
    """Width and height of a small picture."""
    ratio = _shrink_ratio(width_px)
    return width_px // ratio, height_px // ratio


def _shrink_ratio(width_px: int) -> int:
    return max(1, round(width_px / SMALL_WIDTH_PX))


def _small(image: Image, small_map: Map | None) -> Image:
    """The small picture of the view."""
    height_px, width_px = image.shape
    small = cv2.resize(image, small_size(width_px, height_px), interpolation=cv2.INTER_AREA)
    if small_map is not None:
        small = cv2.remap(small, *small_map, interpolation=cv2.INTER_LINEAR)
    return small.astype(np.uint8, copy=False)


def predicted(eye: Eye, points: Points, rho: Array, T_now_last: Array) -> Points:
    """Pixels (N, 2) of points (N, 2) with inverse depths rho (N,) after a motion of the view.

    A point of unknown depth (NaN) is taken to be as far away as the median; one that would not be seen stays.
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
