"""Where each surface's light is kept: one map (H, W) for the whole scene, a rectangle of it per surface."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.scene.scene import Surface

ATLAS_WIDTH = 2048


@dataclass(frozen=True, slots=True)
class Patch:
    """A surface's place in the map: `columns` samples along u, `rows` along v, first one at (row, column).

    The outer samples lie on the surface's edges, so that interpolation never reaches a neighbour.
    """

    row: int
    column: int
    rows: int
    columns: int

    @property
    def window(self) -> tuple[slice, slice]:
        """The patch as an index into the map."""
        return slice(self.row, self.row + self.rows), slice(self.column, self.column + self.columns)

    def fractions(self) -> tuple[Array, Array]:
        """Fractions u and v (rows, columns) of the surface's edges at the samples."""
        u, v = np.meshgrid(np.linspace(0, 1, self.columns), np.linspace(0, 1, self.rows))
        return u, v


@dataclass(frozen=True, slots=True)
class Layout:
    """All patches and the size of the map that holds them."""

    patches: tuple[Patch, ...]
    height: int
    width: int

    def texture_coordinates(self, index: int) -> Array:
        """Coordinates (4, 2) in [0, 1] of a surface's corners: centres of its outer samples."""
        p = self.patches[index]
        u0, u1 = p.column + 0.5, p.column + p.columns - 0.5
        v0, v1 = p.row + 0.5, p.row + p.rows - 0.5
        return np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1]]) / (self.width, self.height)


def layout(surfaces: list[Surface], *, spacing_m: float) -> Layout:
    """Samples every `spacing_m`, packed in shelves, tallest first."""
    sizes = [_samples(surface, spacing_m) for surface in surfaces]
    width = max(ATLAS_WIDTH, *(columns for _, columns in sizes))
    places: dict[int, tuple[int, int]] = {}
    row = column = shelf = 0
    for index in sorted(range(len(sizes)), key=lambda i: (-sizes[i][0], i)):
        rows, columns = sizes[index]
        if column + columns > width:
            row, column, shelf = row + shelf, 0, 0
        places[index] = (row, column)
        column, shelf = column + columns, max(shelf, rows)
    patches = tuple(Patch(*places[i], *sizes[i]) for i in range(len(sizes)))
    return Layout(patches, row + shelf, width)


def _samples(surface: Surface, spacing_m: float) -> tuple[int, int]:
    columns, rows = (max(2, int(np.ceil(edge / spacing_m)) + 1) for edge in surface.size_m)
    return rows, columns
