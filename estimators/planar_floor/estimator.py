"""One camera above a level floor: the camera's height gives the depth of points on the floor."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from vobench.plugin import (
    Array,
    Frame,
    Image,
    Mask,
    Points,
    Result,
    Rig,
    Status,
    Tracks,
    VobenchError,
    comparable,
    corners_per_cell,
    follow_predicted,
    inside,
    parameters,
    se3,
)

HYPOTHESES = 128  # steps from two points each, of which the one with most inliers is refined
ROBUST_PX = 0.15  # about the noise of a good track
UNSEEN_PX = 1e3  # residual of a point that the camera would not see
STEP_SCALE = (0.01, 0.01, 0.01)  # of x and y in m and psi in rad, for the trust region


@dataclass(frozen=True, slots=True)
class Settings:
    """The parameters of the manifest."""

    corners_per_cell: int
    corner_distance_px: float
    margin_px: int
    window_px: int
    min_points: int
    farthest_m: float
    ransac_px: float
    min_flow_px: float
    keep_below_px: float
    lost_below_share: float


@dataclass(frozen=True, slots=True)
class View:
    """A picture, its corners (N, 2) on the floor, and their positions (N, 2) there: x, y in m in the body's frame."""

    image: Image
    corners: Points
    ground_m: Array


class PlanarFloor:
    """Tracks corners of the floor and fits the body's step to them: a translation along x and y, a turn about z."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the camera and its mount. Raises VobenchError unless the camera is above the body's floor."""
        self._settings = parameters(Settings, params, "planar_floor")
        self._lens = rig.left
        self._T_body_left = rig.T_body_left
        if rig.T_body_left[2, 3] <= 0:
            height_m = rig.T_body_left[2, 3]
            raise VobenchError(f"planar_floor needs a camera above the floor of its body, got height {height_m:.3g} m")
        self._rng = np.random.default_rng(seed)
        self._view: View | None = None
        # x, y, psi of the view and of the last two frames, in odom
        self._view_pose = np.zeros(3)
        self._before = np.zeros(3)
        self._now = np.zeros(3)

    def process(self, frame: Frame) -> Result:
        """Track the view's corners, fit the step on the floor, and take a new view if the old one is far away."""
        if frame.left is None:
            return Result(None, Status.LOST, "no_picture")
        if self._view is None:
            return self._look(frame.left, Status.INIT, "few_corners")

        view = self._view
        there, good = self._follow(view, frame.left)
        if good.sum() < self._settings.min_points:
            return self._look(frame.left, Status.LOST, "few_tracks")

        lengths_px = np.linalg.norm(there[good] - view.corners[good], axis=1)
        flow_px = float(np.median(lengths_px))
        if flow_px < self._settings.min_flow_px:
            self._before = self._view_pose
            self._now = self._view_pose
            return Result(pose_matrix(self._now), Status.STATIONARY, "no_flow")

        uv_last_px = view.corners[good].astype(float)
        uv_px = there[good].astype(float)
        step, inlier = self._fitted(view.ground_m[good], uv_px)
        if inlier.mean() < self._settings.lost_below_share:
            return self._look(frame.left, Status.LOST, "no_plane")

        self._before = self._now
        self._now = compose(self._view_pose, step)
        if flow_px >= self._settings.keep_below_px:
            self._look(frame.left, Status.OK, "")
        tracks = Tracks(uv_last_px, uv_px, inlier)
        stats = {"tracks": len(inlier), "inliers": int(inlier.sum()), "parallax_px": flow_px}
        return Result(pose_matrix(self._now), Status.OK, "", tracks, stats)

    def _follow(self, view: View, image: Image) -> tuple[Points, Mask]:
        """Where the view's corners (N, 2) are in a picture, and which were found; the motion so far is the guess."""
        last_step = relative(self._before, self._now)
        pose_guess = compose(self._now, last_step)
        uv_guess = self._project(view.ground_m, relative(self._view_pose, pose_guess))
        guess = np.where(np.isfinite(uv_guess), uv_guess, view.corners).astype(np.float32)

        earlier, now = comparable(view.image, image)
        there, found = follow_predicted(earlier, now, view.corners, guess, window_px=self._settings.window_px)
        return there, found & inside(there, image, self._settings.margin_px)

    def _look(self, image: Image, status: Status, reason: str) -> Result:
        """Take a new view at the present pose; if it shows too little of the floor, keep the old one."""
        s = self._settings
        corners = corners_per_cell(image, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px)
        ground_m = self._on_floor(corners)
        is_on_floor = np.isfinite(ground_m).all(1)
        if is_on_floor.sum() < s.min_points:
            return Result(None, Status.LOST, "few_corners")
        self._view = View(image, corners[is_on_floor], ground_m[is_on_floor])
        self._view_pose = self._now
        T_odom_body = None if status is Status.LOST else pose_matrix(self._now)
        return Result(T_odom_body, status, reason)

    def _on_floor(self, uv_px: Points) -> Array:
        """Intersections (N, 2) of the rays of pixels (N, 2) with the floor, in the body's frame; NaN if too far."""
        R_body_left = self._T_body_left[:3, :3]
        camera_m = self._T_body_left[:3, 3]
        rays = self._lens.rays(uv_px) @ R_body_left.T  # (N, 3), body
        descent = np.where(rays[:, 2] < 0, -rays[:, 2], np.nan)
        distance = camera_m[2] / descent  # (N,), in lengths of the rays
        ground_m = camera_m[:2] + distance[:, None] * rays[:, :2]
        is_near = distance < self._settings.farthest_m
        return np.where(is_near[:, None], ground_m, np.nan)

    def _project(self, ground_m: Array, step: Array) -> Array:
        """The pixels (N, 2) of points (N, 2) on the floor after a step (3,) of the body."""
        T_left_last = se3.inverse(pose_matrix(step) @ self._T_body_left)
        points_m = np.c_[ground_m, np.zeros(len(ground_m))]  # (N, 3), the body's last frame
        return self._lens.project(se3.apply(T_left_last, points_m))

    def _fitted(self, ground_m: Array, uv_px: Array) -> tuple[Array, Mask]:
        """The step (3,) that brings points (N, 2) on the floor to pixels (N, 2), and its inliers (N,): RANSAC."""
        min_points = self._settings.min_points
        ransac_px = self._settings.ransac_px
        no_inlier = np.zeros(len(uv_px), bool)
        now_m = self._on_floor(uv_px.astype(np.float32))
        known = np.flatnonzero(np.isfinite(now_m).all(1))
        if len(known) < min_points:
            return np.zeros(3), no_inlier

        first, second = self._rng.choice(known, (2, HYPOTHESES))
        steps = steps_of_pairs(ground_m[first], ground_m[second], now_m[first], now_m[second])
        inliers = [self._error_px(step, ground_m, uv_px) < ransac_px for step in steps]
        best = int(np.argmax([inlier.sum() for inlier in inliers]))
        inlier = inliers[best]
        if inlier.sum() < min_points:
            return steps[best], no_inlier

        def cost(step: Array) -> Array:
            residual_px = self._project(ground_m[inlier], step) - uv_px[inlier]
            finite_px: Array = np.nan_to_num(residual_px, nan=UNSEEN_PX)
            return finite_px.ravel()

        step = least_squares(cost, steps[best], loss="cauchy", f_scale=ROBUST_PX, x_scale=STEP_SCALE).x
        return step, self._error_px(step, ground_m, uv_px) < ransac_px

    def _error_px(self, step: Array, ground_m: Array, uv_px: Array) -> Array:
        """Distances (N,) in px between the projections after a step and the pixels; infinite for an unseen point."""
        residual_px = self._project(ground_m, step) - uv_px
        distance_px = np.linalg.norm(residual_px, axis=1)
        return np.where(np.isfinite(distance_px), distance_px, np.inf)


