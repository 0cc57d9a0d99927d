"""Estimates the vignetting of a camera and the exposures of keyframes from surfaces that several keyframes show.

cosine     of the angle to the axis of the camera
exponent   p: a grey value is proportional to cosine ** p
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from vobench.analysis.image_noise import SATURATED_DN
from vobench.analysis.keyframe_depth import Keyframe, ViewGeometry, seen_from
from vobench.estimator.pose import cauchy_weights
from vobench.estimator.stereo import StereoPair
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Mask

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

POINT_STEP_PX = 8
REACH = 6  # keyframes that are compared with each
EXPOSED_DN = (12.0, 240.0)
SAME_PX = 0.5  # of disparity, for the same surface
LOG_NOISE = 0.012  # usual standard deviation of the logarithm of a grey value
ROUNDS = 5
PRIOR_SIGMAS = (2.0, 0.3)  # of the exponent, and of the logarithms of exposures
MOST_EXPONENT = 4.0
WHITE_DN = 255


@dataclass(frozen=True, slots=True)
class RelativePhotometry:
    """The exponent of vignetting in grey values, and the grey values (K,) of keyframes relative to their mean."""

    exponent: float
    relative_grey: Array


def cosines(pair: StereoPair, geometry: ViewGeometry) -> Array:
    """The cosines (H, W) of the pixels of the left view."""
    rays = geometry.rays(geometry.pixel_grid()) @ pair.left.R_view_camera
    return np.asarray(rays[..., 2] / np.linalg.norm(rays, axis=-1), float)


def fit_photometry(keyframes: Sequence[Keyframe], cosine: Array, geometry: ViewGeometry) -> RelativePhotometry:
    """Fit the exponent and the exposures to differences of logarithms of grey values.

    Errors with a heavy tail, as of surfaces that shine or are not the same, count little.
    """
    pairs = list(_same_points(keyframes, cosine, geometry))
    if not pairs:
        return RelativePhotometry(0.0, np.ones(len(keyframes)))
    differences = np.concatenate([pair.log_grey for pair in pairs])
    design = scipy.sparse.vstack([_design(pair, len(keyframes)) for pair in pairs], "csr")
    prior_sigma = np.array([PRIOR_SIGMAS[0], *[PRIOR_SIGMAS[1]] * len(keyframes)])
    prior = np.diag((LOG_NOISE / prior_sigma) ** 2)
    transposed = design.T.tocsr()
    weights = np.ones(len(differences))
    for _ in range(ROUNDS):
        weighted = transposed.multiply(weights).tocsr()
        solution = np.linalg.solve((weighted @ design).toarray() + prior, weighted @ differences)
        weights = cauchy_weights(differences - design @ solution, LOG_NOISE)
    exponent = float(np.clip(solution[0], 0.0, MOST_EXPONENT))
    log_exposure = solution[1:] - solution[1:].mean()
    return RelativePhotometry(exponent, np.exp(log_exposure))


def corrected(keyframes: Sequence[Keyframe], photometry: RelativePhotometry, cosine: Array) -> list[Keyframe]:
    """The keyframes as a camera without vignetting and with one exposure would have taken them.

    All images are darker by one factor, so that no value exceeds the range of grey values. What is saturated in an
    image gets the largest value.
    """
    falloff = cosine**photometry.exponent
    darkest = float(falloff.min() * photometry.relative_grey.min())
    images = []
    for keyframe, relative_grey in zip(keyframes, photometry.relative_grey, strict=True):
        evenly_lit = keyframe.image * (darkest / (falloff * relative_grey))
        image = np.where(keyframe.image >= SATURATED_DN, WHITE_DN, evenly_lit)
        images.append(replace(keyframe, image=np.rint(image).astype(np.uint8)))
    return images


@dataclass(frozen=True, slots=True)
class _SamePoints:
    """Points that two keyframes show: differences (N,) of the logarithms of grey values and of cosines."""

    first: int
    second: int
    log_grey: Array
    log_cosine: Array


def _design(pair: _SamePoints, count: int) -> "csr_matrix":
    """The derivatives (N, 1 + K) of the differences by the exponent and the logarithms of exposures."""
    points = len(pair.log_grey)
    values = np.column_stack([pair.log_cosine, np.ones(points), -np.ones(points)])
    columns = np.tile([0, 1 + pair.first, 1 + pair.second], points)
    starts = 3 * np.arange(points + 1)
    return scipy.sparse.csr_matrix((values.ravel(), columns, starts), (points, 1 + count))


def _same_points(keyframes: Sequence[Keyframe], cosine: Array, geometry: ViewGeometry) -> Iterator[_SamePoints]:
    """The points that keyframes and the following ones show."""
    first_px = POINT_STEP_PX // 2
    pixels = geometry.pixel_grid()[first_px::POINT_STEP_PX, first_px::POINT_STEP_PX].reshape(-1, 2)
    columns, rows = pixels.astype(int).T
    is_recorded = geometry.records(pixels)
    for first, keyframe in enumerate(keyframes):
        grey = keyframe.image[rows, columns].astype(float)
        for second in range(first + 1, min(first + 1 + REACH, len(keyframes))):
            other = keyframes[second]
            seen_px, depth_m = seen_from(other, keyframe, pixels, keyframe.rho[rows, columns], geometry)
            is_seen = is_recorded & geometry.records(seen_px)
            seen_columns, seen_rows = np.where(is_seen[:, None], seen_px, 0).round().astype(int).T
            other_grey = other.image[seen_rows, seen_columns].astype(float)
            with np.errstate(invalid="ignore"):
                is_same = np.abs(1 / depth_m - other.rho[seen_rows, seen_columns]) < SAME_PX * geometry.rho_of_px
            is_used = is_seen & is_same & _is_exposed(grey) & _is_exposed(other_grey)
            if is_used.any():
                log_grey = np.log(grey[is_used] / other_grey[is_used])
                log_cosine = np.log(cosine[rows, columns] / cosine[seen_rows, seen_columns])[is_used]
                yield _SamePoints(first, second, log_grey, log_cosine)


def _is_exposed(grey: Array) -> Mask:
    low_dn, high_dn = EXPOSED_DN
    return (grey > low_dn) & (grey < high_dn)
