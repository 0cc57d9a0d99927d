"""Visual odometry with one camera: length is what the first step is taken for, and drifts."""

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
NOISE_PX = 0.1  # of a track: with its parallax it says how well a depth is known
KNOWN_SHARE = 0.2  # sigma of an inverse depth over itself, below which its point counts
MOST_CERTAIN_SHARE = 0.005  # no depth is known better: views differ by more than noise
FARTHEST = 1000.0  # in units: beyond it parallax is noise


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
    """A picture, its corners (N, 2), their inverse depths (N,) in 1/unit and how certain these are: 1/sigma² (N,)."""

    image: Image
    corners: Points
    rho: Array
    certainty: Array

    @property
    def known(self) -> Mask:
        """Which depths are good enough to measure a motion with."""
        return (self.rho > 1 / FARTHEST) & (self.certainty * (KNOWN_SHARE * self.rho) ** 2 > 1)


class MonoVo:
    """Each view's corners carry depths; what they say of the motion makes new depths by triangulation."""

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the left lens."""
        cv2.setRNGSeed(seed)
        self._settings = parameters(Settings, params, "mono_vo")
        self._eye = Eye(rig.left, np.eye(3), rig.left.K)
        self._view: View | None = None
        self._T_odom_view = self._T_odom_before = self._T_odom_now = np.eye(4)

    def process(self, frame: Frame) -> Result:
        """Follow the view's corners, find the motion, and carry the depths over to a new view."""
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
        if not view.known.any() and flow_px < self._settings.begin_px:
            return Result(self._T_odom_now, Status.INIT, "no_depth")
        if flow_px < self._settings.min_flow_px:
            self._T_odom_before = self._T_odom_now = self._T_odom_view
            return Result(self._T_odom_now, Status.STATIONARY, "no_flow")
        return self._step(frame.left, view, there, good)

    def _step(self, image: Image, view: View, there: Points, good: Mask) -> Result:
        """Chain the motion since the view on its pose, and take a new view when the old one is far away."""
        flow_px = median_flow_px(view.corners[good], there[good])
        motion = self._motion(view, there, good)
        if motion is None:
            self._begin(image)
            return Result(None, Status.LOST, "no_model")
        T_now_view, inlier = motion
        self._T_odom_before = self._T_odom_now
        T_odom_now = self._T_odom_view @ se3.inverse(T_now_view)
        self._T_odom_now = se3.transform(se3.nearest_rotation(T_odom_now[:3, :3]), T_odom_now[:3, 3])
        if flow_px >= self._settings.keep_below_px:
            self._renew(view, image, there, good, T_now_view)
        tracks = Tracks(view.corners[good].astype(float), there[good].astype(float), inlier[good])
        stats = {"tracks": int(good.sum()), "inliers": int(inlier.sum()), "parallax_px": flow_px}
        return Result(self._T_odom_now, Status.OK, "", tracks, stats | {"depths": int((view.known & good).sum())})

    def _follow(self, view: View, image: Image) -> tuple[Points, Mask]:
        """Where the view's corners are, looked for where the motion so far would bring them."""
        s = self._settings
        T_now_view = se3.inverse(carried_on(self._T_odom_before, self._T_odom_now)) @ self._T_odom_view
        guess = predicted(self._eye, view.corners, np.where(view.known, view.rho, np.nan), T_now_view)
        there, found = follow_predicted(*comparable(view.image, image), view.corners, guess, window_px=s.window_px)
        return there, found & inside(there, image, s.margin_px) & np.isfinite(self._eye.rays(there)).all(1)

    def _motion(self, view: View, there: Points, good: Mask) -> tuple[Array, Mask] | None:
        """T_now_view by the depths there are, or by epipolar geometry and a length of one; and who agrees (N,)."""
        known = np.flatnonzero(good & view.known)
        inlier = np.zeros(len(good), bool)
        if not view.known.any():
            found = np.flatnonzero(good)
            begun = first_motion(self._eye.rays(view.corners[found]), self._eye.rays(there[found]), self._eye.K)
            if begun is None:
                return None
            inlier[found] = begun[1]
            return begun[0], inlier
        if len(known) < self._settings.min_tracks:
            return None
        points = self._eye.rays(view.corners[known]) / view.rho[known, None]
        fit = pose_from_points(points, self._eye.in_view(there[known]), self._eye.K, ransac_px=self._settings.ransac_px)
        if fit is None:
            return None
        inlier[known] = fit.inlier
        return fit.T_now_last, inlier

    def _renew(self, view: View, image: Image, there: Points, good: Mask, T_now_view: Array) -> None:
        """Take this picture as the view: depths, bettered by the parallax, are carried over, new corners added."""
        rays0 = self._eye.rays(view.corners[good])
        rays1 = self._eye.rays(there[good])
        rho, certainty = triangulated(rays0, rays1, T_now_view, float(self._eye.K[0, 0]))
        joined = certainty + view.certainty[good]
        rho = (certainty * rho + view.certainty[good] * view.rho[good]) / np.maximum(joined, np.finfo(float).tiny)
        # One unit along the old axis is so many along the new one.
        z = (rays0 @ T_now_view[:3, :3].T + rho[:, None] * T_now_view[:3, 3])[:, 2]
        rho_now = rho / z
        certainty_now = np.minimum(joined * z**4, (MOST_CERTAIN_SHARE * np.maximum(np.abs(rho_now), 1e-9)) ** -2.0)
        kept = (z > 0) & (rho_now > -1 / FARTHEST)
        self._view = self._added(image, there[good][kept], rho_now[kept], certainty_now[kept])
        self._T_odom_view = self._T_odom_now

    def _added(self, image: Image, corners: Points, rho: Array, certainty: Array) -> View:
        """A view of these corners and of new ones, without depth, where there are none yet."""
        s = self._settings
        new = corners_per_cell(image, s.corners_per_cell, distance_px=s.corner_distance_px, margin_px=s.margin_px)
        taken = np.zeros(image.shape, np.uint8)
        for u, v in corners.round().astype(int).tolist():
            cv2.circle(taken, (u, v), int(s.corner_distance_px), 255, -1)
        free = taken[new[:, 1].round().astype(int), new[:, 0].round().astype(int)] == 0
        new = new[free & np.isfinite(self._eye.rays(new)).all(1)]
        unknown = np.zeros(len(new))
        return View(image, np.concatenate([corners, new]), np.r_[rho, unknown], np.r_[certainty, unknown])

    def _begin(self, image: Image) -> Result:
        """Begin anew at the pose of now, with another unit of length; where there is nothing to see, wait."""
        fresh = self._added(image, np.zeros((0, 2), np.float32), np.zeros(0), np.zeros(0))
        if len(fresh.corners) < self._settings.min_tracks:
            return Result(None, Status.LOST, "few_corners")
        self._view = fresh
        self._T_odom_view = self._T_odom_now
        self._T_odom_before = self._T_odom_now
        return Result(self._T_odom_now, Status.INIT)