def steps_of_pairs(a_last: Array, b_last: Array, a_now: Array, b_now: Array) -> Array:
    """The body's steps (M, 3) that explain two points (M, 2) each, seen in its last frame and in its present one."""
    ab_last = b_last - a_last
    ab_now = b_now - a_now
    heading_last = np.arctan2(ab_last[:, 1], ab_last[:, 0])
    heading_now = np.arctan2(ab_now[:, 1], ab_now[:, 0])
    turn = heading_last - heading_now
    c = np.cos(turn)
    s = np.sin(turn)
    x, y = a_now.T
    turned_x = c * x - s * y
    turned_y = s * x + c * y
    turned = np.stack([turned_x, turned_y], -1)
    steps: Array = np.c_[a_last - turned, np.arctan2(s, c)]
    return steps


def compose(pose: Array, step: Array) -> Array:
    """x, y, psi after a step (3,) in the pose's own axes."""
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    dx, dy, turn = step
    along_x = c * dx - s * dy
    along_y = s * dx + c * dy
    after: Array = pose + np.array([along_x, along_y, turn])
    return after


def relative(pose: Array, other: Array) -> Array:
    """The step (3,) from one pose to another, in the first one's axes."""
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    dx, dy, turn = other - pose
    forward = c * dx + s * dy
    left = -s * dx + c * dy
    return np.array([forward, left, turn])


def pose_matrix(pose: Array) -> Array:
    """The transform (4, 4) of x, y, psi on the plane."""
    x, y, psi = pose
    return se3.transform(se3.rotation_z(psi), [x, y, 0.0])
