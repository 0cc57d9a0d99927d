"""The textures of batches in graphics memory, reduced if they are too large together."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.rendering.batch import Batch
from vobench.rendering.gl_texture import SurfaceTexture
from vobench.scene.material import Material, Texture

MOST_TEXELS = 1 << 26  # the largest sum of the texels of all textures; in colour they occupy half a gigabyte


class BatchTextures(NamedTuple):
    """The textures of a batch, None if it has none."""

    body: SurfaceTexture | None
    emission: SurfaceTexture | None


def batch_textures(batches: Sequence[Batch]) -> list[BatchTextures]:
    """Upload the textures of all batches, reduced if their texels exceed MOST_TEXELS. Equal textures are shared."""
    materials = [batch.material for batch in batches]
    uploaded = _surface_textures(_distinct_textures(materials))
    textures_of_batches = []
    for material in materials:
        body = uploaded[material.texture] if material.texture else None
        emission = uploaded[material.emission_texture] if material.emission_texture else None
        textures_of_batches.append(BatchTextures(body, emission))
    return textures_of_batches


def _distinct_textures(materials: Sequence[Material]) -> list[Texture]:
    """The textures of materials without repetition, in the order of their first use."""
    textures = dict[Texture, None]()
    for material in materials:
        for texture in (material.texture, material.emission_texture):
            if texture:
                textures[texture] = None
    return list(textures)


def _surface_textures(textures: Sequence[Texture]) -> dict[Texture, SurfaceTexture]:
    pictures = [texture.pixels() for texture in textures]
    texel_counts = np.array([np.prod(picture.shape[:2]) for picture in pictures], float)
    halving_counts = halvings(texel_counts).tolist()
    surface_textures = {}
    for texture, picture, halving_count in zip(textures, pictures, halving_counts, strict=True):
        surface_textures[texture] = SurfaceTexture(picture, halvings=halving_count)
    return surface_textures


def halvings(texel_counts: Array) -> NDArray[np.intp]:
    """How often the sides of each texture (N,) are halved, so that the texels sum to at most MOST_TEXELS.

    `texel_counts` (N,) are the texels at full resolution. In each step, the largest remaining texture is halved.
    """
    counts = np.zeros(len(texel_counts), np.intp)
    while True:
        reduced_texel_counts = texel_counts / 4.0**counts
        if reduced_texel_counts.sum() <= MOST_TEXELS:
            return counts
        counts[np.argmax(reduced_texel_counts)] += 1