def median_flow_px(before: Points, now: Points) -> float:
    """Median length of tracks (N, 2)."""
    return float(np.median(np.linalg.norm(now - before, axis=1)))


def first_motion(rays0: Array, rays1: Array, K: Array) -> tuple[Array, Mask] | None:
    """The motion of length 1 between two views that puts most points before both, and who agrees.

    Candidates are those of the essential matrix and of the homography, for points may lie on a plane.
    Source: Nistér (2004); Malis and Vargas (2007).
    """
    uv0, uv1 = ((rays @ K.T)[:, :2] for rays in (rays0, rays1))
    motions = list(_candidates(uv0, uv1, K))
    agrees = [_agrees(T, rays0, rays1, float(K[0, 0])) for T in motions]
    best = max(range(len(motions)), key=lambda k: int(agrees[k].sum()), default=None)
    if best is None or agrees[best].mean() < 0.5:
        return None
    return motions[best], agrees[best]


def _candidates(uv0: Array, uv1: Array, K: Array) -> Iterator[Array]:
    E, _ = cv2.findEssentialMat(uv0, uv1, K, cv2.USAC_MAGSAC, prob=CONFIDENCE, threshold=1.0)
    if E is not None and E.shape[0] >= 3 and np.isfinite(E).all():
        R_a, R_b, t = cv2.decomposeEssentialMat(E[:3])
        yield from (se3.transform(R, sign * t.ravel()) for R in (R_a, R_b) for sign in (1, -1))
    H, _ = cv2.findHomography(uv0, uv1, cv2.USAC_MAGSAC, 1.0, confidence=CONFIDENCE)
    if H is not None and np.isfinite(H).all():
        _, rotations, translations, _ = cv2.decomposeHomographyMat(H, K)
        for R, t in zip(rotations, translations, strict=True):
            length = float(np.linalg.norm(t))
            if length > 0:
                yield se3.transform(se3.nearest_rotation(R.astype(float)), t.ravel() / length)


def _agrees(T: Array, rays0: Array, rays1: Array, focal_px: float) -> Mask:
    """Which points (N,) lie before both views and are seen where the motion says, to a pixel."""
    rho, _ = triangulated(rays0, rays1, T, focal_px)
    moved = rays0 @ T[:3, :3].T + rho[:, None] * T[:3, 3]
    off_px = np.linalg.norm(moved[:, :2] / moved[:, 2:] - rays1[:, :2], axis=1) * focal_px
    agrees: Mask = (rho > 0) & (moved[:, 2] > 0) & (off_px < 1.0)
    return agrees


def triangulated(rays0: Array, rays1: Array, T_now_view: Array, focal_px: float) -> tuple[Array, Array]:
    """Inverse depths (N,) along the first view's axis, and 1/sigma² (N,): least squares in x1 ~ R x0 + rho t."""
    turned = rays0 @ T_now_view[:3, :3].T
    t = T_now_view[:3, 3]
    a = t[:2] - rays1[:, :2] * t[2]
    b = rays1[:, :2] * turned[:, 2:] - turned[:, :2]
    aa = (a * a).sum(1)
    rho = (a * b).sum(1) / np.maximum(aa, np.finfo(float).tiny)
    z = turned[:, 2] + rho * t[2]
    return rho, aa * (focal_px / NOISE_PX) ** 2 / np.maximum(z**2, 1e-9)
