"""Refines matches of image points by patches that shift, stretch and shear."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.estimator.tracking import Mask, Points
from vobench.geometry.se3 import Array
from vobench.sequence.picture import Image

PATCH_PX = 21
STEPS = 5
CONVERGED_PX = 0.05  # length of the last step
MAX_SHIFT_PX = 1.5  # from the guess
DAMPING = 1e-6  # times the trace of the Hessian

# Parameters of how a patch deforms: the gradient of the shift along x only, as disparities have, or of both shifts.
SLANT = 2
AFFINE = 4


def refined(
    image: Image,
    later: Image,
    points: Points,
    guess: Points,
    *,
    shape: int,
) -> tuple[Points, Mask]:
    """The pixels (N, 2) of points in a later image, and whether the search converged near the guess (N, 2).

    `shape` is SLANT or AFFINE, because a patch that only shifts is biased on slanted surfaces. Points should not be at
    integer pixels. There, they are sharper than their matches, which biases shifts by a few percent.
    Source: Shi and Tomasi (1994); Baker and Matthews (2004), inverse compositional.
    """
    if not len(points):
        return points, np.zeros(0, bool)
    half_px = PATCH_PX // 2
    grid = _patch_grid(half_px)  # (K, 2), px
    before = image.astype(np.float32)
    after = later.astype(np.float32)
    patch = _sampled(before, points[:, None] + grid)  # (N, K)
    solve = _solver(before, points, patch, grid, half_px=half_px, shape=shape)

    matched = guess.astype(float)
    warp = np.tile(np.eye(2), (len(points), 1, 1))  # (N, 2, 2), of the patch around each point
    shift = np.zeros((len(points), 2))
    for _ in range(STEPS):
        warped_patch = _sampled(after, matched[:, None] + grid @ np.swapaxes(warp, 1, 2))
        parameters = (solve @ (warped_patch - patch)[..., None])[..., 0]
        gradient = np.zeros((len(points), 4))
        gradient[:, :shape] = parameters[:, 2 : 2 + shape] / half_px
        change_of_warp = np.eye(2) + gradient.reshape(-1, 2, 2)
        inverse_warp = np.linalg.inv(change_of_warp)
        shift = (warp @ inverse_warp @ parameters[:, :2, None])[..., 0]
        matched = matched - shift
        warp = warp @ inverse_warp

    has_converged = np.linalg.norm(shift, axis=1) < CONVERGED_PX
    is_near_guess = np.linalg.norm(matched - guess, axis=1) < MAX_SHIFT_PX
    return matched.astype(np.float32), has_converged & is_near_guess


def _patch_grid(half_px: int) -> NDArray[np.float32]:
    """The pixels (K, 2) of a patch, from its centre."""
    offsets_px = np.arange(-half_px, half_px + 1.0)
    x, y = np.meshgrid(offsets_px, offsets_px)
    return np.stack([x, y], -1).reshape(-1, 2).astype(np.float32)


def _solver(
    image: NDArray[np.float32],
    points: Points,
    patch: Array,
    grid: NDArray[np.float32],
    *,
    half_px: int,
    shape: int,
) -> NDArray[np.float32]:
    """The matrices (N, 4 + shape, K) from the difference of two patches to the parameters of the warp.

    The parameters are the shift, its gradient in units of half a patch, gain and brightness.
    """
    gradient_y, gradient_x = np.gradient(image)
    pixels = points[:, None] + grid
    slopes = [_sampled(np.asarray(gradient), pixels) for gradient in (gradient_x, gradient_y)]
    terms = list(slopes)
    for slope in slopes:
        terms += [slope * coordinate for coordinate in (grid / half_px).T]
    gain = patch - patch.mean(1, keepdims=True)
    brightness = np.ones_like(patch)
    jacobian = np.stack([*terms[: 2 + shape], gain, brightness], -1)  # (N, K, parameters)

    weight = np.exp(-((grid / half_px) ** 2).sum(1))
    weighted = np.swapaxes(jacobian * weight[:, None], 1, 2)
    hessian = weighted @ jacobian
    trace = np.trace(hessian, axis1=1, axis2=2)
    identity = np.eye(hessian.shape[1])
    hessian += DAMPING * trace[:, None, None] * identity
    return np.linalg.solve(hessian, weighted).astype(np.float32)


def _sampled(picture: NDArray[np.float32], at_px: NDArray[Any]) -> Array:
    """The values (N, K) of an image at pixels (N, K, 2)."""
    import cv2

    column, row = np.moveaxis(np.asarray(at_px, np.float32), -1, 0)
    return np.asarray(cv2.remap(picture, column, row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE))
