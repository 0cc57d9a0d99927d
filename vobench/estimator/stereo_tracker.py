"""Tracks the points of a stereo keyframe through later stereo pairs, in both cameras."""

from dataclasses import dataclass

import numpy as np

from vobench.estimator.disparity_offset import DisparityOffset
from vobench.estimator.pose import PoseFit, pose_from_points
from vobench.estimator.protocol import Image
from vobench.estimator.stereo import StereoPair, predicted, shifted_left
from vobench.estimator.tracking import (
    Mask,
    Points,
    comparable,
    corners_per_cell,
    follow_predicted,
    inside,
    lucas_kanade,
)
from vobench.geometry import se3
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerSettings:
    """How corners are selected and tracked.

    `corners_per_cell` is the largest number of corners in each cell of the grid of `tracking.corners_per_cell`.
    `corner_distance_px` is the smallest distance between two corners in a cell.
    `margin_px` is the smallest distance of a corner from the border, so that its window is inside of the picture.
    `window_px` is the side of the window that is tracked.
    `min_points` is the smallest number of points of a keyframe, and of tracks from which a pose is estimated.
    `ransac_px` is the largest reprojection error of an inlier.
    """

    corners_per_cell: int
    corner_distance_px: float
    margin_px: int
    window_px: int
    min_points: int
    ransac_px: float


@dataclass(frozen=True, slots=True)
class _KeyframePoints:
    """N points of a keyframe that have a measured disparity.

    `left_px` and `right_px` (N, 2) are the pixels of the points in both pictures.
    `disparity_px` (N,) are the measured disparities, which include the disparity offset.
    """

    left_px: Points
    right_px: Points
    disparity_px: Array

    def selected(self, mask: Mask) -> "_KeyframePoints":
        """The points for which the mask (N,) is set."""
        return _KeyframePoints(self.left_px[mask], self.right_px[mask], self.disparity_px[mask])


@dataclass(frozen=True, slots=True)
class _Keyframe:
    """A stereo pair of pictures, and the points in it that are tracked."""

    left: Image
    right: Image
    points: _KeyframePoints


@dataclass(frozen=True, slots=True, kw_only=True)
class StereoTracks:
    """N points of the keyframe that were tracked into the current stereo pair.

    `keyframe_left_px` and `left_px` (N, 2) are their pixels in the left pictures of the keyframe and of the pair.
    `keyframe_disparity_px` and `disparity_px` (N,) are the measured disparities, which include the disparity offset.
    A current disparity is NaN if the point is lost in the right picture.
    """

    keyframe_left_px: Points
    left_px: Points
    keyframe_disparity_px: Array
    disparity_px: Array

    @property
    def flow_px(self) -> float:
        """The median length of the tracks in the left picture; 0 without tracks."""
        if not len(self.left_px):
            return 0.0
        lengths_px = np.linalg.norm(self.left_px - self.keyframe_left_px, axis=1)
        return float(np.median(lengths_px))


