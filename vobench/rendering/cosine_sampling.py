"""Random points on a disc, and cosine-weighted directions around normals (Malley's method)."""

from collections.abc import Callable

import numpy as np

from vobench.rendering.array_types import Floats
from vobench.rendering.geometry import tangents


def disc(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Points x, y uniform over the unit disc, by two uniform random numbers in [0, 1)."""
    radius = np.sqrt(a)
    angle = np.float32(2 * np.pi) * b
    return radius * np.cos(angle), radius * np.sin(angle)


def cosine_weighted(normals: Floats) -> Callable[[Floats, Floats], Floats]:
    """A function of two uniform random numbers (..., P) that gives cosine-weighted directions around normals (P, 3).

    The directions (..., P, 3) are unit vectors.
    """
    u_axis, v_axis = tangents(normals)

    def direction(a: Floats, b: Floats) -> Floats:
        x, y = disc(a, b)
        z = np.sqrt(np.maximum(1 - a, 1e-7))
        return np.asarray(x[..., None] * u_axis + y[..., None] * v_axis + z[..., None] * normals)

    return direction
