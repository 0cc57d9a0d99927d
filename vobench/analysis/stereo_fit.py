"""How far a stereo pair is off from its calibration: what its rows and its disparities say of the right eye.

x, y      a match's place in the right view over the focal length; fx, fy are those of both views
turned    by roll r to the right, pitch p upwards and yaw w to the right (the signs of `CalibrationError`), the right
          eye sees a point lower by fy (p (1 + y²) - r x - w x y) and further left by fx (w (1 + x²) - r y - p x y)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.estimator.pose import pose_from_points, twist
from vobench.estimator.tools import Mask, Points, StereoPair, comparable, corners_per_cell, follow, inside
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.sequence.picture import Image

MAD = 1.4826  # to a normal distribution's standard deviation
ROWS_APART_PX = 8.0  # beyond it a match is wrong
WINDOW_PX = 9  # small finds more; what it finds is refined with a larger one
REFINED_PX = 21
REFINE_STEPS = 5
SETTLED_PX = 0.05
STRAYED_PX = 1.5
# terms of how a patch's neighbourhood moves: disparity along x and y, or all
SLANT = 2
AFFINE = 4
DITHER = np.array([0.7548777, 0.5698403])  # of Roberts' R2 sequence: points evenly all over a pixel
CORNERS_PER_CELL = 30
CORNER_DISTANCE_PX = 8.0
MARGIN_PX = 12
FEWEST = 50  # matches, for a fit of five numbers
FIT_STEPS = 20
CORRELATED = 8.0  # matches near each other err alike: so many count as one
APART = 5  # pictures between the two views of a motion
# how well a true motion is known, of laser trackers and of cars
TRUTH_M = 3e-4
TRUTH_SHARE = 2e-3
TRUTH_RAD = 5e-4
MOST_YAW_DEG = 0.3  # rows that say more are of a lens
FEWEST_FOLLOWED = 40
LEAST_FLOW_PX = 2.0
OFFSET_STEPS = 6
DEPTH_STEPS = 2
MEDIAN_OF_TWO = 1.1774  # of the length of two normal numbers
DISPARITY_QUANTILES = (0.1, 0.5, 0.9)


@dataclass(frozen=True, slots=True)
class Uncertain:
    """A value and its standard deviation."""

    value: float
    sigma: float

    @property
    def is_plain(self) -> bool:
        """Whether it is 3 standard deviations from nothing."""
        return abs(self.value) > 3 * self.sigma


@dataclass(frozen=True, slots=True)
class Matches:
    """Stereo matches: places (N, 2) in the right view over the focal length, row errors and disparities (N,) in px.

    window (N,) says in which run of pictures each was found.
    """

    place: Array
    row_px: Array
    disparity_px: Array
    window: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class StereoFit:
    """A pair beside its told calibration: the right eye's turns, and what is left of the rows when they are undone.

    `row_mad_px` is of the rows as they are, `row_noise_px` of those without the fit a + b x + c y + d xy + e y²;
    `roll_deg` is of b, `pitch_deg` of a, `xy_px` is d; `yaw_deg` is of rows and motion where they agree, else of
    `yaw_from` alone, None where nothing tells; `gain` is right over left.
    """

    focal_px: float
    baseline_m: float
    matches: Matches
    row_mad_px: float
    row_noise_px: float
    coefficients: Array
    roll_deg: Uncertain
    pitch_deg: Uncertain
    xy_px: Uncertain
    gain: float
    disparity_px: tuple[float, ...]
    yaw_deg: Uncertain | None
    yaw_from: str

    @property
    def offset_px(self) -> Uncertain | None:
        """What all disparities in the middle of the picture are too large by, for that yaw."""
        if self.yaw_deg is None:
            return None
        return Uncertain(*(self.focal_px * np.deg2rad([self.yaw_deg.value, self.yaw_deg.sigma])).tolist())


@dataclass(frozen=True, slots=True)
class PairShot:
    """A left and a right picture, and where the left camera truly was: T_world_left, None where that is not known."""

    left: Image
    right: Image
    T_world_left: Array | None = None


def fit_pair(windows: Sequence[Sequence[PairShot]], pair: StereoPair) -> StereoFit | None:
    """What runs of successive shots say of a pair; None where too little matches."""
    matched = [[_matched(shot, pair) for shot in window] for window in windows]
    matches = _all_matches(matched, pair)
    if len(matches.row_px) < FEWEST:
        return None
    rows, sigma, noise_px = _robust_fit(_row_terms(matches.place), matches.row_px)
    usual = [_usual_rows(shot.left, shot.right, pair) for window in windows for shot in window[::3]]
    fx = float(pair.K[0, 0])
    fy = float(pair.K[1, 1])
    of_motion = _offset(matched, pair, np.array([-rows[1], rows[0]]) / fy)
    xy_px = Uncertain(float(rows[3]), float(sigma[3]))
    yaw_deg, yaw_from = _yaw(_degrees(-xy_px.value, xy_px.sigma, fy), of_motion and _degrees(*of_motion, fx))
    return StereoFit(
        focal_px=fx,
        baseline_m=pair.baseline_m,
        matches=matches,
        row_mad_px=_mad(np.concatenate(usual)),
        row_noise_px=noise_px,
        coefficients=rows,
        roll_deg=_degrees(-rows[1], sigma[1], fy),
        pitch_deg=_degrees(rows[0], sigma[0], fy),
        xy_px=xy_px,
        gain=float(np.nanmedian([_gain(shot) for window in matched for shot in window])),
        disparity_px=tuple(np.quantile(matches.disparity_px, DISPARITY_QUANTILES).tolist()),
        yaw_deg=yaw_deg,
        yaw_from=yaw_from,
    )


def _degrees(value_px: float, sigma_px: float, focal_px: float) -> Uncertain:
    return Uncertain(float(np.rad2deg(value_px / focal_px)), float(np.rad2deg(sigma_px / focal_px)))


def _yaw(of_rows: Uncertain, of_motion: Uncertain | None) -> tuple[Uncertain | None, str]:
    """The right eye's yaw in degrees, and what says so: a lens that is off moves rows as a yaw does, but not alone."""
    if of_motion is None:
        return (of_rows, "rows") if abs(of_rows.value) < MOST_YAW_DEG else (None, "")
    apart = abs(of_rows.value - of_motion.value)
    if apart > 3 * np.hypot(of_rows.sigma, of_motion.sigma):
        return of_motion, "motion"
    weights = of_rows.sigma**-2, of_motion.sigma**-2
    mean = (weights[0] * of_rows.value + weights[1] * of_motion.value) / sum(weights)
    return Uncertain(mean, sum(weights) ** -0.5), "rows and motion"


