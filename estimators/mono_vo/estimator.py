"""Visual odometry with one camera: the first step has the length one, and the scale drifts from there."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vobench.plugin import (
    Array,
    Eye,
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
    pose_from_points,
    predicted,
    se3,
)

CONFIDENCE = 0.9999
NOISE_PX = 0.1  # standard deviation of a track; with the parallax it gives that of a depth
KNOWN_SHARE = 0.2  # a depth is known if the sigma of its inverse is below this share of the inverse
MOST_CERTAIN_SHARE = 0.005  # the least sigma of an inverse depth, as a share: views differ by more than noise
FARTHEST = 1000.0  # in units of length: the parallax of points beyond is noise
INLIER_PX = 1.0  # of the first motion
LEAST_INLIER_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Settings:
    """The parameters of the manifest."""

    corners_per_cell: int
    corner_distance_px: float
    margin_px: int
    window_px: int
    min_tracks: int
    min_flow_px: float
    begin_px: float
    keep_below_px: float
    ransac_px: float


@dataclass(frozen=True, slots=True)
class View:
    """A picture and its corners (N, 2), with inverse depths (N,) in 1/unit and the certainty 1/sigma² (N,) of each."""

    image: Image
    corners: Points
    rho: Array
    certainty: Array

    @property
    def known(self) -> Mask:
        """Which depths are good enough to measure a motion with."""
        is_near = self.rho > 1 / FARTHEST
        is_certain = self.certainty * (KNOWN_SHARE * self.rho) ** 2 > 1
        return is_near & is_certain


class MonoVo:
    """Measures the motion from corners with known depths, and the depths of other corners from the motion."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the left camera's lens."""
        cv2.setRNGSeed(seed)
        self._settings = parameters(Settings, params, "mono_vo")
        self._eye = Eye(rig.left, np.eye(3), rig.left.K)
        self._view: View | None = None
        self._T_odom_view = np.eye(4)
        self._T_odom_before = np.eye(4)
        self._T_odom_now = np.eye(4)

    def process(self, frame: Frame) -> Result:
        """Track the view's corners, estimate the motion, and carry the depths over to a new view."""
        if frame.left is None:
            return Result(None, Status.LOST, "no_picture")
        if self._view is None:
            return self._begin(frame.left)

        view = self._view
        there, good = self._follow(view, frame.left)
        if good.sum() < self._settings.min_tracks:
            self._begin(frame.left)
            return Result(None, Status.LOST, "few_tracks")

        flow_px = median_flow_px(view.corners[good], there[good])
        has_depth = view.known.any()
        if not has_depth and flow_px < self._settings.begin_px:
            return Result(self._T_odom_now, Status.INIT, "no_depth")
        if flow_px < self._settings.min_flow_px:
            self._T_odom_before = self._T_odom_view
            self._T_odom_now = self._T_odom_view
            return Result(self._T_odom_now, Status.STATIONARY, "no_flow")
        return self._step(frame.left, view, there, good)

    def _step(self, image: Image, view: View, there: Points, good: Mask) -> Result:
        """Chain the motion since the view onto its pose; take a new view if the old one is far away."""
        flow_px = median_flow_px(view.corners[good], there[good])
        motion = self._motion(view, there, good)
        if motion is None:
            self._begin(image)
            return Result(None, Status.LOST, "no_model")
        T_now_view, inlier = motion

        self._T_odom_before = self._T_odom_now
        T_odom_now = self._T_odom_view @ se3.inverse(T_now_view)
        R_odom_now = se3.nearest_rotation(T_odom_now[:3, :3])
        self._T_odom_now = se3.transform(R_odom_now, T_odom_now[:3, 3])
        if flow_px >= self._settings.keep_below_px:
            self._renew(view, image, there, good, T_now_view)

        uv_last_px = view.corners[good].astype(float)
        uv_px = there[good].astype(float)
        stats = {
            "tracks": int(good.sum()),
            "inliers": int(inlier.sum()),
            "parallax_px": flow_px,
            "depths": int((view.known & good).sum()),
        }
        tracks = Tracks(uv_last_px, uv_px, inlier[good])
        return Result(self._T_odom_now, Status.OK, "", tracks, stats)

    def _follow(self, view: View, image: Image) -> tuple[Points, Mask]:
        """Where the view's corners (N, 2) are in a picture, and which were found; the motion so far is the guess."""
        T_odom_guess = carried_on(self._T_odom_before, self._T_odom_now)
        T_guess_view = se3.inverse(T_odom_guess) @ self._T_odom_view
        rho = np.where(view.known, view.rho, np.nan)
        guess = predicted(self._eye, view.corners, rho, T_guess_view)

        earlier, now = comparable(view.image, image)
        there, found = follow_predicted(earlier, now, view.corners, guess, window_px=self._settings.window_px)
        is_inside = inside(there, image, self._settings.margin_px)
        has_ray = np.isfinite(self._eye.rays(there)).all(1)
        return there, found & is_inside & has_ray

    def _motion(self, view: View, there: Points, good: Mask) -> tuple[Array, Mask] | None:
        """T_now_view and its inliers (N,): by known depths or, without any, by epipolar geometry at length one."""
        inlier = np.zeros(len(good), bool)
        if not view.known.any():
            rows = np.flatnonzero(good)
            rays_view = self._eye.rays(view.corners[rows])
            rays_now = self._eye.rays(there[rows])
            first = first_motion(rays_view, rays_now, self._eye.K)
            if first is None:
                return None
            T_now_view, inlier_of_rows = first
            inlier[rows] = inlier_of_rows
            return T_now_view, inlier

        rows = np.flatnonzero(good & view.known)
        if len(rows) < self._settings.min_tracks:
            return None
        points = self._eye.rays(view.corners[rows]) / view.rho[rows, None]  # (M, 3), in units, the view's axes
        uv_now = self._eye.in_view(there[rows])
        fit = pose_from_points(points, uv_now, self._eye.K, ransac_px=self._settings.ransac_px)
        if fit is None:
            return None
        inlier[rows] = fit.inlier
        return fit.T_now_last, inlier

    def _renew(self, view: View, image: Image, there: Points, good: Mask, T_now_view: Array) -> None:
        """Take this picture as the view: depths, improved by the parallax, are carried over, and new corners added."""
        rays_view = self._eye.rays(view.corners[good])
        rays_now = self._eye.rays(there[good])
        rho_seen, certainty_seen = triangulated(rays_view, rays_now, T_now_view, float(self._eye.K[0, 0]))

        # Both depths are weighed by their certainties.
        certainty_before = view.certainty[good]
        certainty = certainty_seen + certainty_before
        weighted = certainty_seen * rho_seen + certainty_before * view.rho[good]
        rho = weighted / np.maximum(certainty, np.finfo(float).tiny)

        # A length of one along the old axis is z along the new one.
        z = moved_rays(rays_view, rho, T_now_view)[:, 2]
        rho_now = rho / z
        least_sigma = MOST_CERTAIN_SHARE * np.maximum(np.abs(rho_now), 1e-9)
        certainty_now = np.minimum(certainty * z**4, least_sigma**-2.0)

        is_ahead = (z > 0) & (rho_now > -1 / FARTHEST)
        self._view = self._added(image, there[good][is_ahead], rho_now[is_ahead], certainty_now[is_ahead])
        self._T_odom_view = self._T_odom_now

    def _added(self, image: Image, corners: Points, rho: Array, certainty: Array) -> View:
        """A view of these corners, and of new ones of unknown depth where there are none yet."""
        s = self._settings
        new = corners_per_cell(image, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px)

        is_taken = np.zeros(image.shape, np.uint8)
        for u, v in corners.round().astype(int).tolist():
            cv2.circle(is_taken, (u, v), int(s.corner_distance_px), 255, -1)
        columns, rows = new.round().astype(int).T
        is_free = is_taken[rows, columns] == 0
        has_ray = np.isfinite(self._eye.rays(new)).all(1)
        new = new[is_free & has_ray]

        unknown = np.zeros(len(new))
        all_corners = np.concatenate([corners, new])
        return View(image, all_corners, np.r_[rho, unknown], np.r_[certainty, unknown])

    def _begin(self, image: Image) -> Result:
        """Start again at the last pose, with another unit of length; with too few corners, wait."""
        no_corners = np.zeros((0, 2), np.float32)
        no_depths = np.zeros(0)
        fresh = self._added(image, no_corners, no_depths, no_depths)
        if len(fresh.corners) < self._settings.min_tracks:
            return Result(None, Status.LOST, "few_corners")
        self._view = fresh
        self._T_odom_view = self._T_odom_now
        self._T_odom_before = self._T_odom_now
        return Result(self._T_odom_now, Status.INIT)


