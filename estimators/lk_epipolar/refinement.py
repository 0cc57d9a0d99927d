"""Refine a motion's shape on the Sampson distance: five degrees of freedom, all tracks, no stereo."""

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vobench.geometry.se3 import Array

from .motion import Matches, Shape
from .tracking import Mask

HUBER_PX = 0.1  # about the noise of a good track
MAX_EVALUATIONS = 20


def refined(shape: Shape, matches: Matches, inlier: Mask) -> Shape:
    """The shape near the given one with the least Sampson distance over the inliers."""
    x0, x1 = matches.x0[inlier], matches.x1[inlier]
    tangent = np.linalg.svd(shape.direction[None])[2][1:]

    def moved(delta: Array) -> Shape:
        direction = shape.direction + delta[3:] @ tangent
        return Shape(Rotation.from_rotvec(delta[:3]).as_matrix() @ shape.R, direction / np.linalg.norm(direction))

    def cost(delta: Array) -> Array:
        return sampson(moved(delta), x0, x1) * matches.focal_px

    fit = least_squares(cost, np.zeros(5), loss="huber", f_scale=HUBER_PX, max_nfev=MAX_EVALUATIONS)
    return moved(fit.x)


def sampson(shape: Shape, x0: Array, x1: Array) -> Array:
    """First-order distance (N,) of rays (N, 3) to the epipolar geometry. Source: Sampson (1982)."""
    x, y, z = shape.direction
    E = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ shape.R
    line1, line0 = x0 @ E.T, x1 @ E
    gradient = line1[:, 0] ** 2 + line1[:, 1] ** 2 + line0[:, 0] ** 2 + line0[:, 1] ** 2
    distance: Array = (x1 * line1).sum(1) / np.sqrt(gradient + np.finfo(float).tiny)
    return distance
