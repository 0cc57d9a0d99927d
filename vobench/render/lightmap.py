"""Where each surface's light is kept: one map (H, W) for the whole scene, a rectangle of it per surface."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array
from vobench.scene.surface import Surface

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


def layout(surfaces: Sequence[Surface], *, spacing_m: ArrayLike) -> Layout:
    """Samples every `spacing_m`, one for all or (S,), packed in shelves, tallest first."""
    spacings = np.broadcast_to(np.asarray(spacing_m, float), len(surfaces))
    sizes = [_samples(surface, spacing) for surface, spacing in zip(surfaces, spacings, strict=True)]
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


@dataclass(frozen=True, slots=True)
class Holes:
    """How values of P points fill a map: index (P,) is where each belongs, nearest (H·W,) whose value each sample has.

    Samples inside things have no value of their own and take that of the nearest of their patch, so that
    their darkness does not reach out by interpolation. -1: nobody's.
    """

    index: NDArray[np.int64]
    nearest: NDArray[np.int64]

    def filled(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values (P, ...) as a flat map (H·W, ...)."""
        padded = np.concatenate([values, np.zeros((1, *values.shape[1:]), values.dtype)])
        return padded[self.nearest]


def holes(where: Layout, index: NDArray[np.int64]) -> Holes:
    """For points that belong at flat places `index` (P,)."""
    owner = np.full(where.height * where.width, -1)
    owner[index] = np.arange(len(index))
    nearest = owner.reshape(where.height, where.width)
    for patch in where.patches:
        own = nearest[patch.window]
        if (own < 0).any() and (own >= 0).any():
            rows, columns = scipy.ndimage.distance_transform_edt(own < 0, return_distances=False, return_indices=True)
            nearest[patch.window] = own[rows, columns]
    return Holes(index, nearest.ravel())


@dataclass(frozen=True, slots=True)
class Scales:
    """Light between a fine and a coarse map of the same surfaces."""

    fine: Layout
    coarse: Layout

    def coarsened(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """Of (L, H, W) the means (L, h, w) around each coarse sample; keeps a surface's total."""
        result = np.zeros((len(light), self.coarse.height, self.coarse.width), np.float32)
        for many, few in zip(self.fine.patches, self.coarse.patches, strict=True):
            down_v, down_u = _means(many.rows, few.rows), _means(many.columns, few.columns)
            result[:, *few.window] = down_v @ light[:, *many.window] @ down_u.T
        return result

    def refined(self, light: NDArray[np.float32], among: Sequence[int] | None = None) -> NDArray[np.float32]:
        """Light (L, h, w) smoothed against ray noise, at the fine samples (L, H, W), of some surfaces or all."""
        result = np.zeros((len(light), self.fine.height, self.fine.width), np.float32)
        for index in range(len(self.fine.patches)) if among is None else among:
            many, few = self.fine.patches[index], self.coarse.patches[index]
            up_v, up_u = _between(few.rows, many.rows), _between(few.columns, many.columns)
            result[:, *many.window] = up_v @ light[:, *few.window] @ up_u.T
        return result


SMOOTHING = 0.7  # coarse samples


@lru_cache(maxsize=1024)
def _between(few: int, many: int) -> NDArray[np.float32]:
    """(many, few): linear interpolation of smoothed values."""
    smooth = scipy.ndimage.gaussian_filter1d(np.eye(few), SMOOTHING, axis=0, mode="nearest")
    weights: NDArray[np.float32] = (_linear(few, many) @ smooth).astype(np.float32)
    return weights


@lru_cache(maxsize=1024)
def _means(many: int, few: int) -> NDArray[np.float32]:
    """(few, many): the mean weighted by the hat of linear interpolation; outer samples stand for half an interval."""
    hats = _linear(few, many).T.copy()
    hats[:, [0, -1]] /= 2
    weights: NDArray[np.float32] = (hats / hats.sum(1, keepdims=True)).astype(np.float32)
    return weights


def _linear(few: int, many: int) -> Array:
    """(many, few): what each of few evenly spaced values weighs at each of many places."""
    places = np.linspace(0, few - 1, many)
    weights: Array = np.maximum(1 - np.abs(places[:, None] - np.arange(few)), 0)
    return weights
