"""Indirect light: which surfaces see each other, by rays that follow mirrors and pass panes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.render.direct_light import JITTER, cell_spot
from vobench.render.emitter import cosine_weighted
from vobench.render.geometry import FAR_M, RAY_OFFSET_M, Floats, Hits, Indices, Visibility, smooth_mirror, take
from vobench.render.lightmap import Atlas, Holes, Texels, in_chunks, tangents
from vobench.scene.light import Sky
from vobench.scene.material import Map, Material, Mirror, Polished, fresnel
from vobench.scene.surface import Surface

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

MIRRORS = 4  # followed by one ray
FAINT = 1e-3  # what a mirror returns of a ray is dropped below this
ROWS = 1 << 10  # points at once: times their rays


@dataclass(frozen=True, slots=True)
class SurfaceResponse:
    """What each surface (S,) does with light.

    matt: the share it scatters of the light that enters; eta of its coat, 0 for none; tint and roughness of what
    it mirrors; panels shine; what shows_lamps does so to direct light already.
    """

    matt: Floats
    eta: Floats
    tint: Floats
    roughness: Floats
    is_panel: NDArray[np.bool_]
    shows_lamps: NDArray[np.bool_]

    def mirrored(self, surface: Indices, cosine: Floats) -> Floats:
        """Share (R,) that goes on as from a mirror."""
        return self.tint[surface] * np.where(self.eta[surface] > 0, self._reflected(surface, cosine), 1)

    def scattered(self, surface: Indices, cosine: Floats) -> Floats:
        """Luminance times pi (R,) towards a cosine, per light that entered."""
        return self.matt[surface] * np.where(self.eta[surface] > 0, 1 - self._reflected(surface, cosine), 1)

    def _reflected(self, surface: Indices, cosine: Floats) -> Floats:
        return fresnel(cosine, np.maximum(self.eta[surface], 1.0)).astype(np.float32)


def surface_responses(
    surfaces: Sequence[Surface], materials: Mapping[str, Material], albedo: Mapping[str, Map], panel: Indices
) -> SurfaceResponse:
    """How an inventory's surfaces respond to light."""
    own = [materials.get(s.material) for s in surfaces]
    shiny = [m if isinstance(m, Polished | Mirror) else None for m in own]
    return SurfaceResponse(
        np.array([albedo[s.material].mean() if s.material in albedo else 0 for s in surfaces], np.float32)
        * (panel < 0),
        np.array([m.eta if isinstance(m, Polished) else 0 for m in own], np.float32),
        np.array([m.tint if m else 0 for m in shiny], np.float32),
        np.array([m.roughness if m else 0 for m in shiny], np.float32),
        panel >= 0,
        np.array([smooth_mirror(s, materials) is not None for s in surfaces]),
    )


@dataclass(frozen=True, slots=True)
class FinalGather:
    """Illuminance of points: table (P, H·W) times the map of light, plus sky (K, P), what each sky sends by mirrors."""

    table: "csr_matrix"
    sky: Floats


def final_gather(
    points: Texels,
    atlas: Atlas,
    visibility: Visibility,
    response: SurfaceResponse,
    skies: Sequence[Sky],
    *,
    rays: int,
    done: Callable[[float], object] | None = None,
) -> FinalGather:
    """Send `rays` rays from every point and note where they end; `done` is called with shares."""
    side = round(np.sqrt(rays))
    if not side or not len(points):
        nothing = scipy.sparse.csr_matrix((len(points), atlas.height * atlas.width), dtype=np.float32)
        return FinalGather(nothing, np.zeros((len(skies), len(points)), np.float32))
    gatherer = _Gatherer(atlas, visibility, response, skies)
    parts = in_chunks(lambda part: gatherer.gather(points.take(part), side), len(points), chunk=ROWS, done=done)
    tables, sky = zip(*parts, strict=True)
    return FinalGather(scipy.sparse.vstack(tables, "csr"), np.concatenate(sky, 1))


@dataclass(slots=True)
class _RayBatch:
    """The rays under way: the point they belong to, from where, whereto, and what they weigh.

    is_direct: whether a lamp that they meet next is direct light, and counted as such.
    """

    point: NDArray[np.int64]
    origins_m: Floats
    directions: Floats
    weight: Floats
    is_direct: NDArray[np.bool_]

    take = take

    def joined(self, other: "_RayBatch") -> "_RayBatch":
        return _RayBatch(*(np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(self)))


