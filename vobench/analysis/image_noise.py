"""Estimates the noise of an image from its flat patches, and removes it."""

from functools import cache
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.sequence.picture import Image

SATURATED_DN = 254
BLACK_DN = 2
PATCH_PX = 7
PATCH_STEP_PX = 3
MIN_PATCHES = 300
ROUNDS = 8
FLAT_QUANTILES = np.arange(0.05, 1.0, 0.1)
# Sides of the windows that are compared and searched for similar ones to remove noise.
TEMPLATE_PX = 5
SEARCH_PX = 15
TEXTURE_QUANTILE = 0.999  # one patch of pure noise in a thousand is taken for textured

Patches = NDArray[np.float32]  # (N, PATCH_PX²)


def saturated_share(picture: Image) -> float:
    """The share of saturated pixels of a grey image (H, W)."""
    return float((picture >= SATURATED_DN).mean())


def noise_dn(picture: Image) -> tuple[float, Array]:
    """The standard deviation of the noise in the flat parts of an image, and ten quantiles of the grey values there.

    Patches with black or saturated pixels are left out. The smallest principal components of flat patches have the
    variance of the noise. Flat patches are those whose gradients the noise explains, which is iterated.
    Source: Liu, Tanaka and Okutomi (2013).
    """
    patches = _patches(picture)
    is_above_black = patches.min(1) > BLACK_DN
    is_below_saturation = patches.max(1) < SATURATED_DN - BLACK_DN
    flat = patches[is_above_black & is_below_saturation]
    gradient_energy = ((flat @ _patch_differences().T) ** 2).sum(1)  # (N,)

    sigma_dn = 0.0
    flat_dn = np.zeros(0)
    max_energy = np.inf
    for _ in range(ROUNDS):
        is_flat = gradient_energy <= max_energy
        flat = flat[is_flat]
        gradient_energy = gradient_energy[is_flat]
        if len(flat) < MIN_PATCHES:
            break
        variance = _smallest_variance(flat) / _smallest_variance_of_noise(int(np.log2(len(flat))))
        sigma_dn = variance**0.5
        flat_dn = np.quantile(flat.mean(1), FLAT_QUANTILES)
        max_energy = variance * _max_energy_of_noise()
    return sigma_dn, flat_dn


def denoised(image: Image, sigma_dn: float) -> Image:
    """An image (H, W) with noise of a standard deviation, without it, by non-local means (Buades et al., 2005)."""
    if sigma_dn == 0:
        return image
    smooth = cv2.fastNlMeansDenoising(image, h=sigma_dn, templateWindowSize=TEMPLATE_PX, searchWindowSize=SEARCH_PX)
    return smooth.astype(np.uint8, copy=False)


def _patches(picture: NDArray[Any]) -> Patches:
    """Overlapping square patches (N, PATCH_PX²)."""
    all_patches = np.lib.stride_tricks.sliding_window_view(picture, (PATCH_PX, PATCH_PX))
    patches = all_patches[::PATCH_STEP_PX, ::PATCH_STEP_PX]
    return patches.reshape(-1, PATCH_PX**2).astype(np.float32)


def _smallest_variance(patches: Patches) -> float:
    """The mean of the smallest principal variances of patches."""
    variances = np.linalg.eigvalsh(np.cov(patches, rowvar=False))  # ascending
    return float(max(variances[:PATCH_PX].mean(), 0.0))


@cache
def _smallest_variance_of_noise(magnitude: int) -> float:
    """The smallest principal variance of 2 ** magnitude patches of noise with variance 1."""
    side = round(PATCH_STEP_PX * 2 ** (magnitude / 2 + 0.25)) + PATCH_PX
    noise = np.random.default_rng(0).standard_normal((side, side))
    return _smallest_variance(_patches(noise))


@cache
def _patch_differences() -> NDArray[np.float32]:
    """The matrix from the pixels of a patch to the differences of its neighbours, along rows and columns."""
    pixels = PATCH_PX**2
    unit_patches = np.eye(pixels, dtype=np.float32).reshape(-1, PATCH_PX, PATCH_PX)
    along_columns = np.diff(unit_patches, axis=1).reshape(pixels, -1).T
    along_rows = np.diff(unit_patches, axis=2).reshape(pixels, -1).T
    return np.vstack([along_columns, along_rows])


@cache
def _max_energy_of_noise() -> float:
    """The TEXTURE_QUANTILE of the gradient energy of patches of noise with variance 1.

    The energy is approximated by a gamma distribution with the same mean and variance.
    """
    differences = _patch_differences()
    covariance = differences.T @ differences
    mean = float(np.trace(covariance))
    variance = 2 * float(np.sum(covariance**2))
    shape = mean**2 / variance
    return float(scipy.stats.gamma.ppf(TEXTURE_QUANTILE, shape, scale=variance / mean))