def _usual_rows(left: Image, right: Image, pair: StereoPair) -> Array:
    """Row errors (N,) in px as the bands were measured."""
    corners = _corners(left, pair)
    matched, disparity_px = pair.match(left, right, corners, margin_px=MARGIN_PX, row_px=ROWS_APART_PX)
    row_px: Array = (pair.right.in_view(matched) - pair.left.in_view(corners))[:, 1]
    return row_px[np.isfinite(disparity_px)]


def _corners(left: Image, pair: StereoPair) -> Points:
    corners = corners_per_cell(left, CORNERS_PER_CELL, distance_px=CORNER_DISTANCE_PX, margin_px=MARGIN_PX)
    return corners[pair.seen(corners)]


@dataclass(frozen=True, slots=True)
class Matched:
    """A pair of pictures, left and right pixels (N, 2) of its matches, and their disparities (N,) in px."""

    shot: PairShot
    left_px: Points
    right_px: Points
    disparity_px: Array


def _matched(shot: PairShot, pair: StereoPair) -> Matched:
    """The matches of a pair of pictures, of places between the pixels' middles."""
    corners = _corners(shot.left, pair)
    there, disparity_px = pair.match(
        shot.left, shot.right, corners, margin_px=MARGIN_PX, window_px=WINDOW_PX, row_px=ROWS_APART_PX
    )
    found = np.isfinite(disparity_px)
    shift = np.modf(np.arange(1, found.sum() + 1)[:, None] * DITHER)[0] - 0.5
    corners, there = (np.asarray(px[found] + shift, np.float32) for px in (corners, there))
    there, settled = refined(shot.left, shot.right, corners, there, shape=SLANT)
    disparity_px = pair.disparity(corners, there, row_px=ROWS_APART_PX)
    good = settled & np.isfinite(disparity_px)
    return Matched(shot, corners[good], there[good], disparity_px[good])


