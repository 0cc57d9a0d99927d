"""Alpha cut-outs: holes in faces where the opacity of their texture is below a threshold."""

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Mask
from vobench.rendering.embree import Hits
from vobench.scene.material import Material
from vobench.scene.triangles import Triangles

NO_CUTOUT = -1  # the index of faces whose material has no cut-out


class CutOuts:
    """Finds the hits that lie in the hole of a cut-out.

    `cutout_of_face` (F + 1,) is the index of each face's material among those with cut-outs, or NO_CUTOUT. The last
    element is NO_CUTOUT: a ray that hits no face has the face -1, which is the index of the last element.
    """

    def __init__(self, faces: Triangles, materials: dict[str, Material]) -> None:
        self._materials_with_holes = {name: material for name, material in materials.items() if _has_holes(material)}
        index_by_name = {name: index for index, name in enumerate(self._materials_with_holes)}
        index_by_thing = np.array([index_by_name.get(thing.material, NO_CUTOUT) for thing in faces.things], np.int32)
        thing_of_face = faces.thing  # (F,), indices
        self.cutout_of_face = np.append(index_by_thing[thing_of_face], NO_CUTOUT)
        self._uv = faces.uv

    def are_in_holes(self, hits: Hits) -> Mask:
        """Which of R hits are in a hole; a ray that hits no face is not."""
        is_hole = np.zeros(len(hits.face), bool)
        if not self._materials_with_holes:
            return is_hole
        cutout_of_hit = self.cutout_of_face[hits.face]
        for index, material in enumerate(self._materials_with_holes.values()):
            rows = np.flatnonzero(cutout_of_hit == index)
            uv_m = self._texture_coordinates_m(hits, rows)
            is_hole[rows] = ~is_opaque(material, uv_m / material.tile_m)
        return is_hole

    def _texture_coordinates_m(self, hits: Hits, rows: NDArray[np.intp]) -> Array:
        """The texture coordinates (K, 2), in metres, of some hits, interpolated between the corners of their faces.

        `hits.u` and `hits.v` are the barycentric weights of the second and the third corner.
        """
        second_weight = hits.u[rows, None]
        third_weight = hits.v[rows, None]
        first_weight = 1 - second_weight - third_weight
        first_uv_m, second_uv_m, third_uv_m = np.moveaxis(self._uv[hits.face[rows]], 1, 0)  # each (K, 2)
        return np.asarray(first_weight * first_uv_m + second_weight * second_uv_m + third_weight * third_uv_m)


def _has_holes(material: Material) -> bool:
    """Whether a material can have holes: it has an opacity threshold, and a texture."""
    return material.cutout is not None and material.texture is not None


def is_opaque(material: Material, uv_tiles: Array) -> Mask:
    """Whether a material is opaque at texture coordinates (R, 2), in tiles.

    It is opaque where the opacity of its texture is at least the threshold `material.cutout`, and everywhere if it has
    no threshold.
    """
    if material.cutout is None:
        return np.ones(len(uv_tiles), bool)
    opacity = _sampled(_opacity(material), uv_tiles)
    return np.asarray(opacity >= material.cutout)


# Weak keys, because the pixels of a generated place's texture keep all arrays of the place in memory.
_opacities: WeakKeyDictionary[Material, Floats] = WeakKeyDictionary()


def _opacity(material: Material) -> Floats:
    """The alpha channel (H, W) of a material's texture, from 0 to 1, which is computed once for each material."""
    opacity = _opacities.get(material)
    if opacity is None:
        opacity = _alpha(material)
        _opacities[material] = opacity
    return opacity


def _alpha(material: Material) -> Floats:
    """The alpha channel (H, W) of a material's texture, from 0 to 1; a single opaque pixel if it has none."""
    if material.texture is not None:
        pixels = material.texture.pixels()
        has_opacity = pixels.ndim == 3 and pixels.shape[-1] == 4
        if has_opacity:
            return np.asarray(pixels[..., 3] / 255, np.float32)
    return np.ones((1, 1), np.float32)


def _sampled(tile: Floats, uv_tiles: Array) -> Array:
    """The values (R,) of a repeated image `tile` (H, W) at texture coordinates (R, 2), in tiles.

    Values are interpolated bilinearly between pixel centres.
    """
    height, width = tile.shape
    x = uv_tiles[:, 0] * width - 0.5
    y = uv_tiles[:, 1] * height - 0.5
    x0 = np.floor(x).astype(np.int64)
    y0 = np.floor(y).astype(np.int64)
    x_fraction = x - x0
    y_fraction = y - y0
    left = x0 % width
    right = (x0 + 1) % width
    top = y0 % height
    bottom = (y0 + 1) % height
    upper = tile[top, left] * (1 - x_fraction) + tile[top, right] * x_fraction
    lower = tile[bottom, left] * (1 - x_fraction) + tile[bottom, right] * x_fraction
    return np.asarray(upper * (1 - y_fraction) + lower * y_fraction)
