"""Light maps: where each surface's light is kept, and the texels it is computed at."""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from vobench import stop
from vobench.geometry.se3 import Array
from vobench.render.geometry import RAY_OFFSET_M, Floats, Indices, Visibility, take
from vobench.scene.material import Material, Polished, fresnel, texture_of
from vobench.scene.surface import Surface

ATLAS_WIDTH = 2048


@dataclass(frozen=True, slots=True)
class Chart:
    """A surface's place in the map: `columns` samples along u, `rows` along v, first one at (row, column).

    The outer samples lie on the surface's edges, so that interpolation never reaches a neighbour.
    """

    row: int
    column: int
    rows: int
    columns: int

    @property
    def window(self) -> tuple[slice, slice]:
        """The chart as an index into the map."""
        return slice(self.row, self.row + self.rows), slice(self.column, self.column + self.columns)

    def fractions(self) -> tuple[Array, Array]:
        """Fractions u and v (rows, columns) of the surface's edges at the samples."""
        u, v = np.meshgrid(np.linspace(0, 1, self.columns), np.linspace(0, 1, self.rows))
        return u, v


@dataclass(frozen=True, slots=True)
class Atlas:
    """All charts and the size of the map that holds them."""

    charts: tuple[Chart, ...]
    height: int
    width: int

    def texture_coordinates(self, index: int) -> Array:
        """Coordinates (4, 2) in [0, 1] of a surface's corners: centres of its outer samples."""
        p = self.charts[index]
        u0, u1 = p.column + 0.5, p.column + p.columns - 0.5
        v0, v1 = p.row + 0.5, p.row + p.rows - 0.5
        return np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1]]) / (self.width, self.height)


def pack_atlas(surfaces: Sequence[Surface], *, spacing_m: ArrayLike) -> Atlas:
    """Samples every `spacing_m`, one for all or (S,), packed in shelves, tallest first."""
    spacings = np.broadcast_to(np.asarray(spacing_m, float), len(surfaces))
    sizes = [
        tuple(max(2, int(np.ceil(edge / spacing)) + 1) for edge in reversed(surface.size_m))
        for surface, spacing in zip(surfaces, spacings, strict=True)
    ]
    width = max(ATLAS_WIDTH, *(columns for _, columns in sizes))
    places: dict[int, tuple[int, int]] = {}
    row = column = shelf = 0
    for index in sorted(range(len(sizes)), key=lambda i: (-sizes[i][0], i)):
        rows, columns = sizes[index]
        if column + columns > width:
            row, column, shelf = row + shelf, 0, 0
        places[index] = (row, column)
        column, shelf = column + columns, max(shelf, rows)
    return Atlas(tuple(Chart(*places[i], *sizes[i]) for i in range(len(sizes))), row + shelf, width)


