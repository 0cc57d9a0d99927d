"""Points that receive the light of an emitter, and the sum of what all of its places give them."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.emitter import Emitter
from vobench.rendering.texel import Texels

SIDE = 64


def receivers(*, eta: float, tilt: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Texels:
    """Points on and above the floor that face one direction."""
    numbers = np.random.default_rng(0)
    points_m = np.append(numbers.uniform(-2, 2, (40, 2)), numbers.uniform(0, 1.9, (40, 1)), 1).astype(np.float32)
    normal = np.array(tilt) / np.linalg.norm(tilt)
    normals = np.tile(normal, (40, 1)).astype(np.float32)
    nowhere = np.zeros((40, 3), np.float32)
    rows = np.arange(40)
    return Texels(
        points_m=points_m,
        normals=normals,
        planes=normals,
        step_u_m=nowhere,
        step_v_m=nowhere,
        index=rows,
        face=rows.astype(np.int32),
        uv=np.zeros((40, 2), np.float32),
        eta=np.full(40, eta, np.float32),
        dither=numbers.random((40, 2), dtype=np.float32),
    )


def summed(emitter: Emitter, texels: Texels) -> Array:
    """The mean over many places on the emitter."""
    aim = emitter.towards(texels)
    total = np.zeros(len(texels))
    for column, row in np.ndindex(SIDE, SIDE):
        a = np.full(len(texels), (column + 0.5) / SIDE, np.float32)
        b = np.full(len(texels), (row + 0.5) / SIDE, np.float32)
        vectors_m, strength = aim(a, b)
        cosine = texels.cosine(vectors_m)
        total += strength * np.maximum(cosine, 0) * texels.entering(cosine)
    return total / SIDE**2
