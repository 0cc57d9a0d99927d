"""Vectors as arrays whose last axis has the components: directions and cross products."""

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array

# Component k of a cross product is made of the next axis after k and the one after that, in cyclic order.
NEXT_AXIS = np.array([1, 2, 0])
LAST_AXIS = np.array([2, 0, 1])


def unit(vectors: ArrayLike) -> Array:
    """Scale vectors (..., n) to length 1. A zero vector stays zero; a vector with a NaN component becomes all NaN."""
    vectors = np.asarray(vectors, float)
    squared_length = (vectors * vectors).sum(-1, keepdims=True)
    length = np.sqrt(squared_length)
    divisor = np.where(length == 0, 1.0, length)
    return np.asarray(vectors / divisor)


def cross(a: Array, b: Array) -> Array:
    """Cross products a x b (..., 3). They are bit-equal to those of np.cross, and faster for few vectors."""
    positive = a[..., NEXT_AXIS] * b[..., LAST_AXIS]
    negative = a[..., LAST_AXIS] * b[..., NEXT_AXIS]
    return np.asarray(positive - negative)


def cross_2d(a: Array, b: Array) -> Array:
    """Cross products (...) of vectors a and b (..., 2). They are positive if b points to the left of a."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
