"""Stereo visual odometry from features that are detected in every picture and matched by their descriptors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.plugin import (
    Array,
    Frame,
    Image,
    Mask,
    PoseFit,
    Result,
    Rig,
    Status,
    Tracks,
    VobenchError,
    comparable,
    lucas_kanade,
    parameters,
    pose_from_points,
    se3,
    stereo_pair,
)

Descriptors = NDArray[Any]
Indices = NDArray[np.intp]
DETECTORS = ("orb", "sift")
MOST_REFINED_PX = 3.0  # a match that Lucas-Kanade moves farther is of another point


@dataclass(frozen=True, slots=True)
class Settings:
    """The parameters of the manifest that are numbers."""

    features: int
    fast_threshold: int
    row_px: float
    min_points: int
    min_flow_px: float
    keep_below_px: float
    ransac_px: float
    window_px: int


@dataclass(frozen=True, slots=True)
class Matches:
    """Points of the last view that this view shows, too.

    `last_px` and `now_px` are their left pixels (N, 2). `last_disparity_px` and `now_disparity_px` are their
    disparities (N,); the current one is NaN if the right picture has no match.
    """

    last_px: Array
    now_px: Array
    last_disparity_px: Array
    now_disparity_px: Array


@dataclass(frozen=True, slots=True)
class View:
    """A left picture and its features: pixels (N, 2), descriptors (N, D), and disparities (N,) in px, NaN for none."""

    left: Image
    uv_px: Array
    descriptors: Descriptors
    disparity_px: Array


class FeatureVo:
    """Matches the features of each pair with those of the last view and fits the motion to their points."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the calibration. Raises VobenchError for a rig that is not a stereo pair, or an unknown detector."""
        cv2.setRNGSeed(seed)
        name = params.get("detector")
        if name not in DETECTORS:
            raise VobenchError(f"feature_vo: detector is {name!r}, expected one of {', '.join(DETECTORS)}")
        numbers = {key: value for key, value in params.items() if key != "detector"}
        s = parameters(Settings, numbers, "feature_vo")
        self._settings = s
        self._pair = stereo_pair(rig, "feature_vo")
        self._detector: cv2.Feature2D
        if name == "orb":
            self._detector = cv2.ORB.create(s.features, fastThreshold=s.fast_threshold)
            self._matcher = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)
        else:
            self._detector = cv2.SIFT.create(s.features)
            self._matcher = cv2.BFMatcher(cv2.NORM_L2, crossCheck=True)
        # The positions of SIFT have fractions; those of ORB are whole pixels of a level of its pyramid.
        self._is_refining = name == "orb" and s.window_px > 0
        self._last: View | None = None
        # Poses in the view's axes.
        self._T_odom_last = np.eye(4)
        self._T_odom_now = np.eye(4)

    def process(self, frame: Frame) -> Result:
        """Detect features, match them with the last view's, and fit the motion to the matched points."""
        if frame.left is None or frame.right is None:
            return Result(None, Status.LOST, "no_picture")
        view = self._look(frame.left, frame.right)
        if np.isfinite(view.disparity_px).sum() < self._settings.min_points:
            return Result(None, Status.LOST, "few_features")
        if self._last is None:
            self._last = view
            return Result(np.eye(4), Status.INIT)

        last = self._last
        of_last, of_view = self._matched(last.descriptors, view.descriptors)
        flow_px = 0.0
        if len(of_view):
            lengths_px = np.linalg.norm(view.uv_px[of_view] - last.uv_px[of_last], axis=1)
            flow_px = float(np.median(lengths_px))
        if len(of_view) >= self._settings.min_points and flow_px < self._settings.min_flow_px:
            self._T_odom_now = self._T_odom_last
            return Result(self._pair.T_left(self._T_odom_now), Status.STATIONARY, "no_flow")

        matches = self._refined(last, view, of_last, of_view)
        fit = self._fit(matches)
        if fit is None:
            self._last = view
            self._T_odom_last = self._T_odom_now
            return Result(None, Status.LOST, "no_model", stats={"tracks": len(matches.now_px)})
        tracks = Tracks(matches.last_px, matches.now_px, fit.inlier)
        return self._step(view, fit, flow_px, tracks)

    def _look(self, left: Image, right: Image) -> View:
        """Features of both pictures; a left one has a disparity if a right one matches it in the same row."""
        uv_left_px, descriptors_left = self._features(left)
        uv_right_px, descriptors_right = self._features(right)
        of_left, of_right = self._matched(descriptors_left, descriptors_right)
        left_px = uv_left_px[of_left]
        right_px, is_refined = self._subpixel(left, right, left_px, uv_right_px[of_right])
        columns_px, rows_px = (self._pair.left.in_view(left_px) - self._pair.right.in_view(right_px)).T
        with np.errstate(invalid="ignore"):
            is_same_row = np.abs(rows_px) < self._settings.row_px
            is_ahead = columns_px > self._settings.row_px
        is_match = is_refined & is_same_row & is_ahead

        disparity_px = np.full(len(uv_left_px), np.nan)
        disparity_px[of_left[is_match]] = columns_px[is_match]
        return View(left, uv_left_px, descriptors_left, disparity_px)

    def _features(self, image: Image) -> tuple[Array, Descriptors]:
        keypoints, descriptors = self._detector.detectAndCompute(image, None)
        if descriptors is None:
            return np.zeros((0, 2)), np.zeros((0, 1), np.uint8)
        uv_px = np.array([keypoint.pt for keypoint in keypoints], float)
        return uv_px, descriptors

    def _matched(self, queries: Descriptors, candidates: Descriptors) -> tuple[Indices, Indices]:
        """Indices (M,) and (M,) of descriptors that are each other's nearest."""
        if not len(queries) or not len(candidates):
            return np.zeros(0, np.intp), np.zeros(0, np.intp)
        matches = self._matcher.match(queries, candidates)
        of_queries = np.array([match.queryIdx for match in matches], np.intp)
        of_candidates = np.array([match.trainIdx for match in matches], np.intp)
        return of_queries, of_candidates

    def _refined(self, last: View, view: View, of_last: Indices, of_view: Indices) -> Matches:
        """Matches whose points have a depth in the last view, with sub-pixel positions in this one."""
        has_depth = np.isfinite(last.disparity_px[of_last])
        of_last = of_last[has_depth]
        of_view = of_view[has_depth]
        last_px = last.uv_px[of_last]
        now_px, is_refined = self._subpixel(last.left, view.left, last_px, view.uv_px[of_view])
        return Matches(
            last_px=last_px[is_refined],
            now_px=now_px[is_refined],
            last_disparity_px=last.disparity_px[of_last[is_refined]],
            now_disparity_px=view.disparity_px[of_view[is_refined]],
        )

    def _subpixel(self, image: Image, other: Image, points_px: Array, matched_px: Array) -> tuple[Array, Mask]:
        """The sub-pixel positions (N, 2) of matches of points (N, 2), and which matches (N,) Lucas-Kanade confirms.

        In a street, steps that are fitted to positions as ORB detects them have several times the error.
        """
        if not self._is_refining or not len(points_px):
            return matched_px, np.ones(len(points_px), bool)
        image, other = comparable(image, other)
        refined_px, is_found = lucas_kanade(
            image,
            other,
            points_px.astype(np.float32),
            matched_px.astype(np.float32),
            window_px=self._settings.window_px,
            levels=0,
        )
        moved_px = np.linalg.norm(refined_px - matched_px, axis=1)
        return refined_px.astype(float), is_found & (moved_px < MOST_REFINED_PX)

    def _fit(self, matches: Matches) -> PoseFit | None:
        """The motion that brings the last view's points to this view's features; None if there is none."""
        if len(matches.now_px) < self._settings.min_points:
            return None
        return pose_from_points(
            self._pair.points(matches.last_px, matches.last_disparity_px),
            self._pair.left.in_view(matches.now_px),
            self._pair.K,
            disparity_px=matches.now_disparity_px,
            baseline_m=self._pair.baseline_m,
            ransac_px=self._settings.ransac_px,
        )

    def _step(self, view: View, fit: PoseFit, flow_px: float, tracks: Tracks) -> Result:
        """Chain the motion onto the pose of the last view; take a new view if that one is far away."""
        T_odom_now = self._T_odom_last @ se3.inverse(fit.T_now_last)
        R_odom_now = se3.nearest_rotation(T_odom_now[:3, :3])
        self._T_odom_now = se3.transform(R_odom_now, T_odom_now[:3, 3])
        if flow_px >= self._settings.keep_below_px:
            self._last = view
            self._T_odom_last = self._T_odom_now
        stats = {
            "tracks": len(fit.inlier),
            "inliers": int(fit.inlier.sum()),
            "error_px": fit.error_px,
        }
        return Result(self._pair.T_left(self._T_odom_now), Status.OK, "", tracks, stats)
