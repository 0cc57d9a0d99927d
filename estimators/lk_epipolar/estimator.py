"""Stereo visual odometry with Lucas-Kanade tracks and epipolar geometry."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vobench.plugin import (
    Array,
    DisparityOffset,
    Frame,
    Image,
    Mask,
    Points,
    Result,
    Rig,
    Status,
    Tracks,
    carried_on,
    comparable,
    corners_per_cell,
    follow_predicted,
    inside,
    parameters,
    predicted,
    se3,
    stereo_pair,
)

from .motion import Matches, Motion, TwoViews, best_motion, refined, two_views


@dataclass(frozen=True, slots=True)
class Settings:
    """The parameters of the manifest."""

    corners_per_cell: int
    corner_distance_px: float
    margin_px: int
    window_px: int
    min_tracks: int
    min_flow_px: float
    keep_below_px: float
    ransac_px: float
    refine_below_h_ratio: float
    refine_below_px: float
    degraded_above_px: float
    lost_above_px: float
    estimate_offset: int


@dataclass(frozen=True, slots=True)
class View:
    """A stereo pair and the corners (N, 2) of its left picture."""

    left: Image
    right: Image
    corners: Points


class LkEpipolar:
    """The direction of motion from the tracks of the left camera, and its length from stereo."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the calibration. Raises VobenchError for a rig that is not a stereo pair."""
        cv2.setRNGSeed(seed)
        self._settings = parameters(Settings, params, "lk_epipolar")
        self._pair = stereo_pair(rig, "lk_epipolar")
        self._offset = DisparityOffset()
        # The view that corners are tracked from, their disparities (N,), NaN if unknown, and its pose.
        self._last: View | None = None
        self._disparity_px: Array = np.zeros(0)
        self._T_odom_last: Array = np.eye(4)
        # The last two poses, in the view's axes.
        self._T_odom_before: Array = np.eye(4)
        self._T_odom_now: Array = np.eye(4)

    def process(self, frame: Frame) -> Result:
        """Detect corners, track those of the last view, and estimate the motion between the two views."""
        view = self._look(frame)
        if view is None:
            return Result(None, Status.LOST, "few_corners")  # a black picture does not become the view
        if self._last is None:
            self._remember(view)
            return Result(self._pose, Status.INIT)

        # Lucas-Kanade from the last picture to this one.
        matches = self._follow(self._last, view)
        if len(matches.x0) < self._settings.min_tracks:
            return self._lost(view, "few_tracks", matches)

        # No flow, no motion. The last view stays, so a slow motion adds up until it shows.
        if matches.flow_px < self._settings.min_flow_px:
            self._T_odom_before = self._T_odom_last
            self._T_odom_now = self._T_odom_last
            every_track = np.ones(len(matches.x0), bool)
            tracks = Tracks(matches.uv0_px, matches.uv1_px, every_track)
            return Result(self._pose, Status.STATIONARY, "no_flow", tracks, statistics(matches, every_track))

        return self._move(view, matches)

    @property
    def _pose(self) -> Array:
        return self._pair.T_left(self._T_odom_now)

    def _move(self, view: View, matches: Matches) -> Result:
        """Decompose the two views' geometry, choose and scale the motion by stereo, and refine it."""
        # Of all motions that the essential matrix or the homography allows, the one that agrees with stereo.
        views = two_views(matches, self._settings.ransac_px)
        motion = best_motion(views.shapes, matches)
        if motion is None:
            reason = "no_scale" if views.shapes else "no_model"
            return self._lost(view, reason, matches)

        # In a scene that is no plane, or with little flow, all tracks and depths fit the motion better than a matrix.
        s = self._settings
        is_off_plane = views.h_ratio < s.refine_below_h_ratio
        if is_off_plane or matches.flow_px < s.refine_below_px:
            motion = refined(motion, matches, views.inlier)
        if motion.transfer_px > s.lost_above_px:
            return self._lost(view, "transfer_error", matches)
        return self._step(view, matches, views, motion)

    def _look(self, frame: Frame) -> View | None:
        """The pictures with the corners of the left one; None if it has too few."""
        left = frame.left
        right = frame.right
        if left is None or right is None:
            return None
        s = self._settings
        corners = corners_per_cell(left, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px)
        corners = corners[self._pair.seen(corners)]
        if len(corners) < s.min_tracks:
            return None
        return View(left, right, corners)

    def _follow(self, last: View, view: View) -> Matches:
        """Tracks from the last view's corners to this picture; the motion so far is the guess."""
        pair = self._pair
        rho = (self._disparity_px - self._offset.px) / pair.focal_baseline
        T_odom_guess = carried_on(self._T_odom_before, self._T_odom_now)
        T_guess_last = se3.inverse(T_odom_guess) @ self._T_odom_last
        guess = predicted(pair.left, last.corners, rho, T_guess_last)

        earlier, now = comparable(last.left, view.left)
        there, found = follow_predicted(earlier, now, last.corners, guess, window_px=self._settings.window_px)
        is_inside = inside(there, view.left, self._settings.margin_px)
        good = found & is_inside & pair.seen(there)

        uv0_px = last.corners[good].astype(float)
        uv1_px = there[good].astype(float)
        return Matches(
            x0=pair.left.rays(uv0_px),
            x1=pair.left.rays(uv1_px),
            uv0_px=uv0_px,
            uv1_px=uv1_px,
            rho=rho[good],
            K=pair.K,
        )

    def _step(self, view: View, matches: Matches, views: TwoViews, motion: Motion) -> Result:
        """Chain the motion onto the pose of the last view; take a new view if that one is far away."""
        self._T_odom_before = self._T_odom_now
        T_odom_now = self._T_odom_last @ se3.inverse(motion.T_now_last)
        # Thousands of products drift off SO(3) by rounding.
        R_odom_now = se3.nearest_rotation(T_odom_now[:3, :3])
        self._T_odom_now = se3.transform(R_odom_now, T_odom_now[:3, 3])
        if matches.flow_px >= self._settings.keep_below_px:
            if self._settings.estimate_offset:
                self._learn_offset(matches, motion)
            self._remember(view)

        tracks = Tracks(matches.uv0_px, matches.uv1_px, views.inlier)
        stats = {
            **statistics(matches, views.inlier),
            "h_ratio": views.h_ratio,
            "transfer_px": motion.transfer_px,
            "offset_px": self._offset.px,
            "offset_guess_px": self._offset.estimate_px,
        }
        if motion.transfer_px > self._settings.degraded_above_px:
            return Result(self._pose, Status.DEGRADED, "transfer_error", tracks, stats)
        return Result(self._pose, Status.OK, "", tracks, stats)

    def _learn_offset(self, matches: Matches, motion: Motion) -> None:
        """Update the estimate of the pair's disparity offset."""
        measured_px = matches.rho * self._pair.focal_baseline + self._offset.px
        T_now_last = motion.T_now_last
        self._offset = self._offset.after(matches.x0, matches.x1, measured_px, T_now_last, self._pair)

    def _remember(self, view: View) -> None:
        """Track the next frame from this view, at the present pose, with disparities from left to right."""
        self._last = view
        self._T_odom_last = self._T_odom_now
        s = self._settings
        _, self._disparity_px = self._pair.match(
            view.left, view.right, view.corners, margin_px=s.margin_px, window_px=s.window_px
        )

    def _lost(self, view: View, reason: str, matches: Matches) -> Result:
        """No pose for this frame; the next frame starts from this view at the last known pose."""
        self._remember(view)
        return Result(None, Status.LOST, reason, stats={"tracks": len(matches.x0)})


def statistics(matches: Matches, inlier: Mask) -> dict[str, float]:
    """Numbers of one frame that are worth plotting."""
    return {
        "tracks": len(inlier),
        "stereo": int(np.isfinite(matches.rho).sum()),
        "inliers": int(inlier.sum()),
        "parallax_px": matches.flow_px,
    }
