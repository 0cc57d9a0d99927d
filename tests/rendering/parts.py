"""Light at places on the faces of a scene, whatever parts these were divided into for their light."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Rows
from vobench.rendering.baked_scene import BakedScene

ROUNDING = 1e-6  # of weights, by which a place at the border of a part may be outside


def light_at(baked: BakedScene, light: Array, face: Rows, u: Array, v: Array) -> Array:
    """What a map (H, W, ...) shows (R, ...) at u and v (R,) on faces (R,) of the scene's table."""
    weights = np.stack([1 - u - v, u, v], -1)
    result = np.full((len(face), *light.shape[2:]), np.nan)
    for part in np.flatnonzero(np.isin(baked.parts.parent, face)):
        on_part = weights @ np.linalg.inv(baked.parts.weights[part])
        is_inside = (on_part >= -ROUNDING).all(1) & (face == baked.parts.parent[part])
        rows = np.full(np.count_nonzero(is_inside), part, np.int32)
        _, part_u, part_v = np.clip(on_part[is_inside], 0, 1).T
        result[is_inside] = baked.atlas.read(light, rows, part_u, part_v)
    assert not np.isnan(result).any()
    return result
