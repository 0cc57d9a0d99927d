"""The points where light is computed: the samples in the map of surfaces that have a body."""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench import stop
from vobench.render.geometry import RAY_OFFSET_M, Floats, Indices
from vobench.render.lightmap import Layout
from vobench.render.sight import Sight
from vobench.scene.material import Material, Polished, fresnel, texture_of
from vobench.scene.surface import Surface

T = TypeVar("T")
TILTS = ((0.0, 0.0), (1.0, 0.4), (-1.0, -0.3), (0.3, -1.0), (-0.4, 1.0))  # of rays that look for a way out
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

    def take(self, which: NDArray[np.int64] | NDArray[np.bool_] | slice) -> "Texels":
        """Some of the points."""
        return Texels(*(getattr(self, f.name)[which] for f in fields(self)))

    def entering(self, cosine: Floats) -> Floats:
        """Share (P,) of light that arrives at a cosine (P,) and passes the coat, 1 where there is none."""
        share = np.ones(len(self), np.float32)
        coated = np.flatnonzero(self.eta)
        share[coated] -= fresnel(cosine[coated], self.eta[coated]).astype(np.float32)
        return share

    def cosine(self, way: Floats) -> Floats:
        """Cosine (P,) of the angle between each normal and a way (P, 3)."""
        cosine: Floats = np.einsum("ij,ij->i", way, self.normals) / np.linalg.norm(way, axis=1)
        return cosine

    def on_map(self, values: Floats, where: Layout) -> Floats:
        """Values (P,) laid out as the map (H, W); 0 where no point is."""
        flat = np.zeros(where.height * where.width, np.float32)
        flat[self.index] = values
        return flat.reshape(where.height, where.width)


def texels(
    surfaces: Sequence[Surface], materials: Mapping[str, Material], where: Layout, *, among: Sequence[int], seed: int
) -> Texels:
    """The points of those surfaces `among` (K,) names that light can show on."""
    flat = np.arange(where.height * where.width).reshape(where.height, where.width)
    parts = [_of_surface(i, surfaces[i], materials, where, flat) for i in among if _has_body(surfaces[i], materials)]
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
    index: int, surface: Surface, materials: Mapping[str, Material], where: Layout, flat: NDArray[np.int64]
) -> list[NDArray[Any]]:
    """All columns of Texels but the last for one surface."""
    patch, material = where.patches[index], materials[surface.material]
    # Samples on an edge touch the neighbour; a hair inwards they see past it.
    u, v = (np.clip(fraction.ravel(), 1e-3, 1 - 1e-3) for fraction in patch.fractions())
    vectors = [surface.at(u, v) + RAY_OFFSET_M * surface.normal, surface.normal]
    # Half of an outer sample's area would lie beyond the edge.
    inner_u, inner_v = ((fraction > 0) & (fraction < 1) for fraction in (f.ravel()[:, None] for f in patch.fractions()))
    vectors += [inner_u * surface.edge_u_m / (patch.columns - 1), inner_v * surface.edge_v_m / (patch.rows - 1)]
    eta = material.eta if isinstance(material, Polished) else 0.0
    return [
        *(np.broadcast_to(vector, (len(u), 3)).astype(np.float32) for vector in vectors),
        flat[patch.window].ravel(),
        np.full(len(u), index, np.int32),
        np.full(len(u), eta, np.float32),
    ]


def outside(points: Texels, where: Layout, sight: Sight, is_panel: NDArray[np.bool_]) -> Texels:
    """Those that do not lie inside a thing, as does the floor under a crate; next to it they shrink to their middle."""
    parts = in_chunks(lambda part: _buried(points.take(part), sight, is_panel), len(points))
    inside = np.concatenate([*parts, np.zeros(0, bool)])
    beside = scipy.ndimage.binary_dilation(points.on_map(inside.astype(np.float32), where) > 0).ravel()[points.index]
    kept, open_area = points.take(~inside), ~beside[~inside, None]
    return replace(kept, step_u_m=kept.step_u_m * open_area, step_v_m=kept.step_v_m * open_area)


def _buried(points: Texels, sight: Sight, is_panel: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which points (P,) see only backs of surfaces."""
    inside = np.ones(len(points), bool)
    for a, b in TILTS:
        some = np.flatnonzero(inside)
        p = points.take(some)
        u_axis, v_axis = tangents(p.normals)
        along = a * u_axis + b * v_axis + p.normals
        hits = sight.opaque.hits(p.points_m, along)
        behind = np.einsum("ij,ij->i", along, sight.normals[hits.surface]) > 0
        inside[some] = (hits.surface >= 0) & behind & ~is_panel[hits.surface]
    return inside


def tangents(normals: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (P, 3) each, square to the normals and to each other."""
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]).astype(normals.dtype)
    u = np.cross(helper, normals)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(normals, u)


def in_chunks(
    work: Callable[[slice], T], count: int, *, chunk: int = CHUNK, done: Callable[[int], object] | None = None
) -> list[T]:
    """What `work` gives for each slice of `count` things, in their order, on all cores; `done` is told how many."""
    slices = [slice(start, min(start + chunk, count)) for start in range(0, count, chunk)]

    def looked(part: slice) -> T:
        stop.check()
        return work(part)

    results = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for part, result in zip(slices, pool.map(looked, slices), strict=True):
            results.append(result)
            if done:
                done(part.stop - part.start)
    return results
