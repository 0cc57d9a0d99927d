"""One camera over a level floor: points of the floor have a depth by the camera's height alone."""

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

HYPOTHESES = 128
ROBUST_PX = 0.15  # about the noise of a good track


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
    """A picture, its corners (N, 2) on the floor, and where on the floor they are (N, 2): x, y in m from the body."""

    image: Image
    corners: Points
    ground_m: Array


class PlanarFloor:
    """Follows corners, lays them on the floor, and fits a step along x and y and a turn about z to where they go."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the camera and its mount. Raises VobenchError where it is not above the body's floor."""
        self._settings = parameters(Settings, params, "planar_floor")
        self._lens = rig.left
        self._T_body_left = rig.T_body_left
        if rig.T_body_left[2, 3] <= 0:
            raise VobenchError(
                f"planar_floor needs a camera above the floor that its body stands on, and it is at "
                f"{rig.T_body_left[2, 3]:.3g} m"
            )
        self._rng = np.random.default_rng(seed)
        self._view: View | None = None
        self._view_pose = self._before = self._now = np.zeros(3)  # x, y, psi of the view and of the last two frames

    def process(self, frame: Frame) -> Result:
        """Follow the view's corners, fit the step on the floor, take a new view when the old one is far away."""
        if frame.left is None:
            return Result(None, Status.LOST, "no_picture")
        if self._view is None:
            return self._look(frame.left, Status.INIT, "few_corners")
        view = self._view
        s = self._settings
        step = relative(self._view_pose, compose(self._now, relative(self._before, self._now)))
        guess = self._project(view.ground_m, step)
        start = np.where(np.isfinite(guess), guess, view.corners).astype(np.float32)
        there, found = follow_predicted(*comparable(view.image, frame.left), view.corners, start, window_px=s.window_px)
        good = found & inside(there, frame.left, s.margin_px)
        if good.sum() < s.min_points:
            return self._look(frame.left, Status.LOST, "few_tracks")
        flow_px = float(np.median(np.linalg.norm(there[good] - view.corners[good], axis=1)))
        if flow_px < s.min_flow_px:
            self._before = self._now = self._view_pose
            return Result(placed(self._now), Status.STATIONARY, "no_flow")
        step, inlier = self._fitted(view.ground_m[good], there[good].astype(float))
        if inlier.mean() < s.lost_below_share:
            return self._look(frame.left, Status.LOST, "no_plane")
        self._before = self._now
        self._now = compose(self._view_pose, step)
        tracks = Tracks(view.corners[good].astype(float), there[good].astype(float), inlier)
        stats = {"tracks": len(inlier), "inliers": int(inlier.sum()), "parallax_px": flow_px}
        if flow_px >= s.keep_below_px:
            self._look(frame.left, Status.OK, "")
        return Result(placed(self._now), Status.OK, "", tracks, stats)

    def _look(self, image: Image, status: Status, reason: str) -> Result:
        """Take a new view at the pose of now; where it shows too little floor, keep the old one."""
        s = self._settings
        corners = corners_per_cell(image, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px)
        ground_m = self._on_floor(corners)
        near = np.isfinite(ground_m).all(1)
        if near.sum() < s.min_points:
            return Result(None, Status.LOST, "few_corners")
        self._view = View(image, corners[near], ground_m[near])
        self._view_pose = self._now
        return Result(None if status is Status.LOST else placed(self._now), status, reason)

    def _on_floor(self, uv_px: Points) -> Array:
        """Where the rays of pixels (N, 2) meet the floor: x, y (N, 2) from the body; NaN beyond what counts."""
        rays = self._lens.rays(uv_px) @ self._T_body_left[:3, :3].T
        camera = self._T_body_left[:3, 3]
        reach = camera[2] / np.where(rays[:, 2] < 0, -rays[:, 2], np.nan)
        ground_m = camera[:2] + reach[:, None] * rays[:, :2]
        return np.where((reach < self._settings.farthest_m)[:, None], ground_m, np.nan)

    def _project(self, ground_m: Array, step: Array) -> Array:
        """The pixels (N, 2) of places on the floor after a step (3,) of the body."""
        T_left_last = se3.inverse(placed(step) @ self._T_body_left)
        return self._lens.project(se3.apply(T_left_last, np.c_[ground_m, np.zeros(len(ground_m))]))

    def _fitted(self, ground_m: Array, uv_px: Array) -> tuple[Array, Mask]:
        """The step (3,) that brings places on the floor (N, 2) to pixels (N, 2), and which of them it explains."""
        now_m = self._on_floor(uv_px.astype(np.float32))
        known = np.flatnonzero(np.isfinite(now_m).all(1))
        if len(known) < self._settings.min_points:
            return np.zeros(3), np.zeros(len(uv_px), bool)
        a, b = self._rng.choice(known, (2, HYPOTHESES))
        steps = steps_of_pairs(ground_m[a], ground_m[b], now_m[a], now_m[b])
        errors = [self._error(step, ground_m, uv_px) for step in steps]
        counts = [(error < self._settings.ransac_px).sum() for error in errors]
        best = int(np.argmax(counts))
        inlier = errors[best] < self._settings.ransac_px
        if inlier.sum() < self._settings.min_points:
            return steps[best], np.zeros(len(uv_px), bool)

        def cost(step: Array) -> Array:
            off_px = self._project(ground_m[inlier], step) - uv_px[inlier]
            residual: Array = np.nan_to_num(off_px, nan=1e3).ravel()
            return residual

        fit = least_squares(cost, steps[best], loss="cauchy", f_scale=ROBUST_PX, x_scale=(0.01, 0.01, 0.01))
        return fit.x, self._error(fit.x, ground_m, uv_px) < self._settings.ransac_px

    def _error(self, step: Array, ground_m: Array, uv_px: Array) -> Array:
        """By how many px (N,) a step misses."""
        off_px: Array = np.linalg.norm(self._project(ground_m, step) - uv_px, axis=1)
        return np.where(np.isfinite(off_px), off_px, np.inf)


def steps_of_pairs(a0: Array, b0: Array, a1: Array, b1: Array) -> Array:
    """The body's steps (M, 3) that take two places on the floor (M, 2) each from where they were to where they are."""
    was = b0 - a0
    now = b1 - a1
    turn = np.arctan2(was[:, 1], was[:, 0]) - np.arctan2(now[:, 1], now[:, 0])
    c = np.cos(turn)
    s = np.sin(turn)
    turned = np.stack([c * a1[:, 0] - s * a1[:, 1], s * a1[:, 0] + c * a1[:, 1]], -1)
    steps: Array = np.c_[a0 - turned, np.arctan2(s, c)]
    return steps


def compose(pose: Array, step: Array) -> Array:
    """x, y, psi after a step (3,) in the pose's own axes."""
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    moved: Array = pose + np.array([c * step[0] - s * step[1], s * step[0] + c * step[1], step[2]])
    return moved


def relative(pose: Array, other: Array) -> Array:
    """The step (3,) from one pose to another, in the first one's axes."""
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    d = other - pose
    return np.array([c * d[0] + s * d[1], -s * d[0] + c * d[1], d[2]])


def placed(pose: Array) -> Array:
    """The transform of x, y, psi on the plane."""
    return se3.transform(se3.rotation_z(pose[2]), [pose[0], pose[1], 0.0])