def _all_matches(windows: Sequence[Sequence[Matched]], pair: StereoPair) -> Matches:
    found = [(nth, shot) for nth, window in enumerate(windows) for shot in window]
    left_px, right_px, disparity_px = (
        np.concatenate([getattr(shot, px) for _, shot in found]) for px in ("left_px", "right_px", "disparity_px")
    )
    row_px = (pair.right.in_view(right_px) - pair.left.in_view(left_px))[:, 1]
    window = np.repeat(*np.array([(nth, len(shot.disparity_px)) for nth, shot in found]).T)
    return Matches(pair.right.rays(right_px)[:, :2], row_px, disparity_px, window)


def refined(image: Image, later: Image, points: Points, guess: Points, *, shape: int) -> tuple[Points, Mask]:
    """Where points (N, 2) went, by patches that also grow and shear, and whether that settled near the guess (N, 2).

    `shape` is SLANT or AFFINE. A window that only shifts leans to where slanted surfaces have their edges. Points on
    whole pixels would be sharper than what is found between them, which pulls shifts by a few percent: dither them.
    Source: Shi and Tomasi (1994); Baker and Matthews (2004), inverse compositional.
    """
    if not len(points):
        return points, np.zeros(0, bool)
    half = REFINED_PX // 2
    grid = np.stack(np.meshgrid(*[np.arange(-half, half + 1.0)] * 2), -1).reshape(-1, 2).astype(np.float32)
    weight = np.exp(-((grid / half) ** 2).sum(1))
    then = image.astype(np.float32)
    now = later.astype(np.float32)
    patch = _sampled(then, points[:, None] + grid)
    slopes = [_sampled(each, points[:, None] + grid) for each in np.gradient(then)[::-1]]
    terms = [*slopes, *(slope * along for slope in slopes for along in (grid / half).T)][: 2 + shape]
    jacobian = np.stack([*terms, patch - patch.mean(1, keepdims=True), np.ones_like(patch)], -1)
    weighted = np.swapaxes(jacobian * weight[:, None], 1, 2)
    hessian = weighted @ jacobian
    hessian += 1e-6 * np.trace(hessian, axis1=1, axis2=2)[:, None, None] * np.eye(hessian.shape[1])
    solve = np.linalg.solve(hessian, weighted).astype(np.float32)
    there = guess.astype(float)
    turn = np.tile(np.eye(2), (len(points), 1, 1))
    step = np.zeros((len(points), 2))
    for _ in range(REFINE_STEPS):
        seen = _sampled(now, there[:, None] + grid @ np.swapaxes(turn, 1, 2))
        change = (solve @ (seen - patch)[..., None])[..., 0]
        by_grid = np.zeros((len(points), 4))
        by_grid[:, :shape] = change[:, 2 : 2 + shape] / half
        undone = np.linalg.inv(np.eye(2) + by_grid.reshape(-1, 2, 2))
        step = (turn @ undone @ change[:, :2, None])[..., 0]
        there = there - step
        turn = turn @ undone
    settled = (np.linalg.norm(step, axis=1) < SETTLED_PX) & (np.linalg.norm(there - guess, axis=1) < STRAYED_PX)
    return there.astype(np.float32), settled


def _sampled(picture: NDArray[np.float32], at_px: NDArray[Any]) -> Array:
    """A picture's values (N, K) at pixels (N, K, 2)."""
    import cv2

    column, row = np.moveaxis(np.asarray(at_px, np.float32), -1, 0)
    return np.asarray(cv2.remap(picture, column, row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE))


def _gain(matched: Matched) -> float:
    """Median ratio of local means, right over left, around matches that are not burnt; NaN where none is."""
    import cv2

    means = []
    for picture, places in ((matched.shot.left, matched.left_px), (matched.shot.right, matched.right_px)):
        local = cv2.blur(picture.astype(np.float32), (2 * MARGIN_PX - 1, 2 * MARGIN_PX - 1))
        column, row = np.rint(places).astype(int).T
        means.append(local[row, column])
    even = (means[0] > 5) & (np.maximum(*means) < 240) if len(matched.left_px) else np.zeros(0, bool)
    return float(np.median(means[1][even] / means[0][even])) if even.any() else float("nan")


def _row_terms(place: Array) -> Array:
    """1, x, y, xy, y² (N, 5)."""
    x, y = place.T
    return np.stack([np.ones_like(x), x, y, x * y, y * y], -1)


def row_error(coefficients: Array, place: Array) -> Array:
    """The fitted row error (N,) in px at places (N, 2)."""
    error: Array = _row_terms(place) @ coefficients
    return error