class StereoTracker:
    """Tracks the points of one keyframe into each new stereo pair.

    Points are tracked from the left picture of the keyframe to the current one, and from the right picture to the
    current one, so that errors of the stereo calibration affect both pairs equally and cancel.

    `offset` is the current estimate of the disparity offset.
    In the methods, `T_now_keyframe` (4, 4) is the pose of the keyframe in the frame of the current left view.
    """

    def __init__(self, pair: StereoPair, settings: TrackerSettings) -> None:
        self._pair = pair
        self._settings = settings
        self._keyframe: _Keyframe | None = None
        self.offset = DisparityOffset()

    @property
    def has_keyframe(self) -> bool:
        """Whether there is a keyframe to track points from."""
        return self._keyframe is not None

    def set_keyframe(self, left: Image, right: Image) -> bool:
        """Make this pair the keyframe. If too few points have a depth, return False and keep the old keyframe."""
        settings = self._settings
        corners = corners_per_cell(
            left, settings.corners_per_cell, distance_px=settings.corner_distance_px, margin_px=settings.margin_px
        )
        corners = corners[self._pair.seen(corners)]
        right_px, disparity_px = self._pair.match(
            left, right, corners, margin_px=settings.margin_px, window_px=settings.window_px, with_edges=False
        )
        has_depth = np.isfinite(disparity_px)
        if has_depth.sum() < settings.min_points:
            return False
        points = _KeyframePoints(corners, right_px, disparity_px).selected(has_depth)
        self._keyframe = _Keyframe(left, right, points)
        return True

    def follow(self, left: Image, right: Image, T_now_keyframe: Array) -> StereoTracks:
        """Track the points of the keyframe into the current pair. The search starts at their predicted pixels.

        `T_now_keyframe` is the predicted pose. Raises RuntimeError if there is no keyframe.
        """
        keyframe = self._keyframe
        if keyframe is None:
            raise RuntimeError("there is no keyframe to follow points from; call set_keyframe() first")

        left_px, is_tracked = self._track_left(keyframe, left, T_now_keyframe)
        tracked_points = keyframe.points.selected(is_tracked)
        tracked_px = left_px[is_tracked]
        disparity_px = self._track_right(keyframe, tracked_points, right, tracked_px, T_now_keyframe)
        return StereoTracks(
            keyframe_left_px=tracked_points.left_px,
            left_px=tracked_px,
            keyframe_disparity_px=tracked_points.disparity_px,
            disparity_px=disparity_px,
        )

    def _track_left(self, keyframe: _Keyframe, left: Image, T_now_keyframe: Array) -> tuple[Points, Mask]:
        """The current pixels (N, 2) of the keyframe's points in the left picture, and which of them (N,) are found."""
        pair = self._pair
        points = keyframe.points
        inverse_depth = (points.disparity_px - self.offset.px) / pair.focal_baseline  # (N,), 1/m
        predicted_px = predicted(pair.left, points.left_px, inverse_depth, T_now_keyframe)
        keyframe_image, current_image = comparable(keyframe.left, left)
        left_px, is_found = follow_predicted(
            keyframe_image, current_image, points.left_px, predicted_px, window_px=self._settings.window_px
        )
        is_tracked = is_found & inside(left_px, left, self._settings.margin_px) & pair.seen(left_px)
        return left_px, is_tracked

    def _track_right(
        self,
        keyframe: _Keyframe,
        points: _KeyframePoints,
        right: Image,
        left_px: Points,
        T_now_keyframe: Array,
    ) -> Array:
        """The current disparities (N,) of those points of the keyframe that were tracked in the left picture.

        `left_px` (N, 2) are their current pixels in the left picture. The disparity of a point that is lost in the
        right picture is NaN.
        """
        if not len(left_px):
            return np.zeros(0)
        predicted_px = self._predicted_right_px(points, left_px, T_now_keyframe)
        # No forward-backward check: the robust fit reduces the weight of points whose two tracks are inconsistent.
        keyframe_image, current_image = comparable(keyframe.right, right)
        right_px, is_found = lucas_kanade(
            keyframe_image, current_image, points.right_px, predicted_px, window_px=self._settings.window_px
        )
        is_tracked = is_found & inside(right_px, right, self._settings.margin_px)
        return np.where(is_tracked, self._pair.disparity(left_px, right_px), np.nan)

    def _predicted_right_px(self, points: _KeyframePoints, left_px: Points, T_now_keyframe: Array) -> Points:
        """The predicted current pixels (N, 2) of points in the right picture, given those in the left picture.

        A point without a prediction gets its pixel in the keyframe.
        """
        pair = self._pair
        points_m = pair.points(points.left_px, points.disparity_px - self.offset.px)  # (N, 3), keyframe's left view
        depth_m = se3.apply(T_now_keyframe, points_m)[:, 2]
        predicted_disparity_px = pair.focal_baseline / depth_m + self.offset.px
        in_right_view = shifted_left(pair.left.in_view(left_px), predicted_disparity_px)
        right_px = pair.right.from_view(in_right_view)
        is_predicted = np.isfinite(right_px)
        return np.where(is_predicted, right_px, points.right_px).astype(np.float32)

    def fit(self, tracks: StereoTracks) -> PoseFit | None:
        """The pose T_now_keyframe, estimated from the tracks.

        None if there are fewer than `min_points` tracks, or if no pose fits them.
        """
        if len(tracks.left_px) < self._settings.min_points:
            return None
        return pose_from_points(
            self._pair.points(tracks.keyframe_left_px, tracks.keyframe_disparity_px - self.offset.px),
            self._pair.left.in_view(tracks.left_px),
            self._pair.K,
            disparity_px=tracks.disparity_px - self.offset.px,
            baseline_m=self._pair.baseline_m,
            ransac_px=self._settings.ransac_px,
        )

    def update_offset(self, tracks: StereoTracks, T_now_keyframe: Array) -> None:
        """Update the estimate of the disparity offset, given tracks and the estimated pose."""
        keyframe_rays = self._pair.left.rays(tracks.keyframe_left_px)
        rays = self._pair.left.rays(tracks.left_px)
        self.offset = self.offset.after(keyframe_rays, rays, tracks.keyframe_disparity_px, T_now_keyframe, self._pair)