@dataclass(frozen=True, slots=True)
class Holes:
    """How values of P points fill a map: index (P,) is where each belongs, nearest (H·W,) whose value each sample has.

    Samples inside things have no value of their own and take that of the nearest of their chart, so that
    their darkness does not reach out by interpolation. -1: nobody's.
    """

    index: NDArray[np.int64]
    nearest: NDArray[np.int64]

    def filled(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values (P, ...) as a flat map (H·W, ...)."""
        padded = np.concatenate([values, np.zeros((1, *values.shape[1:]), values.dtype)])
        return padded[self.nearest]


def holes(atlas: Atlas, index: NDArray[np.int64]) -> Holes:
    """For points that belong at flat places `index` (P,)."""
    owner = np.full(atlas.height * atlas.width, -1)
    owner[index] = np.arange(len(index))
    nearest = owner.reshape(atlas.height, atlas.width)
    for chart in atlas.charts:
        own = nearest[chart.window]
        if (own < 0).any() and (own >= 0).any():
            rows, columns = scipy.ndimage.distance_transform_edt(own < 0, return_distances=False, return_indices=True)
            nearest[chart.window] = own[rows, columns]
    return Holes(index, nearest.ravel())


@dataclass(frozen=True, slots=True)
class Scales:
    """Light between a fine and a coarse map of the same surfaces."""

    fine: Atlas
    coarse: Atlas

    def coarsened(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """Of (L, H, W) the means (L, h, w) around each coarse sample; keeps a surface's total."""
        result = np.zeros((len(light), self.coarse.height, self.coarse.width), np.float32)
        for many, few in zip(self.fine.charts, self.coarse.charts, strict=True):
            down_v, down_u = _means(many.rows, few.rows), _means(many.columns, few.columns)
            result[:, *few.window] = down_v @ light[:, *many.window] @ down_u.T
        return result

    def refined(self, light: NDArray[np.float32], among: Sequence[int] | None = None) -> NDArray[np.float32]:
        """Light (L, h, w) smoothed against ray noise, at the fine samples (L, H, W), of some surfaces or all."""
        result = np.zeros((len(light), self.fine.height, self.fine.width), np.float32)
        for index in range(len(self.fine.charts)) if among is None else among:
            many, few = self.fine.charts[index], self.coarse.charts[index]
            up_v, up_u = _between(few.rows, many.rows), _between(few.columns, many.columns)
            result[:, *many.window] = up_v @ light[:, *few.window] @ up_u.T
        return result


SMOOTHING = 0.7  # coarse samples


@lru_cache(maxsize=1024)
def _between(few: int, many: int) -> NDArray[np.float32]:
    """(many, few): linear interpolation of smoothed values."""
    smooth = scipy.ndimage.gaussian_filter1d(np.eye(few), SMOOTHING, axis=0, mode="nearest")
    return np.asarray((_linear(few, many) @ smooth).astype(np.float32))


@lru_cache(maxsize=1024)
def _means(many: int, few: int) -> NDArray[np.float32]:
    """(few, many): the mean weighted by the hat of linear interpolation; outer samples stand for half an interval."""
    hats = _linear(few, many).T.copy()
    hats[:, [0, -1]] /= 2
    return np.asarray((hats / hats.sum(1, keepdims=True)).astype(np.float32))


def _linear(few: int, many: int) -> Array:
    """(many, few): what each of few evenly spaced values weighs at each of many places."""
    places = np.linspace(0, few - 1, many)
    return np.asarray(np.maximum(1 - np.abs(places[:, None] - np.arange(few)), 0))


T = TypeVar("T")
TILTS = ((0.0, 0.0), (1.0, 0.4), (-1.0, -0.3), (0.3, -1.0), (-0.4, 1.0))  # of rays that search a way out
CHUNK = 1 << 14  # points at once: their arrays fit the processor's cache


@dataclass(frozen=True, slots=True)
class Texels:
    """P points: position and normal (P, 3), steps to the next sample along u and v (P, 3).

    index (P,) is flat in the map, surface (P,) in the inventory; eta (P,) of the coat, 0 for none;
    dither (P, 2) in [0, 1) turns each point's pattern of rays.
    """

    points_m: Floats
    normals: Floats
    step_u_m: Floats
    step_v_m: Floats
    index: NDArray[np.int64]
    surface: Indices
    eta: Floats
    dither: Floats

    def __len__(self) -> int:
        return len(self.index)

    take = take

    def entering(self, cosine: Floats) -> Floats:
        """Share (P,) of light that arrives at a cosine (P,) and passes the coat, 1 where there is none."""
        share = np.ones(len(self), np.float32)
        coated = np.flatnonzero(self.eta)
        share[coated] -= fresnel(cosine[coated], self.eta[coated]).astype(np.float32)
        return share

    def cosine(self, way: Floats) -> Floats:
        """Cosine (P,) of the angle between each normal and a way (P, 3)."""
        return np.asarray(np.einsum("ij,ij->i", way, self.normals) / np.linalg.norm(way, axis=1))

    def on_map(self, values: Floats, atlas: Atlas) -> Floats:
        """Values (P,) laid out as the map (H, W); 0 where no point is."""
        flat = np.zeros(atlas.height * atlas.width, np.float32)
        flat[self.index] = values
        return flat.reshape(atlas.height, atlas.width)


def texels(
    surfaces: Sequence[Surface], materials: Mapping[str, Material], atlas: Atlas, *, among: Sequence[int], seed: int
) -> Texels:
    """The points of those surfaces `among` (K,) names that light can show on."""
    flat = np.arange(atlas.height * atlas.width).reshape(atlas.height, atlas.width)
    parts = [_of_surface(i, surfaces[i], materials, atlas, flat) for i in among if _has_body(surfaces[i], materials)]
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else _nothing()
    columns.append(_dither(seed, flat.size)[columns[4]])
    return Texels(*columns)


@lru_cache(maxsize=4)
def _dither(seed: int, count: int) -> Floats:
    """Numbers (count, 2) in [0, 1); kept, as movers ask for the same ones for each picture."""
    return np.random.default_rng([seed, 1]).random((count, 2), dtype=np.float32)


def _has_body(surface: Surface, materials: Mapping[str, Material]) -> bool:
    material = materials.get(surface.material)
    return material is not None and texture_of(material) is not None


def _nothing() -> list[NDArray[Any]]:
    vectors = [np.zeros((0, 3), np.float32)] * 4
    return [*vectors, np.zeros(0, np.int64), np.zeros(0, np.int32), np.zeros(0, np.float32)]


def _of_surface(
    index: int, surface: Surface, materials: Mapping[str, Material], atlas: Atlas, flat: NDArray[np.int64]
) -> list[NDArray[Any]]:
    """All columns of Texels but the last for one surface."""
    chart, material = atlas.charts[index], materials[surface.material]
    # Samples on an edge touch the neighbour; a hair inwards they see past it.
    u, v = (np.clip(fraction.ravel(), 1e-3, 1 - 1e-3) for fraction in chart.fractions())
    vectors = [surface.at(u, v) + RAY_OFFSET_M * surface.normal, surface.normal]
    # Half of an outer sample's area would lie beyond the edge.
    inner_u, inner_v = ((fraction > 0) & (fraction < 1) for fraction in (f.ravel()[:, None] for f in chart.fractions()))
    vectors += [inner_u * surface.edge_u_m / (chart.columns - 1), inner_v * surface.edge_v_m / (chart.rows - 1)]
    eta = material.eta if isinstance(material, Polished) else 0.0
    return [
        *(np.broadcast_to(vector, (len(u), 3)).astype(np.float32) for vector in vectors),
        flat[chart.window].ravel(),
        np.full(len(u), index, np.int32),
        np.full(len(u), eta, np.float32),
    ]


def outside(points: Texels, atlas: Atlas, visibility: Visibility, is_panel: NDArray[np.bool_]) -> Texels:
    """Those that do not lie inside a thing, as does the floor under a crate; next to it they shrink to their middle."""
    parts = in_chunks(lambda part: _buried(points.take(part), visibility, is_panel), len(points))
    inside = np.concatenate([*parts, np.zeros(0, bool)])
    beside = scipy.ndimage.binary_dilation(points.on_map(inside.astype(np.float32), atlas) > 0).ravel()[points.index]
    kept, open_area = points.take(~inside), ~beside[~inside, None]
    return replace(kept, step_u_m=kept.step_u_m * open_area, step_v_m=kept.step_v_m * open_area)


def _buried(points: Texels, visibility: Visibility, is_panel: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which points (P,) see only backs of surfaces."""
    inside = np.ones(len(points), bool)
    for a, b in TILTS:
        some = np.flatnonzero(inside)
        p = points.take(some)
        u_axis, v_axis = tangents(p.normals)
        along = a * u_axis + b * v_axis + p.normals
        hits = visibility.opaque.hits(p.points_m, along)
        behind = np.einsum("ij,ij->i", along, visibility.normals[hits.surface]) > 0
        inside[some] = (hits.surface >= 0) & behind & ~is_panel[hits.surface]
    return inside


def tangents(normals: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (P, 3) each, square to the normals and to each other."""
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]).astype(normals.dtype)
    u = np.cross(helper, normals)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(normals, u)


def in_chunks(
    work: Callable[[slice], T], count: int, *, chunk: int = CHUNK, done: Callable[[float], object] | None = None
) -> list[T]:
    """What `work` gives for each slice of `count` things, in order, on all cores; `done` is called with shares."""
    slices = [slice(start, min(start + chunk, count)) for start in range(0, count, chunk)]

    def checked(part: slice) -> T:
        stop.check()
        return work(part)

    results = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for result in pool.map(checked, slices):
            results.append(result)
            if done:
                done(len(results) / len(slices))
    return results
