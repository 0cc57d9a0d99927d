"""Converts the colours of vertices to a texture that has a patch for each face."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vobench.asset.gltf_material import Look
from vobench.geometry.se3 import Array
from vobench.scene.material import Map, Material, Picture, srgb
from vobench.scene.mesh_arrays import MeshArrays

EVEN = 1 / 255  # a mesh whose colours differ by less counts as having one colour
LEVELS = 4095  # colours are rounded to this many levels to find faces that can share a patch
MOST_LARGE_PATCHES = 1 << 16
FACES_AT_ONCE = 65_536  # the number of patches that are drawn in one step, to limit the memory


def painted(mesh: MeshArrays, colours: Array, look: Look) -> tuple[MeshArrays, Look]:
    """The mesh and its look, with linear colours (F, 3, 3) of the corners of the faces applied.

    If all colours are equal, they are multiplied by the colour of the material. Otherwise they become a texture, whose
    patches interpolate linearly between the corners. If the material has a texture already, only the mean of the
    colours is used.
    """
    material = look.material
    largest_difference = np.ptp(colours, axis=(0, 1)).max()
    is_even = largest_difference < EVEN
    if material.texture or is_even:
        return mesh, _with_mean(look, colours)

    face_levels = np.round(colours.reshape(-1, 9) * LEVELS).astype(np.int16)
    patch_levels, patch_index = np.unique(face_levels, axis=0, return_inverse=True)
    patch_colours = (patch_levels / LEVELS).astype(np.float32)
    patch = LARGE_PATCH if len(patch_levels) < MOST_LARGE_PATCHES else SMALL_PATCH
    side = np.sqrt(len(patch_levels))
    columns = int(np.ceil(side))

    picture = _atlas(patch_colours, patch, columns)
    textured = replace(material, texture=Picture(picture))
    uv = _patch_uv(patch_index.reshape(-1), patch, columns)
    return replace(mesh, uv=uv.reshape(-1, 2)), replace(look, material=textured)


def _with_mean(look: Look, colours: Array) -> Look:
    """The look with its colour multiplied by the mean of the vertices' colours.

    If it has a texture, a note is added.
    """
    material = look.material
    notes = look.notes
    if material.texture:
        notes = (*notes, f"material '{look.name}': colours by vertex read as their mean")
    mean = colours.mean((0, 1)) * material.colour
    red, green, blue = np.round(mean, 6).tolist()
    coloured: Material = replace(material, colour=(red, green, blue))
    return replace(look, material=coloured, notes=notes)


class _Patch:
    """A square of `size` texels. Its corners are the centres of the texels `first` and `last` of rows and columns."""

    def __init__(self, size: int, first: int, last: int) -> None:
        self.size = size
        self.first = first
        self.last = last

    def drawn(self, colours: Map) -> NDArray[np.uint8]:
        """Patches (N, size, size, 3) in sRGB, from linear colours (N, 3, 1, 1, 3) of three corners.

        The corners are the upper left one, and those to its right and below it.
        """
        corner, right, below = np.moveaxis(colours, 1, 0)
        length = self.last - self.first
        texel = np.arange(self.size, dtype=np.float32)[:, None]
        u = (texel - self.first) / length
        v = u[:, None]
        along_u = right - corner
        along_v = below - corner
        interpolated = corner + u * along_u + v * along_v

        # Texels outside of the triangle are visible only from far away, where the texture is averaged.
        mean = (corner + right + below) / 3
        is_beyond = u + v > 1.01 + 1 / length
        return srgb(np.where(is_beyond, mean, interpolated))


LARGE_PATCH = _Patch(size=8, first=1, last=6)
SMALL_PATCH = _Patch(size=4, first=0, last=3)


def _atlas(patch_colours: Map, patch: _Patch, columns: int) -> NDArray[np.uint8]:
    """A square picture with a patch for each of the N sets of three corner colours (N, 9), row by row."""
    chunk_count = len(patch_colours) // FACES_AT_ONCE + 1
    chunks = np.array_split(patch_colours, chunk_count)
    drawn = [patch.drawn(chunk.reshape(-1, 3, 1, 1, 3)) for chunk in chunks]
    patches = np.concatenate(drawn)
    grid = np.resize(patches, (columns, columns, patch.size, patch.size, 3))
    side = columns * patch.size
    return grid.swapaxes(1, 2).reshape(side, side, 3)


def _patch_uv(patch_index: NDArray[np.int64], patch: _Patch, columns: int) -> Array:
    """The texture coordinates (F, 3, 2) of the corners of each face, whose patches are given by index (F,)."""
    row, column = np.divmod(patch_index, columns)
    cell = np.stack([column, row], axis=1)
    first_texel_px = cell[:, None] * patch.size + 0.5
    triangle_px = np.array(
        [
            [patch.first, patch.first],
            [patch.last, patch.first],
            [patch.first, patch.last],
        ]
    )
    side_px = columns * patch.size
    return np.asarray((first_texel_px + triangle_px) / side_px)
