"""Cut-outs: the holes that a texture's opacity leaves in faces."""

from functools import lru_cache

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Mask
from vobench.rendering.embree import Hits
from vobench.scene.material import Material
from vobench.scene.mesh import Triangles


class CutOuts:
    """Faces whose texture leaves holes, by the opacity of their materials."""

    def __init__(self, faces: Triangles, materials: dict[str, Material]) -> None:
        self._with_holes = {name: material for name, material in materials.items() if _has_holes(material)}
        number_by_name = {name: number for number, name in enumerate(self._with_holes)}
        number_by_thing = np.array([number_by_name.get(thing.material, -1) for thing in faces.things], np.int32)
        # (F + 1,): the place of each face's material in _with_holes, -1 if not in it; the last is for rays that miss.
        self.material = np.append(number_by_thing[faces.thing], -1)
        self._uv = faces.uv

    def holes(self, hits: Hits) -> Mask:
        """Which hits (R,) are in a hole."""
        is_hole = np.zeros(len(hits.face), bool)
        if not self._with_holes:
            return is_hole
        material_of_hit = self.material[hits.face]
        for number, material in enumerate(self._with_holes.values()):
            rows = np.flatnonzero(material_of_hit == number)
            u = hits.u[rows, None]
            v = hits.v[rows, None]
            corners_uv_m = self._uv[hits.face[rows]]  # (R, 3, 2)
            a, b, c = np.moveaxis(corners_uv_m, 1, 0)
            uv_m = (1 - u - v) * a + u * b + v * c
            is_hole[rows] = ~opaque(material, uv_m / material.tile_m)
        return is_hole


def _has_holes(material: Material) -> bool:
    return material.cutout is not None and material.texture is not None


def opaque(material: Material, places: Array) -> Mask:
    """Whether a material is solid at places (R, 2), in tiles: where its opacity is no less than its cut-out."""
    opacity = _opacity(material)
    return np.asarray(_sampled(opacity, places) >= (material.cutout or 0.0))


@lru_cache(maxsize=64)
def _opacity(material: Material) -> Floats:
    """The opacity (H, W) float32 of a material's texture, one pixel where it has none."""
    if material.texture is None:
        return np.ones((1, 1), np.float32)
    pixels = material.texture.pixels()
    has_opacity = pixels.ndim == 3 and pixels.shape[-1] == 4
    if not has_opacity:
        return np.ones((1, 1), np.float32)
    return np.asarray(pixels[..., 3] / 255, np.float32)


def _sampled(tile: Floats, places: Array) -> Array:
    """A tiled image (H, W) at places (R, 2) in tiles, by bilinear interpolation between the centres of its pixels."""
    height, width = tile.shape
    x = places[:, 0] * width - 0.5
    y = places[:, 1] * height - 0.5
    x0 = np.floor(x).astype(np.int64)
    y0 = np.floor(y).astype(np.int64)
    x_share = x - x0
    y_share = y - y0
    left = x0 % width
    right = (x0 + 1) % width
    top = y0 % height
    bottom = (y0 + 1) % height
    upper = tile[top, left] * (1 - x_share) + tile[top, right] * x_share
    lower = tile[bottom, left] * (1 - x_share) + tile[bottom, right] * x_share
    return np.asarray(upper * (1 - y_share) + lower * y_share)
