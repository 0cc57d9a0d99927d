"""Completes the inverse depth of an image where it is unknown or uncertain, along edges of the image.

Source: Min et al. (2014), fast global image smoothing based on weighted least squares. A known depth and its confidence
are smoothed alike, across small differences of grey values only, and divided.
"""

import cv2
import numpy as np
import scipy

from vobench.analysis.image_noise import noise_dn
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Mask
from vobench.sequence.picture import Image

SMOOTHNESS = 100.0  # of the smoothed values, relative to their confidence: a length of ten pixels
EDGE_DN = 4.0  # difference of grey values across which little is smoothed, besides noise
ROUNDS = 3
ATTENUATION = 4.0  # of the smoothness from one round to the next
TEXTURE_WINDOW_PX = 7
PLAIN_DN = 1.0  # standard deviation of grey values of a plain surface, besides noise
NOISE_SIGMAS = 1.5
EDGE_BAND_PX = 3  # matches this near to a depth edge may have the depth of the other side
LEAST_CONFIDENCE = 1e-12


def completed(rho: Array, image: Image, *, edge_rho: float, least_rho: float) -> Array:
    """Inverse depth (H, W) without unknown values, which are NaN, nor the values near to depth edges.

    An edge is a difference of neighbours by `edge_rho`. The larger the texture of an image (H, W), the more of a known
    value is kept. Where nothing is known, the result is `least_rho`.
    """
    noise_sigma_dn, _ = noise_dn(image)
    confidence = _confidence(rho, image, edge_rho, noise_sigma_dn)
    known = np.nan_to_num(rho, nan=0.0)
    weighted = smoothed(np.stack([confidence * known, confidence]), image, noise_sigma_dn)
    is_determined = weighted[1] > LEAST_CONFIDENCE
    smooth = np.where(is_determined, weighted[0] / np.where(is_determined, weighted[1], 1.0), least_rho)
    return confidence * known + (1 - confidence) * smooth


def _confidence(rho: Array, image: Image, edge_rho: float, noise_sigma_dn: float) -> Array:
    """The confidence (H, W) in known values, from 0 to 1."""
    plain_dn = NOISE_SIGMAS * noise_sigma_dn + PLAIN_DN
    contrast_dn2 = _local_variance(image)
    of_texture = contrast_dn2 / (contrast_dn2 + plain_dn**2)
    is_certain = np.isfinite(rho) & ~_near_edge(rho, edge_rho)
    return np.where(is_certain, of_texture, 0.0)


def _local_variance(image: Image) -> Array:
    window = (TEXTURE_WINDOW_PX, TEXTURE_WINDOW_PX)
    grey = image.astype(np.float64)
    mean = cv2.blur(grey, window)
    variance: Array = np.maximum(cv2.blur(grey**2, window) - mean**2, 0.0)
    return variance


def _near_edge(rho: Array, edge_rho: float) -> Mask:
    """Whether pixels (H, W) are near a depth edge."""
    side_px = 2 * EDGE_BAND_PX + 1
    largest = scipy.ndimage.maximum_filter(np.nan_to_num(rho, nan=-np.inf), side_px)
    least = scipy.ndimage.minimum_filter(np.nan_to_num(rho, nan=np.inf), side_px)
    with np.errstate(invalid="ignore"):
        return np.asarray(largest - least > edge_rho)


def smoothed(values: Array, image: Image, noise_sigma_dn: float) -> Array:
    """Values (C, H, W), smoothed along the rows and columns of an image (H, W) in turns, but not across its edges.

    Edges are differences of grey values beyond the noise of the image, whose standard deviation is given.
    """
    scale_dn = EDGE_DN + NOISE_SIGMAS * noise_sigma_dn
    grey = image.astype(np.float64)
    along_rows = np.exp(-np.abs(np.diff(grey, axis=1)) / scale_dn)
    along_columns = np.exp(-np.abs(np.diff(grey, axis=0)) / scale_dn)
    for index in range(ROUNDS):
        share = 1.5 * ATTENUATION ** (ROUNDS - 1 - index) / (ATTENUATION**ROUNDS - 1)
        smoothness = 2 * share * SMOOTHNESS
        values = _along_last_axis(values, smoothness * along_rows)
        values = np.swapaxes(_along_last_axis(np.swapaxes(values, 1, 2), smoothness * along_columns.T), 1, 2)
    return values


def _along_last_axis(values: Array, coupling: Array) -> Array:
    """Solve (1 + L) x = values (C, R, N) for each row, where L is the Laplacian of couplings (R, N - 1).

    By elimination of a tridiagonal matrix (the algorithm of Thomas), for all rows at once.
    """
    rows, last = coupling.shape
    diagonal = np.ones((rows, last + 1))
    diagonal[:, :-1] += coupling
    diagonal[:, 1:] += coupling
    ratio = np.zeros((rows, last))
    solution = np.array(values, float)
    ratio[:, 0] = coupling[:, 0] / diagonal[:, 0]
    solution[..., 0] /= diagonal[:, 0]
    for column in range(1, last + 1):
        pivot = diagonal[:, column] - coupling[:, column - 1] * ratio[:, column - 1]
        if column < last:
            ratio[:, column] = coupling[:, column] / pivot
        solution[..., column] = (solution[..., column] + coupling[:, column - 1] * solution[..., column - 1]) / pivot
    for column in range(last - 1, -1, -1):
        solution[..., column] += ratio[:, column] * solution[..., column + 1]
    return solution