@dataclass(frozen=True, slots=True)
class _Gatherer:
    atlas: Atlas
    visibility: Visibility
    response: SurfaceResponse
    skies: Sequence[Sky]

    def gather(self, points: Texels, side: int) -> "tuple[csr_matrix, Floats]":
        batch, entries = _start(points, side), []
        sky = np.zeros((len(self.skies), len(points)), np.float32)
        for depth in range(MIRRORS + 1):
            hits = self.visibility.opaque.hits(batch.origins_m, batch.directions)
            reach = np.where(hits.surface < 0, FAR_M, hits.distance)[:, None]
            off_panes = self._off_panes(batch, batch.directions * reach)
            batch.weight *= self.visibility.through_panes(batch.origins_m, batch.directions * reach)
            gone = batch.take(hits.surface < 0)
            for nth, light in enumerate(self.skies) if depth else ():
                luminance = light.luminance_cd_m2(gone.directions)
                sky[nth] += np.bincount(gone.point, np.pi * luminance * gone.weight, minlength=sky.shape[1])
            facing = np.einsum("ij,ij->i", batch.directions, self.visibility.normals[hits.surface])
            met = np.flatnonzero((hits.surface >= 0) & (facing < 0))
            batch, hits, cosine = batch.take(met), hits.take(met), -facing[met]
            shining = self.response.is_panel[hits.surface] & ~batch.is_direct
            factor = batch.weight * np.where(shining, 1, self.response.scattered(hits.surface, cosine))
            entries.append((factor, batch.point, texel_at(self.atlas, hits)))
            batch = self._mirrored(batch, hits, cosine, points.dither)
            batch.is_direct &= depth == 0
            batch = batch.joined(off_panes)
        factor, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
        shape = (len(points), self.atlas.height * self.atlas.width)
        rays = np.float32(side * side)
        return scipy.sparse.csr_matrix((factor / rays, (row, column)), shape, dtype=np.float32), sky / rays

    def _off_panes(self, batch: _RayBatch, way: Floats) -> _RayBatch:
        """The rays that go back from the first pane in their way; a lamp that they meet is no direct light."""
        rays, hits = self.visibility.first_panes(batch.origins_m, way)
        batch, way, normals = batch.take(rays), way[rays], self.visibility.normals[hits.surface]
        along = np.einsum("ij,ij->i", batch.directions, normals)
        ends = batch.origins_m + hits.distance[:, None] * way - RAY_OFFSET_M * batch.directions
        directions = batch.directions - 2 * along[:, None] * normals
        weight = batch.weight * self.visibility.pane_mirrors(hits.surface, along)
        return _RayBatch(batch.point, ends, directions, weight, np.zeros(len(weight), bool)).take(weight > FAINT)

    def _mirrored(self, batch: _RayBatch, hits: Hits, cosine: Floats, dither: Floats) -> _RayBatch:
        weight = batch.weight * self.response.mirrored(hits.surface, cosine)
        on = np.flatnonzero(weight > FAINT)
        batch, surface = batch.take(on), hits.surface[on]
        normals = _facets(self.visibility.normals[surface], self.response.roughness[surface], dither[batch.point], on)
        along = np.einsum("ij,ij->i", batch.directions, normals)[:, None]
        directions = batch.directions - 2 * along * normals
        ends = batch.origins_m + hits.distance[on, None] * batch.directions
        plain = self.visibility.normals[surface]
        # A facet may reflect a ray into its own surface.
        leaving = np.einsum("ij,ij->i", directions, plain) > 0
        shown = self.response.shows_lamps[surface]
        return _RayBatch(batch.point, ends + RAY_OFFSET_M * plain, directions, weight[on], shown).take(leaving)


def _start(points: Texels, side: int) -> _RayBatch:
    """Side x side cosine-weighted rays from each point; their weights average to what enters its coat."""
    rays, count = side * side, len(points)
    spots = [cell_spot(points, cell, side) for cell in range(rays)]
    everywhere = points.take(np.tile(np.arange(count), rays))
    a, b = (np.concatenate(part) for part in zip(*spots, strict=True))
    directions = cosine_weighted(everywhere.normals, a, b)
    weight = everywhere.entering(everywhere.cosine(directions))
    direct = np.ones(len(weight), bool)
    return _RayBatch(np.tile(np.arange(count), rays), everywhere.points_m, directions, weight, direct)


def _facets(normals: Floats, roughness: Floats, dither: Floats, turn: NDArray[np.int64]) -> Floats:
    """Unit normals (R, 3) of facets around a surface's, by GGX. Source: Walter et al. (2007), eqs 35 and 36."""
    rough = np.flatnonzero(roughness)
    a, b = ((dither[rough] + turn[rough, None] * JITTER) % 1).T
    slope = (roughness[rough] * np.sqrt(a / np.maximum(1 - a, 1e-6)))[:, None]
    u_axis, v_axis = tangents(normals[rough])
    angle = 2 * np.pi * b[:, None]
    tilted = normals[rough] + slope * (np.cos(angle) * u_axis + np.sin(angle) * v_axis)
    facets = normals.copy()
    facets[rough] = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    return facets


def texel_at(atlas: Atlas, hits: Hits) -> NDArray[np.int64]:
    """Flat index (R,) in the map of the sample nearest to where each ray ended."""
    row, column, rows, columns = np.array([(p.row, p.column, p.rows, p.columns) for p in atlas.charts]).T
    r = row[hits.surface] + np.rint(hits.v * (rows[hits.surface] - 1)).astype(np.int64)
    c = column[hits.surface] + np.rint(hits.u * (columns[hits.surface] - 1)).astype(np.int64)
    return np.asarray(r * atlas.width + c)


def bounced(direct: Floats, gathered: FinalGather, skies: Sequence[int], holes: Holes, *, bounces: int) -> Floats:
    """Illuminance (L, H, W) after one bounce or more, of direct light (L, H, W).

    skies: the layers that gathered.sky belong to, in order; holes: see lightmap.
    """
    straight = direct.reshape(len(direct), -1).T
    by_mirrors = np.zeros((len(holes.index), len(direct)), np.float32)
    by_mirrors[:, skies] = gathered.sky.T
    total = np.zeros_like(straight)
    for _ in range(bounces):
        total = holes.filled(gathered.table @ (straight + total) + by_mirrors)
    return np.ascontiguousarray(total.T).reshape(direct.shape)
