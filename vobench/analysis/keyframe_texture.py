"""Removes the noise of keyframes, by the mean of all keyframes that show the same surface."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from vobench.analysis.image_noise import denoised, noise_dn
from vobench.analysis.keyframe_depth import Keyframe, ViewGeometry, seen_from
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Mask
from vobench.sequence.picture import Image

REACH = 6  # keyframes before and after
SAME_PX = 1.0  # of disparity, for the same surface
ALIKE_SIGMAS = 4.0  # standard deviations of the difference of two images
LEAST_ALIKE_DN = 3.0
# Of the measured noise. Noise that was interpolated varies slowly, so that less is measured than there is, and what is
# left of it can be tracked like a texture.
REMOVED_SIGMAS = 2.0
ENOUGH = 3  # other keyframes for a mean; elsewhere, noise is removed within the image


def without_noise(keyframes: Sequence[Keyframe], geometry: ViewGeometry) -> list[Keyframe]:
    """The keyframes with images whose noise is removed.

    A mean over keyframes preserves faint textures, which a filter within the image takes for noise.
    """
    return [replace(keyframe, image=_image(index, keyframes, geometry)) for index, keyframe in enumerate(keyframes)]


def _image(index: int, keyframes: Sequence[Keyframe], geometry: ViewGeometry) -> Image:
    own = keyframes[index]
    sigma_dn, _ = noise_dn(own.image)
    limit_dn = max(ALIKE_SIGMAS * 2**0.5 * sigma_dn, LEAST_ALIKE_DN)
    total = own.image.astype(np.float64)
    count = np.ones(total.shape)
    before = keyframes[max(index - REACH, 0) : index]
    after = keyframes[index + 1 : index + 1 + REACH]
    for other in (*before, *after):
        seen_dn, is_same = _seen_in(own, other, geometry)
        is_alike = is_same & (np.abs(seen_dn - own.image) <= limit_dn)
        total += np.where(is_alike, seen_dn, 0.0)
        count += is_alike
    mean = np.rint(total / count).astype(np.uint8)
    remaining_dn, _ = noise_dn(mean)
    of_keyframes = denoised(mean, REMOVED_SIGMAS * remaining_dn)
    of_own = denoised(own.image, REMOVED_SIGMAS * sigma_dn)
    return np.where(count > ENOUGH, of_keyframes, of_own)


def _seen_in(own: Keyframe, other: Keyframe, geometry: ViewGeometry) -> tuple[Array, Mask]:
    """The grey values (H, W) that another image has where it shows the pixels of a keyframe, and whether it does."""
    seen_px, depth_m = seen_from(other, own, geometry.pixel_grid().reshape(-1, 2), own.rho.reshape(-1), geometry)
    shape = own.rho.shape
    columns, rows = np.nan_to_num(seen_px, nan=-1.0).astype(np.float32).T.reshape(2, *shape)
    seen_dn = cv2.remap(other.image, columns, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    other_rho = cv2.remap(other.rho, columns, rows, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=-1)
    seen_rho = (1 / depth_m).reshape(shape)
    with np.errstate(invalid="ignore"):
        is_same = (other_rho > 0) & (np.abs(seen_rho - other_rho) <= SAME_PX * geometry.rho_of_px)
    return seen_dn.astype(np.float64), np.asarray(is_same, bool)
