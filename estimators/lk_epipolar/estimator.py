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
    """Direction of motion from the tracks of the left camera, its length from stereo."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the calibration. Raises VobenchError for a rig that is no stereo pair."""
        cv2.setRNGSeed(seed)
        self._settings = parameters(Settings, params, "lk_epipolar")
        self._pair = stereo_pair(rig, "lk_epipolar")
        self._offset = DisparityOffset()
        self._last: View | None = None  # the view that corners are followed from, ...
        self._disparity: Array = np.zeros(0)  # ... their disparities (N,) in px, NaN for unknown, ...
        self._T_odom_last: Array = np.eye(4)  # ... and its pose, in the view's axes
        self._T_odom_before = self._T_odom_now = np.eye(4)  # the last two poses

    def process(self, frame: Frame) -> Result:
        """Look, follow the corners of the last view, find the motion between the two, step on."""
        view = self._look(frame)
        if view is None:
            return Result(None, Status.LOST, "few_corners")  # a black picture is not worth remembering
        if self._last is None:
            self._remember(view)
            return Result(self._pose, Status.INIT)

        # Lucas-Kanade from the last picture to this one.
        matches = self._follow(self._last, view)
        if len(matches.x0) < self._settings.min_tracks:
            return self._lost(view, "few_tracks", matches)

        # No flow, no motion; since the last view is kept, creeping adds up until it shows.
        if matches.flow_px < self._settings.min_flow_px:
            self._T_odom_before = self._T_odom_now = self._T_odom_last
            return Result(self._pose, Status.STATIONARY, "no_flow", *told(matches))

        return self._move(view, matches)

    @property
    def _pose(self) -> Array:
        return self._pair.T_left(self._T_odom_now)

    def _move(self, view: View, matches: Matches) -> Result:
        """Take the two views apart; let stereo choose and measure; refine; step on."""
        # Every motion that the essential matrix or the homography allows; the one stereo agrees with.
        views = two_views(matches, self._settings.ransac_px)
        motion = best_motion(views.shapes, matches)
        if motion is None:
            return self._lost(view, "no_scale" if views.shapes else "no_model", matches)

        # Off a plane, and where hardly anything moves, tracks and depths together know more than either matrix does.
        s = self._settings
        if views.h_ratio < s.refine_below_h_ratio or matches.flow_px < s.refine_below_px:
            motion = refined(motion, matches, views.inlier)
        if motion.transfer_px > s.lost_above_px:
            return self._lost(view, "transfer_error", matches)
        return self._step(view, matches, views, motion)

    def _look(self, frame: Frame) -> View | None:
        """The corners of the left picture; None where there is too little to see."""
        if frame.left is None or frame.right is None:
            return None
        s = self._settings
        corners = corners_per_cell(
            frame.left, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px
        )
        corners = corners[self._pair.seen(corners)]
        return View(frame.left, frame.right, corners) if len(corners) >= s.min_tracks else None

    def _follow(self, last: View, view: View) -> Matches:
        """Tracks from the last view's corners to this picture, looked for where the motion so far would bring them."""
        pair = self._pair
        rho = (self._disparity - self._offset.px) / self._pair.focal_baseline
        T_now_last = se3.inverse(carried_on(self._T_odom_before, self._T_odom_now)) @ self._T_odom_last
        guess = predicted(pair.left, last.corners, rho, T_now_last)
        earlier, now = comparable(last.left, view.left)
        there, found = follow_predicted(earlier, now, last.corners, guess, window_px=self._settings.window_px)
        good = found & inside(there, view.left, self._settings.margin_px) & pair.seen(there)
        uv0 = last.corners[good].astype(float)
        uv1 = there[good].astype(float)
        return Matches(pair.left.rays(uv0), pair.left.rays(uv1), uv0, uv1, rho[good], pair.K)

    def _step(self, view: View, matches: Matches, views: TwoViews, motion: Motion) -> Result:
        """Chain the motion on the pose of the last view."""
        self._T_odom_before = self._T_odom_now
        T_odom_now = self._T_odom_last @ se3.inverse(motion.T_now_last)
        # Thousands of products drift off SO(3) by rounding.
        self._T_odom_now = se3.transform(se3.nearest_rotation(T_odom_now[:3, :3]), T_odom_now[:3, 3])
        if matches.flow_px >= self._settings.keep_below_px:
            if self._settings.estimate_offset:
                raw = matches.rho * self._pair.focal_baseline + self._offset.px
                self._offset = self._offset.after(matches.x0, matches.x1, raw, motion.T_now_last, self._pair)
            self._remember(view)
        tracks, stats = told(matches, views.inlier)
        stats |= {"h_ratio": views.h_ratio, "transfer_px": motion.transfer_px}
        stats |= {"offset_px": self._offset.px, "offset_guess_px": self._offset.estimate_px}
        if motion.transfer_px > self._settings.degraded_above_px:
            return Result(self._pose, Status.DEGRADED, "transfer_error", tracks, stats)
        return Result(self._pose, Status.OK, "", tracks, stats)

    def _remember(self, view: View) -> None:
        """Follow the next frame from this view, at the pose of now, with disparities from left to right."""
        self._last = view
        self._T_odom_last = self._T_odom_now
        s = self._settings
        _, self._disparity = self._pair.match(
            view.left, view.right, view.corners, margin_px=s.margin_px, window_px=s.window_px
        )

    def _lost(self, view: View, reason: str, matches: Matches) -> Result:
        """No pose for this frame; the next one carries on from here with the last pose there was."""
        self._remember(view)
        return Result(None, Status.LOST, reason, stats={"tracks": len(matches.x0)})


def told(matches: Matches, inlier: Mask | None = None) -> tuple[Tracks, dict[str, float]]:
    """What a person sees of one frame: the tracks, and how many and how long they are."""
    inlier = np.ones(len(matches.x0), bool) if inlier is None else inlier
    numbers = {
        "tracks": len(inlier),
        "stereo": int(np.isfinite(matches.rho).sum()),
        "inliers": int(inlier.sum()),
        "parallax_px": matches.flow_px,
    }
    return Tracks(matches.uv0_px, matches.uv1_px, inlier), numbers
