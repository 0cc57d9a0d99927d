"""Random points on a disc, and cosine-weighted directions around normals (Malley's method)."""

from collections.abc import Callable

import numpy as np

from vobench.rendering.array_types import Floats
from vobench.rendering.geometry import tangents


def disc(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """The coordinates x and y of points that are uniform on the unit disc.

    `a` and `b` are uniform random numbers in [0, 1).
    """
    radius = np.sqrt(a)
    angle = np.float32(2 * np.pi) * b
    return radius * np.cos(angle), radius * np.sin(angle)


def cosine_weighted(normals: Floats) -> Callable[[Floats, Floats], Floats]:
    """A function that maps random numbers to cosine-weighted directions around unit normals (P, 3).

    Its two arguments are uniform random numbers (..., P) in [0, 1). It returns unit vectors (..., P, 3).
    """
    u_axis, v_axis = tangents(normals)

    def direction(a: Floats, b: Floats) -> Floats:
        x, y = disc(a, b)
        z = np.sqrt(np.maximum(1 - a, 1e-7))
        return np.asarray(x[..., None] * u_axis + y[..., None] * v_axis + z[..., None] * normals)

    return direction
