"""The atlas: the places of the corners of faces on the light map."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Rows

CORNER_TEXELS = ((0, 0), (1, 0), (0, 1), (1, 1))  # the columns and rows of four texels, from the upper left one


@dataclass(frozen=True, slots=True)
class Atlas:
    """The places of F faces on a light map (height, width).

    `light_px` (F, 3, 2) are the columns and rows of their corners in texels.
    `chart` (F,) is the chart of each face. It is -1 for faces that show no light: those of a lamp share a block of
    3 x 3 texels, and all others share a block that stays dark. The outermost texels of a chart have their centres on
    its bounding box.
    """

    light_px: Floats
    chart: Indices
    height: int
    width: int

    @property
    def light_uv(self) -> Floats:
        """The places (F, 3, 2) float32 as fractions of the size of the map."""
        size_px = (self.width, self.height)
        return (self.light_px / size_px).astype(np.float32)

    def index(self, places_px: Floats) -> Rows:
        """The flat index (R,) of the texel at each place (R, 2)."""
        column, row = np.floor(places_px).astype(np.int64).T
        row = np.clip(row, 0, self.height - 1)
        column = np.clip(column, 0, self.width - 1)
        return np.asarray(row * self.width + column)

    def read(
        self,
        light: Floats,
        face: Indices,
        u: Floats,
        v: Floats,
    ) -> Floats:
        """The values (R, ...) of a map (H, W, ...) at places of faces, interpolated between the four nearest texels."""
        a, b, c = self.light_px[face].astype(float).swapaxes(0, 1)
        places_px = a + u[:, None] * (b - a) + v[:, None] * (c - a)
        upper_left, share = np.divmod(places_px - 0.5, 1)  # (R, 2) each
        flat = light.reshape(self.height * self.width, -1)
        total = np.zeros((len(share), flat.shape[1]))
        for right, below in CORNER_TEXELS:
            column_weight = np.abs(1 - right - share[:, 0])
            row_weight = np.abs(1 - below - share[:, 1])
            weight = column_weight * row_weight
            texel = self.index(upper_left + np.array([right, below]))
            total += weight[:, None] * flat[texel]
        return total.reshape(len(share), *light.shape[2:])

    def block(self, face: int) -> tuple[slice, slice]:
        """The block of texels that the faces of a lamp share, given one of these faces."""
        column, row = np.floor(self.light_px[face, 0]).astype(int)
        return slice(row - 1, row + 2), slice(column - 1, column + 2)


def doubled_areas_px2(places: Array) -> Array:
    """Twice the areas (F,) of triangles (F, 3, 2), negative for those that are clockwise."""
    first_x, first_y = places[:, 1].T - places[:, 0].T
    second_x, second_y = places[:, 2].T - places[:, 0].T
    return np.asarray(first_x * second_y - first_y * second_x)
