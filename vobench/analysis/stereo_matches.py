"""Matches the left and right images of a stereo pair with sub-pixel accuracy."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.patch_refinement import SLANT, refined
from vobench.estimator.stereo import StereoPair
from vobench.estimator.tracking import Points, corners_per_cell
from vobench.geometry.se3 import Array
from vobench.sequence.picture import Image

MAX_ROW_PX = 8.0  # difference of rows of a match that is not wrong
WINDOW_PX = 9  # a small window finds more; its matches are refined with a larger one
DITHER = np.array([0.7548777, 0.5698403])  # of Roberts' R2 sequence, which covers a pixel evenly
CORNERS_PER_CELL = 30
CORNER_DISTANCE_PX = 8.0
MARGIN_PX = 12
MIN_EXPOSED_DN = 5  # darker and brighter surroundings say nothing about the gain
MAX_EXPOSED_DN = 240


@dataclass(frozen=True, slots=True)
class PairShot:
    """A left and a right image, and the true pose T_world_left of the left camera, None if it is unknown."""

    left: Image
    right: Image
    T_world_left: Array | None = None


@dataclass(frozen=True, slots=True)
class MatchedShot:
    """A stereo pair of images, the left and right pixels (N, 2) of its matches, and their disparities (N,) in px."""

    shot: PairShot
    left_px: Points
    right_px: Points
    disparity_px: Array


@dataclass(frozen=True, slots=True)
class Matches:
    """Stereo matches: places (N, 2) in the right view over the focal length, row errors and disparities (N,) in px.

    `window` (N,) is the number of the run of images in which each was found.
    """

    place: Array
    row_px: Array
    disparity_px: Array
    window: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class RowMatches:
    """Stereo matches: pixels (N, 2) of both images, row errors (N,) in px, and the runs (N,) that they belong to."""

    left_px: Array
    right_px: Array
    row_px: Array
    window: NDArray[np.int64]


def match_shots(shots: Sequence[PairShot], pair: StereoPair) -> list[MatchedShot]:
    """Match the left and right images of shots."""
    return [_match_shot(shot, pair) for shot in shots]


def _match_shot(shot: PairShot, pair: StereoPair) -> MatchedShot:
    """Match a pair of images at points between the centres of pixels."""
    corners = _corners(shot.left, pair)
    right_px, disparity_px = pair.match(
        shot.left, shot.right, corners, margin_px=MARGIN_PX, window_px=WINDOW_PX, row_px=MAX_ROW_PX
    )
    is_matched = np.isfinite(disparity_px)
    dither_px = _dither(int(is_matched.sum()))
    left_px = np.asarray(corners[is_matched] + dither_px, np.float32)
    guess_px = np.asarray(right_px[is_matched] + dither_px, np.float32)

    right_px, has_converged = refined(shot.left, shot.right, left_px, guess_px, shape=SLANT)
    disparity_px = pair.disparity(left_px, right_px, row_px=MAX_ROW_PX)
    is_good = has_converged & np.isfinite(disparity_px)
    return MatchedShot(shot, left_px[is_good], right_px[is_good], disparity_px[is_good])


def _corners(left: Image, pair: StereoPair) -> Points:
    """The corners (N, 2) of the left image that are inside of the left view."""
    corners = corners_per_cell(left, CORNERS_PER_CELL, distance_px=CORNER_DISTANCE_PX, margin_px=MARGIN_PX)
    return corners[pair.seen(corners)]


def _dither(count: int) -> Array:
    """Offsets (N, 2) within half a pixel."""
    numbers = np.arange(1, count + 1)[:, None]
    offsets: Array = np.modf(numbers * DITHER)[0] - 0.5
    return offsets


def all_matches(windows: Sequence[Sequence[MatchedShot]], pair: StereoPair) -> Matches:
    """Join the matches of all shots in runs of images."""
    rows = row_matches(windows, pair)
    disparity_px = np.concatenate([shot.disparity_px for window in windows for shot in window])
    places = pair.right.rays(rows.right_px)[:, :2]
    return Matches(places, rows.row_px, disparity_px, rows.window)


def row_matches(windows: Sequence[Sequence[MatchedShot]], pair: StereoPair) -> RowMatches:
    """Join the pixels and row errors of the matches of all shots in runs of images."""
    shots = [shot for window in windows for shot in window]
    left_px = np.concatenate([shot.left_px for shot in shots])
    right_px = np.concatenate([shot.right_px for shot in shots])
    counts = [_match_count(window) for window in windows]
    window_of_match = np.repeat(np.arange(len(windows)), counts)
    return RowMatches(left_px, right_px, _row_differences(left_px, right_px, pair), window_of_match)


def _match_count(window: Sequence[MatchedShot]) -> int:
    return sum(len(shot.disparity_px) for shot in window)


def _row_differences(left_px: Points, right_px: Points, pair: StereoPair) -> Array:
    """The differences (N,) between the rows of right and left pixels (N, 2) in the rectified views."""
    difference_px: Array = pair.right.in_view(right_px) - pair.left.in_view(left_px)
    return difference_px[:, 1]


def row_errors(shot: PairShot, pair: StereoPair) -> Array:
    """The row errors (N,) in px of unrefined matches, which are also used for the ranges of real images."""
    corners = _corners(shot.left, pair)
    matched, disparity_px = pair.match(shot.left, shot.right, corners, margin_px=MARGIN_PX, row_px=MAX_ROW_PX)
    return _row_differences(corners, matched, pair)[np.isfinite(disparity_px)]


def gain_of(matched: MatchedShot) -> float:
    """The median ratio of local means around matches, right over left; NaN if none is well exposed."""
    if not len(matched.left_px):
        return float("nan")
    left_dn = _local_means(matched.shot.left, matched.left_px)
    right_dn = _local_means(matched.shot.right, matched.right_px)
    is_exposed = (left_dn > MIN_EXPOSED_DN) & (np.maximum(left_dn, right_dn) < MAX_EXPOSED_DN)
    if not is_exposed.any():
        return float("nan")
    return float(np.median(right_dn[is_exposed] / left_dn[is_exposed]))


def _local_means(picture: Image, points: Points) -> NDArray[np.float32]:
    """The means (N,) of an image around points (N, 2)."""
    import cv2

    window_px = 2 * MARGIN_PX - 1
    means = cv2.blur(picture.astype(np.float32), (window_px, window_px))
    column, row = np.rint(points).astype(int).T
    return np.asarray(means[row, column])
