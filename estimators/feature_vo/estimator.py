"""Stereo visual odometry from features that are found anew in every picture and told apart by their descriptors."""

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
    PoseFit,
    Result,
    Rig,
    Status,
    Tracks,
    VobenchError,
    parameters,
    pose_from_points,
    se3,
    stereo_pair,
)

Descriptors = NDArray[Any]
DETECTORS = ("orb", "sift")


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


@dataclass(frozen=True, slots=True)
class View:
    """Features of a stereo pair: left pixels (N, 2), descriptors (N, D), and disparities (N,) in px, NaN for none."""

    uv_px: Array
    descriptors: Descriptors
    disparity_px: Array


class FeatureVo:
    """Matches each pair's features with those of the last view and fits the motion to the points they stand for."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the calibration. Raises VobenchError for a rig that is no stereo pair, or a detector nobody knows."""
        cv2.setRNGSeed(seed)
        name = params.get("detector")
        if name not in DETECTORS:
            raise VobenchError(f"feature_vo: detector is {name!r}, expected one of {', '.join(DETECTORS)}")
        s = parameters(Settings, {key: value for key, value in params.items() if key != "detector"}, "feature_vo")
        self._settings = s
        self._pair = stereo_pair(rig, "feature_vo")
        is_orb = name == "orb"
        self._detector = (
            cv2.ORB.create(s.features, fastThreshold=s.fast_threshold) if is_orb else cv2.SIFT.create(s.features)
        )
        self._matcher = cv2.BFMatcher(cv2.NORM_HAMMING if is_orb else cv2.NORM_L2, crossCheck=True)
        self._last: View | None = None
        self._T_odom_last = self._T_odom_now = np.eye(4)  # in the view's axes

    def process(self, frame: Frame) -> Result:
        """Find features, match them with the last view's, fit the motion, take a new view when the old one is far."""
        if frame.left is None or frame.right is None:
            return Result(None, Status.LOST, "no_picture")
        view = self._look(frame.left, frame.right)
        if np.isfinite(view.disparity_px).sum() < self._settings.min_points:
            return Result(None, Status.LOST, "few_features")
        if self._last is None:
            self._last = view
            return Result(np.eye(4), Status.INIT)
        last = self._last
        before, now = self._matched(last.descriptors, view.descriptors)
        flow_px = float(np.median(np.linalg.norm(view.uv_px[now] - last.uv_px[before], axis=1))) if len(now) else 0.0
        if len(now) >= self._settings.min_points and flow_px < self._settings.min_flow_px:
            self._T_odom_now = self._T_odom_last
            return Result(self._pair.T_left(self._T_odom_now), Status.STATIONARY, "no_flow")
        known = np.isfinite(last.disparity_px[before])
        before = before[known]
        now = now[known]
        fit = self._fit(view, before, now)
        if fit is None:
            self._last = view
            self._T_odom_last = self._T_odom_now
            return Result(None, Status.LOST, "no_model", stats={"tracks": len(now)})
        tracks = Tracks(last.uv_px[before], view.uv_px[now], fit.inlier)
        return self._step(view, fit, flow_px, tracks)

    def _look(self, left: Image, right: Image) -> View:
        """Features of both pictures; a left one has a disparity where one of the right is alike and in its row."""
        (uv_px, descriptors) = self._features(left)
        (right_px, others) = self._features(right)
        disparity_px = np.full(len(uv_px), np.nan)
        of_left, of_right = self._matched(descriptors, others)
        shift = self._pair.left.in_view(uv_px[of_left]) - self._pair.right.in_view(right_px[of_right])
        with np.errstate(invalid="ignore"):
            good = (np.abs(shift[:, 1]) < self._settings.row_px) & (shift[:, 0] > self._settings.row_px)
        disparity_px[of_left[good]] = shift[good, 0]
        return View(uv_px, descriptors, disparity_px)

    def _features(self, image: Image) -> tuple[Array, Descriptors]:
        found, descriptors = self._detector.detectAndCompute(image, None)
        if descriptors is None:
            return np.zeros((0, 2)), np.zeros((0, 1), np.uint8)
        return np.array([feature.pt for feature in found], float), descriptors

    def _matched(self, one: Descriptors, other: Descriptors) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices (M,) and (M,) of descriptors that are each other's nearest."""
        if not len(one) or not len(other):
            return np.zeros(0, np.intp), np.zeros(0, np.intp)
        pairs = self._matcher.match(one, other)
        return np.array([m.queryIdx for m in pairs], np.intp), np.array([m.trainIdx for m in pairs], np.intp)

    def _fit(self, view: View, before: NDArray[np.intp], now: NDArray[np.intp]) -> PoseFit | None:
        """The motion that brings the last view's points to this view's features."""
        assert self._last is not None
        if len(now) < self._settings.min_points:
            return None
        return pose_from_points(
            self._pair.points(self._last.uv_px[before], self._last.disparity_px[before]),
            self._pair.left.in_view(view.uv_px[now]),
            self._pair.K,
            disparity_px=view.disparity_px[now],
            baseline_m=self._pair.baseline_m,
            ransac_px=self._settings.ransac_px,
        )

    def _step(self, view: View, fit: PoseFit, flow_px: float, tracks: Tracks) -> Result:
        """Chain the motion on the pose of the last view."""
        T_odom_now = self._T_odom_last @ se3.inverse(fit.T_now_last)
        self._T_odom_now = se3.transform(se3.nearest_rotation(T_odom_now[:3, :3]), T_odom_now[:3, 3])
        if flow_px >= self._settings.keep_below_px:
            self._last = view
            self._T_odom_last = self._T_odom_now
        stats = {"tracks": len(fit.inlier), "inliers": int(fit.inlier.sum()), "error_px": fit.error_px}
        return Result(self._pair.T_left(self._T_odom_now), Status.OK, "", tracks, stats)
