"""How far the picture has moved since the first one: the median displacement of its corners."""

import cv2
import numpy as np

from vobench.plugin import Image, Points, comparable, corners_per_cell, follow

CORNERS_PER_CELL = 12  # of 6 x 4 cells
CORNER_DISTANCE_PX = 8
MARGIN_PX = 12  # half a window of Lucas-Kanade
MIN_TRACKS = 30
# In the dark, corners are the sensor's fixed pattern, which moves with the camera. A median removes its hot pixels, and
# around a corner of a scene the standard deviation is larger than that of the rest.
MEDIAN_PX = 3
MIN_CONTRAST = 6.0  # grey values
CONTRAST_WINDOW_PX = 21


class PictureMotion:
    """Tracks the corners of the first picture into each later one."""

    def __init__(self) -> None:
        self._first: Image | None = None
        self._corners_px: Points = np.zeros((0, 2), np.float32)

    def moved_px(self, image: Image | None) -> float:
        """The median displacement since the first picture; NaN if too few corners are tracked."""
        if image is None:
            return np.nan
        smooth: Image = cv2.medianBlur(image, MEDIAN_PX).astype(np.uint8, copy=False)
        if self._first is None:
            self._first = smooth
            self._corners_px = _corners(smooth)
        first, later = comparable(self._first, smooth)
        there_px, is_tracked = follow(first, later, self._corners_px)
        if is_tracked.sum() < MIN_TRACKS:
            return np.nan
        displacements_px = np.linalg.norm(there_px[is_tracked] - self._corners_px[is_tracked], axis=1)
        return float(np.median(displacements_px))


def _corners(image: Image) -> Points:
    """The corners (N, 2) of a picture that stand out from the sensor's noise."""
    corners_px = corners_per_cell(image, CORNERS_PER_CELL, distance_px=CORNER_DISTANCE_PX, margin_px=MARGIN_PX)
    window = (CONTRAST_WINDOW_PX, CONTRAST_WINDOW_PX)
    grey = image.astype(np.float32)
    mean = cv2.blur(grey, window)
    mean_square = cv2.blur(grey * grey, window)
    contrast = np.sqrt(np.maximum(mean_square - mean * mean, 0))
    columns, rows = np.rint(corners_px).astype(int).T
    has_contrast = contrast[rows, columns] >= MIN_CONTRAST
    standing_out: Points = corners_px[has_contrast]
    return standing_out