def median_flow_px(before: Points, now: Points) -> float:
    """Median length of tracks (N, 2)."""
    lengths_px = np.linalg.norm(now - before, axis=1)
    return float(np.median(lengths_px))


def first_motion(rays_view: Array, rays_now: Array, K: Array) -> tuple[Array, Mask] | None:
    """The motion of length 1 between two views that has most inliers, and these (N,); None if fewer than half are.

    Candidates are those of the essential matrix and of the homography, since the points may lie on a plane.
    Source: Nistér (2004); Malis and Vargas (2007).
    """
    uv_view = (rays_view @ K.T)[:, :2]
    uv_now = (rays_now @ K.T)[:, :2]
    best_motion: Array | None = None
    best_inlier = np.zeros(len(rays_view), bool)
    for T_now_view in _candidates(uv_view, uv_now, K):
        inlier = _inliers(T_now_view, rays_view, rays_now, float(K[0, 0]))
        if best_motion is None or inlier.sum() > best_inlier.sum():
            best_motion = T_now_view
            best_inlier = inlier
    if best_motion is None or best_inlier.mean() < LEAST_INLIER_SHARE:
        return None
    return best_motion, best_inlier


def _candidates(uv_view: Array, uv_now: Array, K: Array) -> Iterator[Array]:
    E, _ = cv2.findEssentialMat(uv_view, uv_now, K, cv2.USAC_MAGSAC, prob=CONFIDENCE, threshold=1.0)
    if E is not None and len(E) >= 3 and np.isfinite(E).all():
        R_a, R_b, t = cv2.decomposeEssentialMat(E[:3])
        for R in (R_a, R_b):
            for sign in (1, -1):
                yield se3.transform(R, sign * t.ravel())

    H, _ = cv2.findHomography(uv_view, uv_now, cv2.USAC_MAGSAC, 1.0, confidence=CONFIDENCE)
    if H is not None and np.isfinite(H).all():
        _, rotations, translations, _ = cv2.decomposeHomographyMat(H, K)
        for R, t in zip(rotations, translations, strict=True):
            length = float(np.linalg.norm(t))
            if length > 0:
                R_nearest = se3.nearest_rotation(R.astype(float))
                yield se3.transform(R_nearest, t.ravel() / length)


