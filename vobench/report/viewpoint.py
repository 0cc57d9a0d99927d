"""The viewpoint of the 3-D view of a recording in Rerun, and sizes in proportion to the paths in it."""

import numpy as np

from vobench.geometry.se3 import Array

EYE_PITCH_DEG = 38.0
EYE_DISTANCE_PER_RADIUS = 1.6  # paths and camera frusta fill Rerun's default field of view
FRUSTUM_PER_RADIUS = 0.16
LEAST_RADIUS_M = 0.25


def eye_and_target(points_m: Array) -> tuple[Array, Array]:
    """The position of the eye and the point that it looks at, so that points (N, 3) fill the view.

    The target is the centre of the points' bounding box.
    """
    target_m = (points_m.min(0) + points_m.max(0)) / 2
    distance_m = EYE_DISTANCE_PER_RADIUS * radius_m(points_m)
    eye_m = target_m + distance_m * _direction_to_eye(points_m)
    return eye_m, target_m


def _direction_to_eye(points_m: Array) -> Array:
    """The unit vector (3,) from points (N, 3) to the eye.

    Seen from above, it is perpendicular to the points' principal axis and points towards -y.
    """
    covariance = np.cov(points_m[:, :2].T, bias=True)
    _, axes = np.linalg.eigh(covariance)  # columns, by increasing variance
    minor_axis = axes[:, 0]
    sign = -1.0 if minor_axis[1] > 0 else 1.0
    pitch_rad = np.deg2rad(EYE_PITCH_DEG)
    horizontal = np.cos(pitch_rad) * (minor_axis * sign)
    return np.array([*horizontal, np.sin(pitch_rad)])


def grid_spacing_m(extent_m: float) -> float:
    """The spacing of the lines of a grid: the power of ten that divides `extent_m` into 3 to 30 parts."""
    return float(10.0 ** np.floor(np.log10(extent_m / 3)))


def frustum_m(truth_m: Array) -> float:
    """The length of a drawn camera frustum, in proportion to the size of the true path (N, 3)."""
    return FRUSTUM_PER_RADIUS * radius_m(truth_m)


def radius_m(points_m: Array) -> float:
    """Half the diagonal of the bounding box of points (N, 3), at least LEAST_RADIUS_M for a stationary robot."""
    diagonal_m = float(np.linalg.norm(np.ptp(points_m, axis=0)))
    return max(LEAST_RADIUS_M, diagonal_m / 2)


def near_truth(truth_m: Array, estimates_m: Array) -> Array:
    """The true path (N, 3) and the nearby points of estimated paths (M, 3), together (K, 3).

    Distant points are left out, so that a diverged estimate does not shrink the other paths in the view.
    """
    center_m = (truth_m.min(0) + truth_m.max(0)) / 2
    reach_m = 2 * radius_m(truth_m)
    is_near = np.linalg.norm(estimates_m - center_m, axis=1) <= reach_m
    return np.concatenate([truth_m, estimates_m[is_near]])
