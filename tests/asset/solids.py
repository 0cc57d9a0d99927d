"""Measures of parts, by which tests compare them with the sizes that were asked for."""

from collections.abc import Sequence

import numpy as np

from vobench.asset.furniture import Part
from vobench.geometry.se3 import Array


def area_vectors(part: Part) -> Array:
    """Area vectors (F, 3) of the faces, in m²."""
    a, b, c = part.arrays.corners_m.swapaxes(0, 1)
    return np.cross(b - a, c - a) / 2


def is_closed(part: Part) -> bool:
    """Whether the area vectors add up to zero, as those of every closed surface do (Gauss)."""
    return bool(np.abs(area_vectors(part).sum(axis=0)).max() < 1e-9)


def volume_m3(part: Part) -> float:
    """The enclosed volume of a closed part; negative if it is inside out."""
    centers_m = part.arrays.corners_m.mean(axis=1)
    return float((area_vectors(part) * centers_m).sum() / 3)


def bounds_m(parts: Sequence[Part]) -> tuple[Array, Array]:
    """The smallest and the largest x, y and z of all vertices."""
    points_m = np.concatenate([part.arrays.vertices_m for part in parts])
    return points_m.min(axis=0), points_m.max(axis=0)


def extent_m(parts: Sequence[Part]) -> Array:
    """The size along x, y and z."""
    lowest_m, highest_m = bounds_m(parts)
    return highest_m - lowest_m


def front_agreement(part: Part) -> Array:
    """Cosine-like agreement (F,) of a face's front with the mean of the normals of its vertices: positive if alike."""
    mesh = part.arrays
    normals = mesh.normals[mesh.faces].mean(axis=1)
    return np.asarray((area_vectors(part) * normals).sum(axis=1))