def _robust_fit(terms: Array, values: Array) -> tuple[Array, Array, float]:
    """Coefficients (K,) of terms (N, K) by Cauchy's weights, their standard deviations, and the noise that is left."""
    solution = np.zeros(terms.shape[1])
    solution[0] = np.median(values)
    for _ in range(FIT_STEPS):
        rest = values - terms @ solution
        noise = max(_mad(rest), 1e-3)
        weight = 1 / (1 + (rest / (2.4 * noise)) ** 2)
        information = terms.T @ (weight[:, None] * terms) + 1e-9 * np.eye(terms.shape[1])
        step = np.linalg.solve(information, terms.T @ (weight * rest))
        solution = solution + step
        if np.abs(step).max() < 1e-6:
            break
    sigma = noise * np.sqrt(CORRELATED * np.diag(np.linalg.inv(information)))
    return solution, sigma, noise


def _mad(values: Array) -> float:
    return MAD * float(np.median(np.abs(values - np.median(values))))


@dataclass(frozen=True, slots=True)
class Followed:
    """Points seen at two times: the view's pixels (N, 2) then and later, disparities (N,) then, and the motion between.

    `information` (6, 6) is what is known of the motion's translation and turn beforehand.
    """

    before_px: Array
    after_px: Array
    disparity_px: Array
    T_after_before: Array
    information: Array


# What all motions share: offset of disparity (px), scale of disparities, centre (2, px) and focal length (ratio) of
# both eyes; and how far each may be off, which holds those that a motion tells nothing of.
SHARED = np.array([1.0, 0.006, 3.0, 3.0, 0.005])
MOTION_STEPS = np.array([1e-5, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6])
SHARED_STEPS = np.array([1e-3, 1e-5, 1e-3, 1e-3, 1e-6])


def _offset(windows: Sequence[Sequence[Matched]], pair: StereoPair, turns_rad: Array) -> tuple[float, float] | None:
    """How much too large disparities in the middle of the picture are, by the right eye's yaw, and how surely.

    Where a point goes says how far it is in units of the motion: all motions, and what both eyes and the pair are off
    by, are fitted together. `turns_rad` are the right eye's roll and pitch, as the rows have them.
    """
    runs = [window[first : first + APART + 1] for window in windows for first in range(len(window) - APART)]
    followed = [found for run in runs if (found := _follow(run, pair))]
    if not followed:
        return None
    shared = np.zeros(len(SHARED))
    motions = [each.T_after_before for each in followed]
    changed = [np.zeros(6) for _ in followed]
    held = np.diag(SHARED**-2)
    information = held
    for _ in range(OFFSET_STEPS):
        parts = [
            _normal_equations(each, T, moved=moved, shared=shared, pair=pair, turns_rad=turns_rad)
            for each, T, moved in zip(followed, motions, changed, strict=True)
        ]
        information = held.copy()
        rest = -held @ shared
        for A, b in parts:
            by_motion = np.linalg.solve(A[:6, :6], np.c_[A[:6, 6:], b[:6]])
            information += A[6:, 6:] - A[6:, :6] @ by_motion[:, :-1]
            rest += b[6:] - A[6:, :6] @ by_motion[:, -1]
        step = np.linalg.solve(information, rest)
        shared = shared + step
        steps = [np.asarray(np.linalg.solve(A[:6, :6], b[:6] - A[:6, 6:] @ step), float) for A, b in parts]
        motions = [_moved(T, each) for T, each in zip(motions, steps, strict=True)]
        changed = [before + each for before, each in zip(changed, steps, strict=True)]
    sigma_px = float(np.linalg.inv(information)[0, 0]) ** 0.5
    return (float(shared[0]), sigma_px) if sigma_px < SHARED[0] / 2 else None


