"""The albedo of surfaces: the share of light that their bodies scatter, for each colour."""

from collections.abc import Mapping

import cv2
import numpy as np

from vobench.rendering.array_types import Floats
from vobench.rendering.geometry import lengths
from vobench.rendering.texel import Texels
from vobench.rendering.texture_mean import rectangle_means
from vobench.scene.material import Material, linear_texture, under_coat
from vobench.scene.triangles import Triangles

MOST_PX = 256  # the largest side of a texture; it is still finer than the distance between points
LARGEST_ALBEDO = 0.99  # limits the albedo, so that the sum of all bounces is finite


def albedo(
    faces: Triangles,
    materials: Mapping[str, Material],
    points: Texels,
) -> Floats:
    """The linear albedo (P, 3) of the bodies at points: the share of the light that enters their coats.

    That of a texture is its mean over the square that a point stands for. It is 0 for lamps, mirrors, panes and bare
    metal.
    """
    result = np.zeros((len(points), 3), np.float32)
    index_by_name = {name: index for index, name in enumerate(materials)}
    index_by_thing = np.array([index_by_name.get(thing.material, -1) for thing in faces.things], np.int32)
    index_by_point = index_by_thing[faces.thing[points.face]]
    corner_weights = np.column_stack([1 - points.uv.sum(1), points.uv])
    # At the rim of a chart, one of the steps may be zero.
    spacing_m = np.maximum(lengths(points.step_u_m), lengths(points.step_v_m))
    for name, material in materials.items():
        rows = np.flatnonzero(index_by_point == index_by_name[name])
        if not len(rows) or material.kind != "body":
            continue
        corners_uv = faces.uv[points.face[rows]]
        uv_tiles = np.einsum("ni,nij->nj", corner_weights[rows], corners_uv) / material.tile_m % 1
        tile = _reduced_texture(material)
        pixels_per_tile = np.array([tile.shape[1], tile.shape[0]])
        sizes_px = spacing_m[rows, None] / material.tile_m * pixels_per_tile
        colours = rectangle_means(tile, uv_tiles * pixels_per_tile, sizes_px) * np.array(material.colour)
        reflectance = np.clip(colours, 0, LARGEST_ALBEDO)
        scattered = under_coat(reflectance, material.eta) if material.is_coated else reflectance
        result[rows] = (1 - material.metal) * scattered
    return result


def _reduced_texture(material: Material) -> Floats:
    """The linear texture (h, w, 3) of a material, or (h, w, 1) in grey, with at most MOST_PX pixels along a side."""
    if material.texture is None:
        return np.ones((1, 1, 1), np.float32)
    pixels = linear_texture(material.texture)
    height = min(pixels.shape[0], MOST_PX)
    width = min(pixels.shape[1], MOST_PX)
    small = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small.reshape(height, width, -1), np.float32)
