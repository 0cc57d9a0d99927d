"""Detects corners, tracks them by Lucas-Kanade, and makes pictures of different brightness comparable."""

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.estimator.protocol import Image

Mask = NDArray[np.bool_]
Points = NDArray[np.float32]

# The number of cells across and down. Corners are detected in each cell, so that they cover the whole picture.
GRID_COLUMNS = 6
GRID_ROWS = 4
CORNER_QUALITY = 0.01  # the smallest quality of a corner, relative to the best corner in its cell
WINDOW_PX = 21
LEVELS = 3  # the number of reduced pictures in the pyramid
LK_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.01)
ROUND_TRIP_PX = 0.5  # the largest distance between a point and the same point tracked forward and backward
# Tracking is repeated without the guess if the guess is this far away and a smaller share than this of points is found.
MISLED_PX = 5.0
MISLED_SHARE = 0.4
BRIGHTNESS_JUMP = 0.1  # relative change of mean or contrast beyond which grey values are not compared directly
CONTRAST_WINDOW_PX = 31
CONTRAST_FLOOR = 4.0  # grey values; keeps noise in flat regions small
# Grey values of local contrast.
CONTRAST_MIDDLE = 128
CONTRAST_GAIN = 40


def corners_per_cell(image: Image, per_cell: int, *, distance_px: float, margin_px: int) -> Points:
    """The best corners (N, 2) of all cells of the picture. Source: Shi and Tomasi (1994)."""
    height, width = image.shape
    columns = np.linspace(margin_px, width - margin_px, GRID_COLUMNS + 1).astype(int)
    rows = np.linspace(margin_px, height - margin_px, GRID_ROWS + 1).astype(int)
    corners: list[Points] = [np.zeros((0, 2), np.float32)]
    for top, bottom in pairwise(rows):
        for left, right in pairwise(columns):
            cell = np.ascontiguousarray(image[top:bottom, left:right])
            if not cell.size:
                continue
            in_cell = cv2.goodFeaturesToTrack(cell, per_cell, CORNER_QUALITY, distance_px)
            if in_cell is not None:
                cell_corner = np.array([left, top], np.float32)
                corners.append(in_cell.reshape(-1, 2).astype(np.float32) + cell_corner)
    return np.concatenate(corners)


def follow(
    image: Image, later: Image, points: Points, guess: Points | None = None, *, window_px: int = WINDOW_PX
) -> tuple[Points, Mask]:
    """The pixels (N, 2) of points in a later picture, and which of them (N,) are forward-backward consistent.

    The search begins at `guess` (N, 2), by default at the points. A small window is more accurate near depth edges and
    on slanted surfaces, and a large window in noisy pictures. Source: Lucas and Kanade (1981), Bouguet (2000).
    """
    if not len(points):
        return points, np.zeros(0, bool)
    first = points if guess is None else guess
    there, found = lucas_kanade(image, later, points, first, window_px=window_px)
    back, found_back = lucas_kanade(later, image, there, points, window_px=window_px)
    round_trip_px = np.linalg.norm(back - points, axis=1)
    return there, found & found_back & (round_trip_px < ROUND_TRIP_PX)


def lucas_kanade(
    image: Image, later: Image, points: Points, guess: Points, *, window_px: int = WINDOW_PX, levels: int = LEVELS
) -> tuple[Points, Mask]:
    """The pixels (N, 2) of points in a later picture, searched from a guess (N, 2), and which (N,) were found."""
    there, status, _ = cv2.calcOpticalFlowPyrLK(
        image,
        later,
        points,
        guess.astype(np.float32),
        winSize=(window_px, window_px),
        maxLevel=levels,
        criteria=LK_STOP,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(there, np.float32), status.ravel() == 1


def follow_predicted(
    image: Image, later: Image, points: Points, guess: Points, *, window_px: int = WINDOW_PX
) -> tuple[Points, Mask]:
    """Track points as `follow` does, and repeat it without the guess if most points are lost.

    The guess can be wrong because the predicted motion has stopped.
    """
    there, found = follow(image, later, points, guess, window_px=window_px)
    if not len(points):
        return there, found
    guess_px = float(np.median(np.linalg.norm(guess - points, axis=1)))
    if guess_px <= MISLED_PX or found.mean() >= MISLED_SHARE:
        return there, found
    there_unguided, found_unguided = follow(image, later, points, window_px=window_px)
    if found_unguided.sum() > found.sum():
        return there_unguided, found_unguided
    return there, found


def inside(points: Points, image: Image, margin_px: int) -> Mask:
    """Whether each point (N, 2) is inside of the picture, at least `margin_px` from its border."""
    height, width = image.shape
    limit = np.array([width - 1 - margin_px, height - 1 - margin_px])
    is_inside = (points >= margin_px) & (points <= limit)
    within: Mask = np.all(is_inside, axis=1)
    return within


def comparable(image: Image, other: Image) -> tuple[Image, Image]:
    """The two pictures unchanged, or their local contrast if their brightness differs."""
    statistics = np.array(cv2.meanStdDev(image)).ravel()  # mean and standard deviation
    other_statistics = np.array(cv2.meanStdDev(other)).ravel()
    change = np.abs(other_statistics - statistics)
    if (change <= BRIGHTNESS_JUMP * statistics).all():
        return image, other
    return local_contrast(image), local_contrast(other)


def local_contrast(image: Image) -> Image:
    """The picture minus its local mean, divided by its local standard deviation. It is invariant to gain and offset."""
    window = (CONTRAST_WINDOW_PX, CONTRAST_WINDOW_PX)
    grey = image.astype(np.float32)
    mean = cv2.blur(grey, window)
    mean_square = cv2.blur(grey * grey, window)
    variance = np.maximum(mean_square - mean * mean, 0)
    normalized = (grey - mean) / (np.sqrt(variance) + CONTRAST_FLOOR)
    contrast = np.round(CONTRAST_MIDDLE + CONTRAST_GAIN * normalized)
    return np.clip(contrast, 0, 255).astype(np.uint8)
