"""Normals and areas of triangles."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit


def face_normals(corners_m: Array) -> Array:
    """The unit normals (F, 3) of triangles with corners (F, 3, 3); 0 for a triangle without area."""
    a = corners_m[:, 0]
    return unit(cross(corners_m[:, 1] - a, corners_m[:, 2] - a))


def areas_m2(corners_m: Array) -> Array:
    """The areas (F,) of triangles with corners (F, 3, 3)."""
    a, b, c = corners_m.swapaxes(0, 1)
    return np.asarray(np.linalg.norm(cross(b - a, c - a), axis=1) / 2)
