"""Two cameras of any kind as one stereo pair: pixels to flat rays, and depth from left to right.

Pictures stay as they are. What needs straight lines happens to points: on the plane z = 1 of the
left camera, or in two virtual pinholes side by side, the views.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.errors import VobenchError
from vobench.estimator.protocol import Image
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.rig import SIDES, Rig, rectification
from vobench.geometry.se3 import Array

from .tracking import Mask, Points, coarse_disparity, comparable, follow, inside, small_size

# On the plane z = 1 a pixel grows with 1 / cos² of the angle to the axis; at 60° it is four times as tall.
WIDEST_COSINE = 0.5
ROW_PX = 1.0  # rectified: a point keeps its row from left to right
MIN_DISPARITY_PX = 0.5
NOWHERE_PX = -1e4

Map = tuple[NDArray[np.float32], NDArray[np.float32]]


def flat_rays(camera: Camera, uv_px: ArrayLike) -> Array:
    """Rays (N, 3) with z = 1 through pixels (N, 2); NaN where they point too far aside, or nowhere."""
    rays = camera.rays(uv_px)
    z = rays[:, 2:]
    return rays / np.where(z >= WIDEST_COSINE, z, np.nan)


@dataclass(frozen=True, slots=True)
class Eye:
    """A camera and the view it is turned into, a pinhole of matrix K with the camera's picture size."""

    camera: Camera
    R_view_camera: Array
    K: Array

    @property
    def is_view(self) -> bool:
        """Whether the camera's picture is the view already."""
        straight = isinstance(self.camera, Pinhole) and np.array_equal(self.camera.K, self.K)
        return straight and np.array_equal(self.R_view_camera, np.eye(3))

    def rays_in_view(self, uv_px: ArrayLike) -> Array:
        """Rays (N, 3) in the view's axes with z = 1 through the camera's pixels (N, 2)."""
        rays = flat_rays(self.camera, uv_px) @ self.R_view_camera.T
        return rays / rays[:, 2:]

    def in_view(self, uv_px: ArrayLike) -> Array:
        """The view's pixels (N, 2) of the camera's pixels."""
        return (self.rays_in_view(uv_px) @ self.K.T)[:, :2]

    def from_view(self, uv_px: Array) -> Array:
        """The camera's pixels (N, 2) of the view's pixels."""
        rays = np.c_[uv_px, np.ones(len(uv_px))] @ np.linalg.inv(self.K).T
        return self.camera.project(rays @ self.R_view_camera)

    def small_map(self) -> Map | None:
        """Columns and rows in the camera's small picture of the small view's pixels; None where they are the same."""
        if self.is_view:
            return None
        width, height = small_size(self.camera.width_px, self.camera.height_px)
        shrink = np.array([self.camera.width_px / width, self.camera.height_px / height])
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2)
        seen = (self.from_view((grid + 0.5) * shrink - 0.5) + 0.5) / shrink - 0.5
        column, row = np.nan_to_num(seen, nan=NOWHERE_PX).astype(np.float32).T.reshape(2, height, width)
        return np.ascontiguousarray(column), np.ascontiguousarray(row)


@dataclass(frozen=True, slots=True)
class Pair:
    """Both eyes, with the same view matrix, and the distance between them."""

    left: Eye
    right: Eye
    baseline_m: float
    small_maps: tuple[Map | None, Map | None]

    def inverse_depth(self, left: Image, right: Image, points: Points, margin_px: int) -> Array:
        """Inverse depth (N,) in 1/m along the left axis of points (N, 2); NaN where the right picture lacks them."""
        left, right = comparable(left, right)
        in_view = self.left.in_view(points)
        matched, found = follow(left, right, points, self._guess(left, right, points, in_view))
        good = found & inside(matched, right, margin_px)
        shift = in_view - self.right.in_view(matched)
        with np.errstate(invalid="ignore"):
            good &= (np.abs(shift[:, 1]) < ROW_PX) & (shift[:, 0] > MIN_DISPARITY_PX)
        rho_view = np.where(good, shift[:, 0], np.nan) / (self.left.K[0, 0] * self.baseline_m)
        rho: Array = rho_view / (self.left.rays_in_view(points) @ self.left.R_view_camera[:, 2])
        return rho

    def _guess(self, left: Image, right: Image, points: Points, in_view: Array) -> Points:
        """About where the points are in the right picture; their own place where nothing is known."""
        views = [small(image, its_map) for image, its_map in zip((left, right), self.small_maps, strict=True)]
        shift = coarse_disparity(views[0], views[1], in_view, left.shape[1])
        guess = self.right.from_view(in_view - np.stack([shift, np.zeros_like(shift)], -1))
        return np.where(np.isfinite(guess), guess, points).astype(np.float32)

    def seen(self, points: Points) -> Mask:
        """Which points (N, 2) of the left picture have a flat ray and a place in the view."""
        return np.asarray(np.isfinite(self.left.in_view(points)).all(1))


def stereo_pair(rig: Rig) -> Pair:
    """The pair of a rig. Raises VobenchError where it is none that looks the same way side by side."""
    views = rectification(rig)
    if views is None:
        position = ", ".join(f"{x:.4g}" for x in rig.T_left_right[:3, 3])
        turned_deg = np.rad2deg(se3.rotation_angle(rig.T_left_right[:3, :3]))
        raise VobenchError(
            f"lk_epipolar needs the right camera to the right of the left and both looking the same way, within 30 "
            f"deg; it is at ({position}) m and turned by {turned_deg:.3g} deg"
        )
    sizes = [(camera.width_px, camera.height_px) for camera in map(rig.camera, SIDES)]
    if sizes[0] != sizes[1]:
        raise VobenchError(f"lk_epipolar needs two pictures of one size, got {sizes[0]} and {sizes[1]} px")
    left, right = Eye(rig.left, views.R_view_left, views.K), Eye(rig.camera("right"), views.R_view_right, views.K)
    return Pair(left, right, views.baseline_m, (left.small_map(), right.small_map()))


def small(image: Image, small_map: Map | None) -> Image:
    """The picture shrunk, and turned into the small view where it is none."""
    shrunk = cv2.resize(image, small_size(image.shape[1], image.shape[0]), interpolation=cv2.INTER_AREA)
    turned = shrunk if small_map is None else cv2.remap(shrunk, *small_map, interpolation=cv2.INTER_LINEAR)
    return turned.astype(np.uint8, copy=False)
