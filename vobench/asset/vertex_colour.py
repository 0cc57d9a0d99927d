"""Colours by vertex as a picture with a patch for every face."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vobench.asset.gltf_material import Look
from vobench.geometry.se3 import Array
from vobench.scene.material import Map, Material, Picture, srgb
from vobench.scene.mesh import MeshArrays

EVEN = 1 / 255  # colours that differ by less are one
LEVELS = 4095  # to which colours are rounded to find faces that share a patch
MOST_LARGE_PATCHES = 1 << 16
FACES_AT_ONCE = 65_536  # that are drawn, which bounds the memory


def painted(
    mesh: MeshArrays,
    colours: Array,
    look: Look,
) -> tuple[MeshArrays, Look]:
    """Linear colours (F, 3, 3) of corners: the material's where there is but one, else a picture with a patch for each.

    Over a texture only their mean is used. In a patch colours run linearly from corner to corner.
    """
    material = look.material
    is_even = np.ptp(colours, axis=(0, 1)).max() < EVEN
    if material.texture or is_even:
        return mesh, _with_mean(look, colours)

    corners = np.round(colours.reshape(-1, 9) * LEVELS).astype(np.int16)
    kinds, kind = np.unique(corners, axis=0, return_inverse=True)
    patch = LARGE_PATCH if len(kinds) < MOST_LARGE_PATCHES else SMALL_PATCH
    columns = int(np.ceil(np.sqrt(len(kinds))))
    picture = _atlas((kinds / LEVELS).astype(np.float32), patch, columns)
    uv = _patch_uv(kind.reshape(-1), patch, columns)
    textured = replace(material, texture=Picture(picture))
    return replace(mesh, uv=uv.reshape(-1, 2)), replace(look, material=textured)


def _with_mean(look: Look, colours: Array) -> Look:
    """A look in the mean of some colours times its own, with a note where they lie over a texture."""
    material = look.material
    notes = look.notes
    if material.texture:
        notes = (*notes, f"material '{look.name}': colours by vertex read as their mean")
    mean = colours.mean((0, 1)) * material.colour
    red, green, blue = np.round(mean, 6).tolist()
    coloured: Material = replace(material, colour=(red, green, blue))
    return replace(look, material=coloured, notes=notes)


class _Patch:
    """A square of `size` texels in whose triangle the texels `first` and `last` are the corners."""

    def __init__(self, size: int, first: int, last: int) -> None:
        self.size = size
        self.first = first
        self.last = last

    def drawn(self, colours: Map) -> NDArray[np.uint8]:
        """Squares (N, size, size, 3) whose corners hold colours (N, 3, 1, 1, 3): corner, right, below."""
        corner, right, below = np.moveaxis(colours, 1, 0)
        length = self.last - self.first
        u = (np.arange(self.size, dtype=np.float32)[:, None] - self.first) / length
        v = u[:, None]
        linear_colours = corner + u * (right - corner) + v * (below - corner)
        # Texels beyond the triangle are seen from far away alone.
        is_beyond = u + v > 1.01 + 1 / length
        return srgb(np.where(is_beyond, (corner + right + below) / 3, linear_colours))


LARGE_PATCH = _Patch(size=8, first=1, last=6)
SMALL_PATCH = _Patch(size=4, first=0, last=3)


def _atlas(
    kinds: Map,
    patch: _Patch,
    columns: int,
) -> NDArray[np.uint8]:
    """A square picture of patches, row by row, of faces' colours (N, 9)."""
    chunks = np.array_split(kinds, len(kinds) // FACES_AT_ONCE + 1)
    patches = np.concatenate([patch.drawn(chunk.reshape(-1, 3, 1, 1, 3)) for chunk in chunks])
    grid = np.resize(patches, (columns, columns, patch.size, patch.size, 3))
    side = columns * patch.size
    return grid.swapaxes(1, 2).reshape(side, side, 3)


def _patch_uv(
    kind: NDArray[np.int64],
    patch: _Patch,
    columns: int,
) -> Array:
    """Texture coordinates (F, 3, 2) of faces in the patch of each one's kind (F,)."""
    row, column = np.divmod(kind, columns)
    corner_px = np.stack([column, row], 1)[:, None] * patch.size + 0.5
    triangle_px = np.array(
        [
            [patch.first, patch.first],
            [patch.last, patch.first],
            [patch.first, patch.last],
        ]
    )
    return np.asarray((corner_px + triangle_px) / (columns * patch.size))
