"""Vectors as arrays whose last axis has the components: directions and cross products."""

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array

# Components of the factors of a cross product: x from y and z, y from z and x, z from x and y.
NEXT_AXIS = np.array([1, 2, 0])
LAST_AXIS = np.array([2, 0, 1])


def unit(vectors: ArrayLike) -> Array:
    """Directions (..., n): vectors scaled to length 1. A zero vector stays zero, and one with a NaN is all NaN."""
    vectors = np.asarray(vectors, float)
    squared_length = (vectors * vectors).sum(-1, keepdims=True)
    length = np.sqrt(squared_length)
    divisor = np.where(length == 0, 1.0, length)
    return np.asarray(vectors / divisor)


def cross(a: Array, b: Array) -> Array:
    """Cross products a x b (..., 3), bit-equal to those of np.cross and faster for few vectors."""
    positive = a[..., NEXT_AXIS] * b[..., LAST_AXIS]
    negative = a[..., LAST_AXIS] * b[..., NEXT_AXIS]
    return np.asarray(positive - negative)


def cross_2d(a: Array, b: Array) -> Array:
    """Cross products (...) of vectors (..., 2): positive where b points to the left of a."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