def _normal_equations(
    followed: Followed, T: Array, *, moved: Array, shared: Array, pair: StereoPair, turns_rad: Array
) -> tuple[Array, Array]:
    """Matrix (11, 11) and right side (11,) of a motion and of what is shared, by Cauchy's weights.

    Every point's inverse depth is free: what its disparity and its flow say of it is taken out of them first.
    """

    def seen(T: Array, shared: Array, rho: Array) -> Array:
        return _seen(followed, T, shared, rho, pair=pair, turns_rad=turns_rad)

    measured = np.c_[followed.disparity_px, followed.after_px]
    rho = followed.disparity_px / pair.focal_baseline
    step = 1e-3 / pair.focal_baseline
    for _ in range(DEPTH_STEPS):
        expected = seen(T, shared, rho)
        by_rho = (seen(T, shared, rho + step) - expected) / step
        along = by_rho / np.linalg.norm(by_rho, axis=1, keepdims=True)
        residual = measured - expected
        rho = rho + np.einsum("ni,ni->n", by_rho, residual) / np.einsum("ni,ni->n", by_rho, by_rho)
    residual -= along * np.einsum("ni,ni->n", along, residual)[:, None]
    off_px = np.linalg.norm(residual, axis=1)
    noise_px = max(float(np.median(off_px)) / MEDIAN_OF_TWO, 0.03)
    weight = 1 / (1 + (off_px / (2.4 * noise_px)) ** 2) / (CORRELATED * noise_px**2)
    columns = [
        (seen(_moved(T, each), shared, rho) - seen(T, shared, rho)) / each.sum() for each in np.diag(MOTION_STEPS)
    ]
    columns += [(seen(T, shared + each, rho) - seen(T, shared, rho)) / each.sum() for each in np.diag(SHARED_STEPS)]
    jacobian = np.stack(columns, -1)
    jacobian -= along[..., None] * np.einsum("ni,nij->nj", along, jacobian)[:, None]
    A = np.einsum("nij,n,nik->jk", jacobian, weight, jacobian)
    b = np.einsum("nij,n,ni->j", jacobian, weight, residual)
    A[:6, :6] += followed.information
    b[:6] -= followed.information @ moved
    return A + 1e-9 * np.eye(len(A)), b


def _moved(T: Array, step: Array) -> Array:
    return se3.transform(twist(step)[:3, :3] @ T[:3, :3], T[:3, 3] + step[:3])


def _seen(followed: Followed, T: Array, shared: Array, rho: Array, *, pair: StereoPair, turns_rad: Array) -> Array:
    """Disparities before and the view's pixels later (N, 3) of points with inverse depths rho (N,) in 1/m."""
    offset_px, scale, *centre_px, focal = shared
    K = pair.K.copy()
    K[:2, :2] *= 1 + focal
    K[:2, 2] += centre_px
    rays = np.c_[followed.before_px, np.ones(len(rho))] @ np.linalg.inv(K).T
    x = rays[:, 0] - followed.disparity_px / K[0, 0]
    y = rays[:, 1]
    roll, pitch = turns_rad
    excess_px = offset_px * (1 + x * x) - K[0, 0] * (roll * y + pitch * x * y)
    there = rays @ T[:3, :3].T + rho[:, None] * T[:3, 3]
    seen: Array = np.c_[rho * pair.focal_baseline * (1 + scale) + excess_px, ((there / there[:, 2:]) @ K.T)[:, :2]]
    return seen


def _follow(shots: Sequence[Matched], pair: StereoPair) -> Followed | None:
    """The points of the first of successive shots in the last that keeps enough of them; None where none does."""
    first = last = shots[0].shot
    start = shots[0].left_px
    disparity_px = shots[0].disparity_px
    there = start
    for now in (later.shot for later in shots[1:]):
        moved, found = follow(*comparable(last.left, now.left), there, window_px=WINDOW_PX)
        found &= inside(moved, now.left, MARGIN_PX) & pair.seen(moved)
        if found.sum() < FEWEST_FOLLOWED:
            break
        start = start[found]
        there = moved[found]
        disparity_px = disparity_px[found]
        last = now
    if last is first:
        return None
    there, settled = refined(first.left, last.left, start, there, shape=AFFINE)
    start = start[settled]
    there = there[settled]
    disparity_px = disparity_px[settled]
    if settled.sum() < FEWEST_FOLLOWED:
        return None
    before_px = pair.left.in_view(start)
    after_px = pair.left.in_view(there)
    fit = pose_from_points(pair.points(start, disparity_px), after_px, pair.K, ransac_px=3.0)
    if fit is None or float(np.median(np.linalg.norm(after_px - before_px, axis=1))) < LEAST_FLOW_PX:
        return None
    kept = fit.inlier
    T = fit.T_now_last
    information = np.zeros((6, 6))
    if first.T_world_left is not None and last.T_world_left is not None:
        turn = pair.T_view_left
        T = turn @ se3.inverse(last.T_world_left) @ first.T_world_left @ se3.inverse(turn)
        sigma_m = TRUTH_M + TRUTH_SHARE * float(np.linalg.norm(T[:3, 3]))
        information = np.diag(np.repeat([sigma_m**-2, TRUTH_RAD**-2], 3))
    return Followed(before_px[kept], after_px[kept], disparity_px[kept], T, information)
