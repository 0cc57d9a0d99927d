"""What visual estimators share: corners, tracks, contrast, and a stereo pair of any two lenses.

view       a virtual pinhole at the left camera's centre, rectified: rows agree with the right one's, K is that of both
rays       (N, 3) with z = 1 in the view's axes
disparity  column in the left view less column in the right one, px; inverse depth rho = disparity / (K[0, 0] baseline)
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench import retired
from vobench.errors import VobenchError
from vobench.estimator.protocol import Image
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.rig import SIDES, Rig, rectification
from vobench.geometry.se3 import Array

Mask = NDArray[np.bool_]
Points = NDArray[np.float32]
Map = tuple[NDArray[np.float32], NDArray[np.float32]]
Kind = TypeVar("Kind")

GRID = (6, 4)  # cells across and down: corners everywhere, not only where the texture is best
CORNER_QUALITY = 0.01  # of the best corner in the cell
WINDOW_PX = 21
LEVELS = 3
LK_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01)
ROUND_TRIP_PX = 0.5  # forward and backward tracking must meet
# a guess so far away that finds fewer than this share is doubted
MISLED_PX = 5.0
MISLED_SHARE = 0.4
# sees disparities up to half the picture's width
COARSE_WIDTH_PX = 180
COARSE_DISPARITIES = 96
CONTRAST_WINDOW_PX = 31
CONTRAST_FLOOR = 4.0
BRIGHTNESS_JUMP = 0.1  # of the mean or the contrast, beyond which plain grey values mislead
# On the plane z = 1 a pixel grows with 1 / cos² of the angle to the axis; at 60° it is four times as tall.
WIDEST_COSINE = 0.5
ROW_PX = 1.0  # rectified: a point keeps its row from left to right
MIN_DISPARITY_PX = 0.5
NOWHERE_PX = -1e4
# A point on an edge of depth has the disparity of what is in front (foreground fattening: Scharstein, Szeliski 2002),
# the less the smaller the window: one that so small a window moves by more, and more than most, is left out.
SMALL_WINDOW_PX = 5
FATTENED_PX = 0.2
FATTENED_RATIO = 2.0


def parameters(kind: type[Kind], params: Mapping[str, Any], name: str) -> Kind:
    """A dataclass of numbers from a manifest's parameters.

    Raises VobenchError for a name that is no parameter, or a value that is no number.
    """
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    if set(params) != set(known):
        raise VobenchError(f"{name} takes the parameters {', '.join(known)}, got {', '.join(params)}")
    for key, value in params.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or value < 0:
            raise VobenchError(f"{name}: {key} is {value!r}, expected a number that is not negative")
    return kind(**params)


# --- Corners and tracks ---


def corners_per_cell(image: Image, per_cell: int, *, distance_px: float, margin_px: int) -> Points:
    """The best corners (N, 2) of each cell of the grid. Source: Shi and Tomasi (1994)."""
    height, width = image.shape
    columns = np.linspace(margin_px, width - margin_px, GRID[0] + 1).astype(int)
    rows = np.linspace(margin_px, height - margin_px, GRID[1] + 1).astype(int)
    corners: list[Points] = [np.zeros((0, 2), np.float32)]
    for top, bottom in pairwise(rows):
        for left, right in pairwise(columns):
            cell = np.ascontiguousarray(image[top:bottom, left:right])
            found = cv2.goodFeaturesToTrack(cell, per_cell, CORNER_QUALITY, distance_px) if cell.size else None
            if found is not None:
                corners.append(found.reshape(-1, 2).astype(np.float32) + np.array([left, top], np.float32))
    return np.concatenate(corners)


def follow(
    image: Image, later: Image, points: Points, guess: Points | None = None, *, window_px: int = WINDOW_PX
) -> tuple[Points, Mask]:
    """Where points (N, 2) went, and which of them come back when followed backwards.

    `guess` (N, 2) is where to look first. A small window is true to edges and slanted surfaces, a large one to
    noisy pictures. Source: Lucas and Kanade (1981), pyramids after Bouguet (2000).
    """
    if not len(points):
        return points, np.zeros(0, bool)
    there, found = lucas_kanade(image, later, points, points if guess is None else guess, window_px=window_px)
    back, returned = lucas_kanade(later, image, there, points, window_px=window_px)
    home = np.linalg.norm(back - points, axis=1) < ROUND_TRIP_PX
    return there, found & returned & home


def lucas_kanade(
    image: Image, later: Image, points: Points, guess: Points, *, window_px: int = WINDOW_PX, levels: int = LEVELS
) -> tuple[Points, Mask]:
    """Where points (N, 2) went, looked for around the guess (N, 2), and which were found."""
    there, status, _ = cv2.calcOpticalFlowPyrLK(
        image,
        later,
        points,
        guess.astype(np.float32),
        winSize=(window_px, window_px),
        maxLevel=levels,
        criteria=LK_STOP,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(there, np.float32), status.ravel() == 1


def follow_predicted(
    image: Image, later: Image, points: Points, guess: Points, *, window_px: int = WINDOW_PX
) -> tuple[Points, Mask]:
    """As `follow`, and once more without the guess where it misled: a motion that was predicted may have stopped."""
    there, found = follow(image, later, points, guess, window_px=window_px)
    far = len(points) > 0 and float(np.median(np.linalg.norm(guess - points, axis=1))) > MISLED_PX
    if not far or found.mean() >= MISLED_SHARE:
        return there, found
    again, found_again = follow(image, later, points, window_px=window_px)
    return (again, found_again) if found_again.sum() > found.sum() else (there, found)


def inside(points: Points, image: Image, margin_px: int) -> Mask:
    """Which points (N, 2) are at least `margin_px` within the picture."""
    height, width = image.shape
    limit = np.array([width - 1 - margin_px, height - 1 - margin_px])
    within: Mask = np.all((points >= margin_px) & (points <= limit), axis=1)
    return within


# --- Contrast ---


def comparable(image: Image, other: Image) -> tuple[Image, Image]:
    """Two pictures whose grey values may be compared: as they are, or as local contrast where gain or light differ."""
    statistics = [np.array(cv2.meanStdDev(picture)).ravel() for picture in (image, other)]
    if (np.abs(statistics[1] - statistics[0]) <= BRIGHTNESS_JUMP * statistics[0]).all():
        return image, other
    return local_contrast(image), local_contrast(other)


def local_contrast(image: Image) -> Image:
    """The picture less its local mean, over its local contrast: blind to brightness and gain."""
    window = (CONTRAST_WINDOW_PX, CONTRAST_WINDOW_PX)
    grey = image.astype(np.float32)
    mean = cv2.blur(grey, window)
    variance = np.maximum(cv2.blur(grey * grey, window) - mean * mean, 0)
    flat = (grey - mean) / (np.sqrt(variance) + CONTRAST_FLOOR)
    return np.clip(np.round(128 + 40 * flat), 0, 255).astype(np.uint8)


# --- A pair of any two lenses ---


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
        return self.project(np.c_[uv_px, np.ones(len(uv_px))] @ np.linalg.inv(self.K).T)

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
class StereoPair:
    """Both eyes, with the same view matrix K, and the distance between them. Pictures are used as they are."""

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
        """Which points (N, 2) of the left picture have a place in the view."""
        return np.asarray(np.isfinite(self.left.in_view(points)).all(1))

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
        """Places (N, 2) in the right picture of points (N, 2) in the left one, and disparities (N,), NaN for none.

        Rows of the view may differ by `row_px`. Points on edges of depth may be left out.
        """
        left, right = comparable(left, right)
        matched, found = follow(left, right, points, self._coarse(left, right, points), window_px=window_px)
        disparity_px = self.disparity(points, matched, row_px=row_px)
        good = found & inside(matched, right, margin_px) & np.isfinite(disparity_px)
        if not with_edges and good.any():
            closer, again = lucas_kanade(left, right, points, matched, window_px=SMALL_WINDOW_PX, levels=0)
            moved_px = np.abs(closer - matched)[:, 0]  # along rows, or nearly so
            good &= again & (moved_px < max(FATTENED_PX, FATTENED_RATIO * float(np.median(moved_px[good]))))
        return matched, np.where(good, disparity_px, np.nan)

    def disparity(self, points: Points, matched: Points, *, row_px: float = ROW_PX) -> Array:
        """Disparity (N,) in px of left and right pixels (N, 2); NaN where rows differ or it is too small."""
        shift = self.left.in_view(points) - self.right.in_view(matched)
        with np.errstate(invalid="ignore"):
            good = (np.abs(shift[:, 1]) < row_px) & (shift[:, 0] > MIN_DISPARITY_PX)
        return np.where(good, shift[:, 0], np.nan)

    def points(self, uv_px: ArrayLike, disparity_px: Array) -> Array:
        """Points (N, 3) in m, in the view's axes, of left pixels (N, 2) with a disparity."""
        with np.errstate(divide="ignore"):
            return self.left.rays(uv_px) * (self.focal_baseline / disparity_px)[:, None]

    def T_left(self, T_view: Array) -> Array:
        """A motion in the view's axes as the same motion in the left camera's."""
        turn = self.T_view_left
        return se3.inverse(turn) @ T_view @ turn

    @property
    def T_view_left(self) -> Array:
        """The left camera's pose in the view's axes: a turn."""
        return se3.transform(self.left.R_view_camera, np.zeros(3))

    def _coarse(self, left: Image, right: Image, points: Points) -> Points:
        """About where the points are in the right picture; their own place where nothing is known."""
        in_view = self.left.in_view(points)
        views = [_small(image, its_map) for image, its_map in zip((left, right), self.small_maps, strict=True)]
        shift = coarse_disparity(views[0], views[1], in_view, left.shape[1])
        guess = self.right.from_view(in_view - np.stack([shift, np.zeros_like(shift)], -1))
        return np.where(np.isfinite(guess), guess, points).astype(np.float32)


