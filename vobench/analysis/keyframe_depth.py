"""Dense depth of the keyframes of a recording, from stereo matching and from the other keyframes.

view   the rectified left view of a stereo pair, as in `vobench.estimator.stereo`, but with all that the camera records
rho    the inverse depth in a view, in 1/m; NaN where it is unknown
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from vobench.analysis.image_noise import denoised, noise_dn
from vobench.analysis.stereo_matches import PairShot
from vobench.estimator.stereo import OUTSIDE_PX, Eye, StereoPair
from vobench.geometry.camera import pixel_grid
from vobench.geometry.se3 import Array, inverse
from vobench.rendering.array_types import Mask
from vobench.sequence.picture import Image

BLOCK_PX = 5
SUBPIXELS = 16.0  # the matcher returns disparities in 1/16 px
DISPARITY_STEP = 16  # the number of disparities is a multiple of it
SMOOTHNESS = (8, 32)  # penalties of a step of one disparity and of more, times the area of a block
UNIQUENESS_PERCENT = 5
SPECKLE_PX = 60  # smaller regions are errors
SPECKLE_RANGE = 2
CONSISTENT_PX = 1.0  # largest difference of disparities, from left to right and back
LEAST_DISPARITY_PX = 0.25  # points with less are as far away as with this

NOISY_DN = 1.5  # images with more noise are matched without it
REMOVED_SIGMAS = 1.5  # of their measured noise

MOST_MARGIN_SHARE = 0.25  # of the width and height, by which a view is extended on each side

NEIGHBOURS = 2  # keyframes before and after, from which depth is also taken
AGREEING_PX = 1.0  # of disparity
LARGEST_WEIGHT = 16.0


@dataclass(frozen=True, slots=True)
class Keyframe:
    """A keyframe: the image (H, W) of the left view, its inverse depth (H, W), and the pose of the view."""

    image: Image
    rho: Array
    T_world_view: Array


@dataclass(frozen=True, slots=True)
class ViewGeometry:
    """The pinhole of all left views, their size, and the disparity in px of a point at one metre.

    `is_recorded` (H, W) are the pixels that the image of the camera shows.
    """

    K: Array
    width_px: int
    height_px: int
    focal_baseline: float
    is_recorded: Mask

    @property
    def rho_of_px(self) -> float:
        """The inverse depth that corresponds to a disparity of one pixel."""
        return 1 / self.focal_baseline

    @property
    def least_rho(self) -> float:
        """The inverse depth of the farthest points."""
        return LEAST_DISPARITY_PX * self.rho_of_px

    def rays(self, pixels: Array) -> Array:
        """The rays (..., 3) with z = 1 through pixels (..., 2)."""
        homogeneous = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], -1)
        rays: Array = homogeneous @ np.linalg.inv(self.K).T
        return rays

    def contains(self, pixels: Array) -> Mask:
        """Whether pixels (..., 2) are in a view."""
        last_px = np.array([self.width_px, self.height_px]) - 1
        with np.errstate(invalid="ignore"):
            return np.asarray(((pixels >= 0) & (pixels <= last_px)).all(-1))

    def records(self, pixels: Array) -> Mask:
        """Whether pixels (..., 2) are in a view and recorded."""
        is_inside = self.contains(pixels)
        columns, rows = np.moveaxis(np.where(is_inside[..., None], pixels, 0).round().astype(int), -1, 0)
        return np.asarray(is_inside & self.is_recorded[rows, columns])

    def pixel_grid(self) -> Array:
        """The pixels (H, W, 2) of a view."""
        columns, rows = np.meshgrid(np.arange(self.width_px), np.arange(self.height_px))
        return np.stack([columns, rows], -1).astype(float)


def seen_from(other: Keyframe, own: Keyframe, pixels: Array, rho: Array, geometry: ViewGeometry) -> tuple[Array, Array]:
    """The pixels (N, 2) and depths (N,) at which another keyframe sees points of a keyframe; NaN behind its view.

    The points are at pixels (N, 2) of the keyframe, with inverse depths rho (N,).
    """
    T_other_own = inverse(other.T_world_view) @ own.T_world_view
    # Of a point at depth 1 / rho, the image in the other view times its depth there and times rho.
    of_direction = geometry.K @ T_other_own[:3, :3] @ np.linalg.inv(geometry.K)
    of_translation = geometry.K @ T_other_own[:3, 3]
    scaled = pixels @ of_direction[:, :2].T + of_direction[:, 2] + rho[:, None] * of_translation
    relative_depth = np.where(scaled[:, 2] > 0, scaled[:, 2], np.nan)
    return scaled[:, :2] / relative_depth[:, None], relative_depth / rho


def view_geometry(pair: StereoPair) -> ViewGeometry:
    """The geometry of the left views of a pair, with margins for what a distorting lens records beyond the view."""
    camera = pair.left.camera
    margin_x_px, margin_y_px = _margins(pair.left)
    width_px = camera.width_px + 2 * margin_x_px
    height_px = camera.height_px + 2 * margin_y_px
    K = pair.K.copy()
    K[:2, 2] += [margin_x_px, margin_y_px]
    everything = np.ones((height_px, width_px), bool)
    geometry = ViewGeometry(K, width_px, height_px, pair.focal_baseline, everything)
    source_px = _in_camera(pair.left, geometry)
    last_px = np.array([camera.width_px, camera.height_px]) - 1
    with np.errstate(invalid="ignore"):
        is_recorded = np.asarray(((source_px >= -0.5) & (source_px <= last_px + 0.5)).all(-1))
    return replace(geometry, is_recorded=is_recorded)


def _margins(eye: Eye) -> tuple[int, int]:
    """By how many columns and rows the image of a camera exceeds its view."""
    camera = eye.camera
    in_view_px = eye.in_view(pixel_grid(camera).reshape(-1, 2))
    size_px = np.array([camera.width_px, camera.height_px])
    excess_px = np.maximum(-in_view_px, in_view_px - (size_px - 1))
    is_beyond_any_view = np.isnan(excess_px)
    largest_px = np.where(is_beyond_any_view, np.inf, excess_px).max(0)
    margin_x_px, margin_y_px = np.clip(np.floor(largest_px), 0, MOST_MARGIN_SHARE * size_px).astype(int).tolist()
    return margin_x_px, margin_y_px


def _in_camera(eye: Eye, geometry: ViewGeometry) -> Array:
    """The pixels (H, W, 2) of a camera that its view shows; NaN for those that it does not see."""
    rays = geometry.rays(geometry.pixel_grid())
    return eye.project(rays.reshape(-1, 3)).reshape(rays.shape[0], rays.shape[1], 2)


def keyframes_of(
    shots: Sequence[PairShot], pair: StereoPair, geometry: ViewGeometry, *, most_disparity_px: float
) -> list[Keyframe]:
    """The keyframes of shots with true poses, with depth that neighbours agree on and without holes.

    The pair is the true one, without errors of calibration, and the geometry is that of its left views.
    """
    left_map, right_map = (_map_of_view(eye, geometry) for eye in (pair.left, pair.right))
    disparities = _disparity_count(most_disparity_px, geometry.width_px)
    keyframes = []
    for shot in shots:
        assert shot.T_world_left is not None
        left = _resampled(shot.left, left_map)
        right = _resampled(shot.right, right_map)
        disparity_px = dense_disparity(*_for_matching(left, right), disparities)
        rho = np.maximum(disparity_px, LEAST_DISPARITY_PX) * geometry.rho_of_px
        rho = np.where(geometry.is_recorded, rho, np.nan)
        T_world_view = shot.T_world_left @ inverse(pair.T_view_left)
        keyframes.append(Keyframe(left, rho, T_world_view))
    agreed = [_agreed(index, keyframes, geometry) for index in range(len(keyframes))]
    return [
        replace(keyframe, rho=filled(rho, geometry.least_rho)) for keyframe, rho in zip(keyframes, agreed, strict=True)
    ]


# --- Images ---


def _map_of_view(eye: Eye, geometry: ViewGeometry) -> tuple[Array, Array]:
    """The columns and rows (H, W) in the image of a camera that its view shows, for OpenCV."""
    finite = np.nan_to_num(_in_camera(eye, geometry), nan=OUTSIDE_PX).astype(np.float32)
    return np.ascontiguousarray(finite[..., 0]), np.ascontiguousarray(finite[..., 1])


def _resampled(image: Image, source_map: tuple[Array, Array]) -> Image:
    return cv2.remap(image, *source_map, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE).astype(np.uint8, copy=False)


# --- Stereo ---


def _disparity_count(most_disparity_px: float, width_px: int) -> int:
    """The number of disparities that are searched."""
    steps = int(np.ceil(min(most_disparity_px, width_px / 2) / DISPARITY_STEP))
    return DISPARITY_STEP * max(steps, 1)


def dense_disparity(left: Image, right: Image, disparities: int) -> Array:
    """The disparities (H, W) of a rectified pair of images; NaN where both directions disagree.

    Source: Hirschmüller (2008), semi-global matching, as OpenCV implements it.
    """
    forward_px = _matched(left, right, disparities)
    backward_px = _matched(right[:, ::-1], left[:, ::-1], disparities)[:, ::-1]
    rows, columns = np.indices(forward_px.shape)
    matched_columns = np.nan_to_num(columns - forward_px, nan=-1.0).round().astype(int)
    is_inside = matched_columns >= 0
    back_px = backward_px[rows, np.maximum(matched_columns, 0)]
    with np.errstate(invalid="ignore"):
        is_consistent = is_inside & (np.abs(forward_px - back_px) <= CONSISTENT_PX)
    return np.where(is_consistent, forward_px, np.nan)


def _for_matching(left: Image, right: Image) -> tuple[Image, Image]:
    """A pair of images without noise that would be matched where there is no texture."""
    sigma_dn, _ = noise_dn(left)
    if sigma_dn <= NOISY_DN:
        return left, right
    return denoised(left, REMOVED_SIGMAS * sigma_dn), denoised(right, REMOVED_SIGMAS * sigma_dn)


def _matched(left: Image, right: Image, disparities: int) -> Array:
    """The disparities (H, W) in px of the left image; NaN without a match."""
    # OpenCV does not match the first columns, so the images are extended to the left.
    wide_left = cv2.copyMakeBorder(left, 0, 0, disparities, 0, cv2.BORDER_REPLICATE)
    wide_right = cv2.copyMakeBorder(right, 0, 0, disparities, 0, cv2.BORDER_REPLICATE)
    small, large = (penalty * BLOCK_PX**2 for penalty in SMOOTHNESS)
    matcher = cv2.StereoSGBM.create(
        0,
        disparities,
        BLOCK_PX,
        P1=small,
        P2=large,
        uniquenessRatio=UNIQUENESS_PERCENT,
        speckleWindowSize=SPECKLE_PX,
        speckleRange=SPECKLE_RANGE,
        mode=cv2.StereoSGBM_MODE_SGBM_3WAY,
    )
    raw = matcher.compute(wide_left, wide_right)[:, disparities:].astype(float)
    return np.where(raw >= 0, raw / SUBPIXELS, np.nan)


# --- Agreement of keyframes ---


def _agreed(index: int, keyframes: Sequence[Keyframe], geometry: ViewGeometry) -> Array:
    """The inverse depth (H, W) of a keyframe: the weighted mean of its own and that of neighbours that agree.

    A depth z' from a neighbour has the weight (z / z')⁴ relative to an own depth z, since the error of a depth grows
    with its square. Where the own depth is unknown, or no neighbour agrees but two neighbours agree with each other,
    theirs is taken.
    """
    own = keyframes[index]
    sources = [_Source(own.rho, np.where(np.isfinite(own.rho), 1.0, 0.0))]
    before = keyframes[max(index - NEIGHBOURS, 0) : index]
    after = keyframes[index + 1 : index + 1 + NEIGHBOURS]
    sources += [_source_from(own, other, geometry) for other in (*before, *after)]
    rho = np.stack([source.rho for source in sources])
    weight = np.stack([source.weight for source in sources])

    median = np.nanmedian(np.where(np.isfinite(rho).any(0), rho, 0.0), axis=0)
    with np.errstate(invalid="ignore"):
        is_agreeing = np.abs(rho - median) <= AGREEING_PX * geometry.rho_of_px
    count = is_agreeing.sum(0)
    total = np.where(is_agreeing, weight, 0.0).sum(0)
    weighted = np.where(is_agreeing, weight * np.nan_to_num(rho), 0.0).sum(0)
    known = np.isfinite(rho).sum(0)
    is_alone = (known == 1) & np.isfinite(own.rho)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where((count >= 2) | is_alone, weighted / total, np.nan)


@dataclass(frozen=True, slots=True)
class _Source:
    """Inverse depths (H, W) of a view, with weights (H, W)."""

    rho: Array
    weight: Array


def _source_from(own: Keyframe, other: Keyframe, geometry: ViewGeometry) -> _Source:
    """The points of another keyframe, as a keyframe sees them."""
    is_known = np.isfinite(other.rho)
    pixels, depth_m = seen_from(own, other, geometry.pixel_grid()[is_known], other.rho[is_known], geometry)
    nearest_px = pixels.round()
    is_seen = geometry.contains(nearest_px)
    columns, rows = nearest_px[is_seen].astype(int).T
    flat = rows * geometry.width_px + columns
    seen_rho = 1 / depth_m[is_seen]

    # The nearest point is seen, so points are written from the farthest to the nearest.
    order = np.argsort(seen_rho)
    rho = np.full(geometry.height_px * geometry.width_px, np.nan)
    weight = np.zeros_like(rho)
    rho[flat[order]] = seen_rho[order]
    relative = (other.rho[is_known][is_seen] / seen_rho) ** 4
    weight[flat[order]] = np.clip(relative[order], 1 / LARGEST_WEIGHT, LARGEST_WEIGHT)
    shape = (geometry.height_px, geometry.width_px)
    return _Source(rho.reshape(shape), weight.reshape(shape))


def filled(rho: Array, least_rho: float) -> Array:
    """Inverse depth (H, W) whose unknown values are those of the farther neighbour in their row or column.

    Values that nothing determines are the least.
    """
    by_rows = _of_farther_neighbour(rho)
    by_columns = _of_farther_neighbour(by_rows.T).T
    return np.where(np.isfinite(by_columns), by_columns, least_rho)


def _of_farther_neighbour(rho: Array) -> Array:
    """The same with unknown values of each row replaced by the smaller of the next known values on both sides."""
    height, width = rho.shape
    is_known = np.isfinite(rho)
    columns = np.arange(width)
    before = np.maximum.accumulate(np.where(is_known, columns, -1), axis=1)
    after = np.minimum.accumulate(np.where(is_known, columns, width)[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(height)[:, None]
    left = np.where(before >= 0, rho[rows, np.maximum(before, 0)], np.inf)
    right = np.where(after < width, rho[rows, np.minimum(after, width - 1)], np.inf)
    farther = np.minimum(left, right)
    return np.where(is_known, rho, np.where(np.isfinite(farther), farther, np.nan))