def _inliers(T_now_view: Array, rays_view: Array, rays_now: Array, focal_px: float) -> Mask:
    """Which points (N,) lie in front of both views and are seen where the motion predicts, to a pixel."""
    rho, _ = triangulated(rays_view, rays_now, T_now_view, focal_px)
    points = moved_rays(rays_view, rho, T_now_view)
    z = points[:, 2]
    slopes = points[:, :2] / points[:, 2:]
    error_px = np.linalg.norm(slopes - rays_now[:, :2], axis=1) * focal_px
    is_ahead = (rho > 0) & (z > 0)
    inlier: Mask = is_ahead & (error_px < INLIER_PX)
    return inlier


def moved_rays(rays_view: Array, rho: Array, T_now_view: Array) -> Array:
    """Points (N, 3) on rays of a view with inverse depths (N,), in the present axes, times rho."""
    R = T_now_view[:3, :3]
    t = T_now_view[:3, 3]
    moved: Array = rays_view @ R.T + rho[:, None] * t
    return moved


def triangulated(rays_view: Array, rays_now: Array, T_now_view: Array, focal_px: float) -> tuple[Array, Array]:
    """Inverse depths (N,) along the view's axis, and 1/sigma² (N,): least squares in x_now ~ R x_view + rho t.

    Both components of the residual are linear in rho: a rho - b = 0.
    """
    turned = rays_view @ T_now_view[:3, :3].T
    t = T_now_view[:3, 3]
    slopes_now = rays_now[:, :2]
    a = t[:2] - slopes_now * t[2]
    b = slopes_now * turned[:, 2:] - turned[:, :2]
    aa = (a * a).sum(1)
    ab = (a * b).sum(1)
    rho = ab / np.maximum(aa, np.finfo(float).tiny)

    z = turned[:, 2] + rho * t[2]
    pixels_per_rho_squared = aa * (focal_px / NOISE_PX) ** 2
    certainty = pixels_per_rho_squared / np.maximum(z**2, 1e-9)
    return rho, certainty