def stereo_pair(rig: Rig, name: str) -> StereoPair:
    """The pair of a rig. Raises VobenchError where it is none that looks the same way side by side."""
    views = rectification(rig)
    if views is None:
        position = ", ".join(f"{x:.4g}" for x in rig.T_left_right[:3, 3])
        turned_deg = np.rad2deg(se3.rotation_angle(rig.T_left_right[:3, :3]))
        raise VobenchError(
            f"{name} needs the right camera to the right of the left and both looking the same way, within 30 "
            f"deg; it is at ({position}) m and turned by {turned_deg:.3g} deg"
        )
    sizes = [(camera.width_px, camera.height_px) for camera in map(rig.camera, SIDES)]
    if sizes[0] != sizes[1]:
        raise VobenchError(f"{name} needs two pictures of one size, got {sizes[0]} and {sizes[1]} px")
    left = Eye(rig.left, views.R_view_left, views.K)
    right = Eye(rig.camera("right"), views.R_view_right, views.K)
    return StereoPair(left, right, views.baseline_m, (left.small_map(), right.small_map()))


def coarse_disparity(left: Image, right: Image, uv_px: Array, width_px: int) -> Array:
    """Disparity (N,) in px at places (N, 2) of a view `width_px` wide, from small pictures of both views.

    It sees far beyond what Lucas-Kanade would find on its own. Source: Hirschmüller (2008).
    """
    # The matcher skips columns from which the largest disparity would leave the picture: widen it.
    wide = [cv2.copyMakeBorder(image, 0, 0, COARSE_DISPARITIES, 0, cv2.BORDER_REPLICATE) for image in (left, right)]
    matcher = cv2.StereoSGBM.create(0, COARSE_DISPARITIES, 5, P1=200, P2=800, uniquenessRatio=5)
    coarse = matcher.compute(wide[0], wide[1])[:, COARSE_DISPARITIES:] / 16.0
    coarse[coarse < 0] = np.median(coarse[coarse >= 0]) if (coarse >= 0).any() else 0.0
    shrink = _shrinking(width_px)
    (height, width) = left.shape
    column, row = (np.nan_to_num(uv_px) / shrink).astype(int).T
    disparity_px: Array = coarse[row.clip(0, height - 1), column.clip(0, width - 1)] * shrink
    return disparity_px


