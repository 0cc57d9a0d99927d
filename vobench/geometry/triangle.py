"""Normals and areas of triangles."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit


def face_normals(corners_m: Array) -> Array:
    """The unit normals (F, 3) of triangles with corners (F, 3, 3); 0 for a triangle without area."""
    return unit(_area_vectors(corners_m))


def areas_m2(corners_m: Array) -> Array:
    """The areas (F,) of triangles with corners (F, 3, 3)."""
    double_areas_m2 = np.linalg.norm(_area_vectors(corners_m), axis=1)
    return np.asarray(double_areas_m2 / 2)


def _area_vectors(corners_m: Array) -> Array:
    """Vectors (F, 3) along the normals of triangles. Their lengths are twice the areas."""
    a = corners_m[:, 0]
    b = corners_m[:, 1]
    c = corners_m[:, 2]
    return cross(b - a, c - a)
