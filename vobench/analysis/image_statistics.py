"""Computes statistics of single images and of their sequence: gradients, edges, corners, spectrum and tracks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import cv2
import numpy as np

from vobench.analysis.image_noise import BLACK_DN, SATURATED_DN, noise_dn, saturated_share
from vobench.estimator.tracking import Points, follow, inside
from vobench.geometry.se3 import Array
from vobench.sequence.picture import Image

MAX_CORNERS = 2000
CORNER_QUALITY = 0.01
CORNER_DISTANCE_PX = 8
CELLS = (8, 6)  # the columns and rows of cells in which corners are counted

Item = TypeVar("Item")


def evenly_spaced(items: Sequence[Item], count: int) -> list[Item]:
    """A number of items that are evenly spaced over all, such as images of a recording; some twice if there are few."""
    indices = np.linspace(0, len(items) - 1, count).astype(int)
    return [items[index] for index in indices]


def picture_statistics(picture: Image) -> dict[str, float]:
    """The statistics of one grey image, by name."""
    gradient = gradients(picture)
    points = corners(picture)
    return {
        "gradient_p99": float(np.percentile(gradient, 99)),
        "gradient_kurtosis": _kurtosis(gradient),
        "corner_unevenness": _unevenness(points, picture),
        "grey_sd": float(picture.std()),
        "burnt": 100 * saturated_share(picture),
        "grey_mean": float(picture.mean()),
        "noise_dn": noise_dn(picture)[0],
        "edge_px": edge_px(picture, gradient),
        "corners": float(len(points)),
    }


# --- Gradients and edges ---

SOBEL_GAIN = 8  # the response of the 3 x 3 kernel to a ramp of 1 per pixel
EDGE_SHARE = 0.01  # the share of pixels, with the strongest gradients, that are edges
EDGE_WINDOW_PX = 9  # large enough to contain an edge
MIN_EDGE_GRADIENT = 1.0
EDGE_QUANTILE = 0.25


def gradients(picture: Image) -> Array:
    """The magnitudes (H, W) of the gradient in grey values per pixel, by the Sobel kernel of size 3 x 3.

    NumPy computes the square root, because the last bits of `cv2.magnitude` depend on the memory address of an image.
    """
    along_x = cv2.Sobel(picture, cv2.CV_64F, 1, 0, ksize=3) / SOBEL_GAIN
    along_y = cv2.Sobel(picture, cv2.CV_64F, 0, 1, ksize=3) / SOBEL_GAIN
    squared: Array = along_x**2 + along_y**2
    return np.sqrt(squared)


def _kurtosis(values: Array) -> float:
    """The fourth central moment divided by the square of the second one, which is 3 for a normal distribution."""
    deviation = values - values.mean()
    variance = float(np.mean(deviation**2))
    return float(np.mean(deviation**4) / max(variance**2, 1e-12))


def edge_px(picture: Image, gradient: Array) -> float:
    """The width of the sharpest edges: the lower quartile of height / gradient; 0 if there are no edges."""
    kernel = np.ones((EDGE_WINDOW_PX, EDGE_WINDOW_PX), np.uint8)
    brightest = cv2.dilate(picture, kernel)
    darkest = cv2.erode(picture, kernel)
    is_exposed = (brightest < SATURATED_DN) & (darkest > BLACK_DN)
    if not is_exposed.any():
        return 0.0

    strong_gradient = float(np.quantile(gradient[is_exposed], 1 - EDGE_SHARE))
    is_edge = is_exposed & (gradient >= max(strong_gradient, MIN_EDGE_GRADIENT))
    if not is_edge.any():
        return 0.0
    height_dn = (brightest.astype(float) - darkest)[is_edge]
    return float(np.quantile(height_dn / gradient[is_edge], EDGE_QUANTILE))


# --- Corners ---


def corners(picture: Image) -> Points:
    """The best corners (N, 2) of a whole image. Source: Shi and Tomasi (1994)."""
    points = cv2.goodFeaturesToTrack(picture, MAX_CORNERS, CORNER_QUALITY, CORNER_DISTANCE_PX)
    if points is None:
        return np.zeros((0, 2), np.float32)
    return points.reshape(-1, 2).astype(np.float32)


def _unevenness(points: Points, picture: Image) -> float:
    """The standard deviation divided by the mean of the numbers of points (N, 2) in the cells of an image."""
    height_px, width_px = picture.shape
    columns, rows = CELLS
    borders_x = np.linspace(0, width_px, columns + 1)
    borders_y = np.linspace(0, height_px, rows + 1)
    counts = np.histogram2d(points[:, 0], points[:, 1], bins=[borders_x, borders_y])[0]
    return float(counts.std() / max(float(counts.mean()), 1e-12))


# --- Power spectrum ---

TILE_PX = 256
CYCLES = (4, 100)  # the range of frequencies, in cycles per tile, in which the slope is fitted
MIN_POWER = 1e-12


def spectrum(pictures: Sequence[Image]) -> tuple[float, Array]:
    """The slope of log power over log frequency, and log10 of the power by cycles per tile, of windowed tiles."""
    window = np.hanning(TILE_PX)
    window_2d = np.outer(window, window)
    total = np.zeros(TILE_PX * TILE_PX)
    tiles = 0
    for picture in pictures:
        for tile in _tiles(picture):
            transform = np.fft.fft2((tile - tile.mean()) * window_2d)
            total += np.abs(transform).ravel() ** 2
            tiles += 1

    cycles_1d = np.fft.fftfreq(TILE_PX, 1 / TILE_PX)
    cycles_2d = np.hypot(cycles_1d[:, None], cycles_1d[None])
    cycles = np.rint(cycles_2d).astype(int).ravel()
    frequencies = np.maximum(np.bincount(cycles), 1)
    power = np.bincount(cycles, total) / frequencies / max(tiles, 1)
    log_power = np.log10(np.maximum(power[: TILE_PX // 2], MIN_POWER))

    low, high = CYCLES
    log_cycles = np.log10(np.arange(low, high + 1))
    slope, _ = np.polyfit(log_cycles, log_power[low : high + 1], 1)
    return float(slope), log_power


def _tiles(picture: Image) -> Iterator[Array]:
    """Tiles that cover an image. The outer tiles are at its borders. A smaller image is padded by reflection."""
    padding_px = [(0, max(0, TILE_PX - size)) for size in picture.shape]
    padded = np.pad(picture, padding_px, mode="symmetric").astype(float)
    height_px, width_px = padded.shape
    for row in _tile_starts(height_px):
        for column in _tile_starts(width_px):
            yield padded[row : row + TILE_PX, column : column + TILE_PX]


def _tile_starts(size_px: int) -> list[int]:
    """The positions of the smallest number of tiles that cover a side."""
    count = -(-size_px // TILE_PX)
    starts = np.linspace(0, size_px - TILE_PX, count).astype(int)
    return [int(start) for start in np.unique(starts)]


# --- Tracks ---


@dataclass(frozen=True, slots=True)
class TrackStatistics:
    """Statistics of corners that are tracked through a run of images.

    `consistent_share` is the share of forward–backward consistent tracks from one image to the next, and `flow_px` the
    median length of these, both as means over the run. `alive_share` (P,) is the share of the first image's corners
    that are still tracked, by image, and `moved_px` the largest median distance of these from their first places.
    """

    consistent_share: float
    flow_px: float
    moved_px: float
    alive_share: Array


def track_statistics(pictures: Sequence[Image]) -> TrackStatistics:
    """Track corners through successive grey images."""
    consistent_shares = []
    flows_px = []
    alive_shares = [1.0]
    alive = corners(pictures[0])
    start = alive
    moved_px = 0.0
    first_count = max(len(alive), 1)
    for picture, later in pairwise(pictures):
        points = corners(picture)
        tracked, is_consistent = follow(picture, later, points)
        consistent_shares.append(float(is_consistent.mean()) if len(points) else 0.0)
        flows_px.append(_median_length(tracked[is_consistent] - points[is_consistent]))

        tracked, is_consistent = follow(picture, later, alive)
        if len(alive):
            is_alive = is_consistent & inside(tracked, later, 0)
            alive = tracked[is_alive]
            start = start[is_alive]
            moved_px = max(moved_px, _median_length(alive - start))
        alive_shares.append(len(alive) / first_count)
    return TrackStatistics(_mean(consistent_shares), _mean(flows_px), moved_px, np.array(alive_shares))


def _median_length(vectors: Points) -> float:
    if not len(vectors):
        return 0.0
    return float(np.median(np.linalg.norm(vectors, axis=1)))


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else 0.0