def small_size(width_px: int, height_px: int) -> tuple[int, int]:
    """Width and height of a small picture."""
    return width_px // _shrinking(width_px), height_px // _shrinking(width_px)


def _shrinking(width_px: int) -> int:
    return max(1, round(width_px / COARSE_WIDTH_PX))


def _small(image: Image, small_map: Map | None) -> Image:
    """The picture shrunk, and turned into the small view where it is none."""
    shrunk = cv2.resize(image, small_size(image.shape[1], image.shape[0]), interpolation=cv2.INTER_AREA)
    turned = shrunk if small_map is None else cv2.remap(shrunk, *small_map, interpolation=cv2.INTER_LINEAR)
    return turned.astype(np.uint8, copy=False)


def predicted(eye: Eye, points: Points, rho: Array, T_now_last: Array) -> Points:
    """Where points (N, 2) with inverse depths rho (N,) come to lie if the view moves so; their own place if unknown.

    One without a depth (NaN) is taken to be as far away as most are.
    """
    known = np.isfinite(rho)
    rho = np.where(known, rho, np.median(rho[known]) if known.any() else 0.0)
    moved = eye.rays(points) @ T_now_last[:3, :3].T + rho[:, None] * T_now_last[:3, 3]
    there = eye.project(moved)
    return np.where(np.isfinite(there.sum(1, keepdims=True)), there, points).astype(np.float32)


if not TYPE_CHECKING:  # else every misspelt name would pass for one of ours

    def __getattr__(name):
        """A name that moved to `estimator/pose.py`, for one release."""
        return retired.lookup(__name__, name)
