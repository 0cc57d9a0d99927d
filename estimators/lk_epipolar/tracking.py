"""Corners, and where they went: Lucas-Kanade from picture to picture and from left to right."""

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.estimator.protocol import Image
from vobench.geometry.se3 import Array

Mask = NDArray[np.bool_]
Points = NDArray[np.float32]

GRID = (6, 4)  # cells across and down: corners everywhere, not only where the texture is best
CORNER_QUALITY = 0.01  # of the best corner in the cell
WINDOW_PX, PYRAMID_LEVELS = 21, 3
LK_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01)
ROUND_TRIP_PX = 0.5  # forward and backward tracking must meet
COARSE_WIDTH_PX, COARSE_DISPARITIES = 180, 96  # sees disparities up to half the picture's width
CONTRAST_WINDOW_PX, CONTRAST_FLOOR = 31, 4.0
BRIGHTNESS_JUMP = 0.1  # of the mean or the contrast, beyond which plain grey values mislead


def detect(image: Image, per_cell: int, *, distance_px: float, margin_px: int) -> Points:
    """The best corners (N, 2) of each cell of the grid. Source: Shi and Tomasi (1994)."""
    height, width = image.shape
    columns = np.linspace(margin_px, width - margin_px, GRID[0] + 1).astype(int)
    rows = np.linspace(margin_px, height - margin_px, GRID[1] + 1).astype(int)
    corners: list[Points] = [np.zeros((0, 2), np.float32)]
    for top, bottom in pairwise(rows):
        for left, right in pairwise(columns):
            cell = np.ascontiguousarray(image[top:bottom, left:right])
            found = cv2.goodFeaturesToTrack(cell, per_cell, CORNER_QUALITY, distance_px) if cell.size else None
            if found is not None:
                corners.append(found.reshape(-1, 2).astype(np.float32) + np.array([left, top], np.float32))
    return np.concatenate(corners)


def follow(image: Image, later: Image, points: Points, guess: Points | None = None) -> tuple[Points, Mask]:
    """Where points (N, 2) went, and which of them come back when followed backwards.

    Source: Lucas and Kanade (1981), pyramids after Bouguet (2000).
    """
    if not len(points):
        return points, np.zeros(0, bool)
    there, found = _lucas_kanade(image, later, points, points if guess is None else guess)
    back, returned = _lucas_kanade(later, image, there, points)
    home = np.linalg.norm(back - points, axis=1) < ROUND_TRIP_PX
    return there, found & returned & home


def _lucas_kanade(image: Image, later: Image, points: Points, guess: Points) -> tuple[Points, Mask]:
    there, status, _ = cv2.calcOpticalFlowPyrLK(
        image,
        later,
        points,
        guess.copy(),
        winSize=(WINDOW_PX, WINDOW_PX),
        maxLevel=PYRAMID_LEVELS,
        criteria=LK_STOP,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(there, np.float32), status.ravel() == 1


def inside(points: Points, image: Image, margin_px: int) -> Mask:
    """Which points (N, 2) are at least `margin_px` within the picture."""
    height, width = image.shape
    limit = np.array([width - 1 - margin_px, height - 1 - margin_px])
    within: Mask = np.all((points >= margin_px) & (points <= limit), axis=1)
    return within


def coarse_disparity(left: Image, right: Image, uv_px: Array, width_px: int) -> Array:
    """Disparity (N,) in px at places (N, 2) of a view `width_px` wide, from small pictures of both views.

    It sees far beyond what Lucas-Kanade would find on its own. Source: Hirschmüller (2008).
    """
    # The matcher skips columns from which the largest disparity would leave the picture: widen it.
    wide = [cv2.copyMakeBorder(image, 0, 0, COARSE_DISPARITIES, 0, cv2.BORDER_REPLICATE) for image in (left, right)]
    matcher = cv2.StereoSGBM.create(0, COARSE_DISPARITIES, 5, P1=200, P2=800, uniquenessRatio=5)
    coarse = matcher.compute(wide[0], wide[1])[:, COARSE_DISPARITIES:] / 16.0
    coarse[coarse < 0] = np.median(coarse[coarse >= 0]) if (coarse >= 0).any() else 0.0
    shrink, (height, width) = shrinking(width_px), left.shape
    column, row = (np.nan_to_num(uv_px) / shrink).astype(int).T
    disparity_px: Array = coarse[row.clip(0, height - 1), column.clip(0, width - 1)] * shrink
    return disparity_px


def shrinking(width_px: int) -> int:
    """How many pixels across become one in a small picture."""
    return max(1, round(width_px / COARSE_WIDTH_PX))


def small_size(width_px: int, height_px: int) -> tuple[int, int]:
    """Width and height of a small picture."""
    return width_px // shrinking(width_px), height_px // shrinking(width_px)


def comparable(image: Image, other: Image) -> tuple[Image, Image]:
    """Two pictures whose grey values may be compared: as they are, unless exposure or light differ."""
    statistics = [np.array(cv2.meanStdDev(picture)).ravel() for picture in (image, other)]
    if (np.abs(statistics[1] - statistics[0]) <= BRIGHTNESS_JUMP * statistics[0]).all():
        return image, other
    return local_contrast(image), local_contrast(other)


def local_contrast(image: Image) -> Image:
    """The picture less its local mean, over its local contrast: blind to brightness and gain."""
    window = (CONTRAST_WINDOW_PX, CONTRAST_WINDOW_PX)
    grey = image.astype(np.float32)
    mean = cv2.blur(grey, window)
    variance = np.maximum(cv2.blur(grey * grey, window) - mean * mean, 0)
    flat = (grey - mean) / (np.sqrt(variance) + CONTRAST_FLOOR)
    return np.clip(np.round(128 + 40 * flat), 0, 255).astype(np.uint8)
