"""Indirect light: surfels, which of them see each other by rays that follow mirrors and pass panes, and bounces."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas
from vobench.rendering.direct_light import JITTER, cell_spot
from vobench.rendering.embree import Hits
from vobench.rendering.emitter import cosine_weighted
from vobench.rendering.geometry import FAR_M, RAY_OFFSET_M, face_materials, take, tangents
from vobench.rendering.texel import Texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.thread_pool import chunked, in_chunks
from vobench.rendering.unwrap import nearest_axis
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE, Material, fresnel, linear_texture, under_coat
from vobench.scene.mesh import Triangles

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

RAISED = 0.25  # of a cell, above their faces: places that see each other there share light
NEIGHBOURS = 9  # surfels whose light a texel may take, its own included
WIDTH = 1.2  # square of the blend's width, in cells
TURNED = 2.0  # cells that two opposite normals are apart by, and by half
LEAST = 0.02  # of the weights of a blend


@dataclass(frozen=True, slots=True)
class Surfels:
    """Groups of points of one thing in one cell, that look the same of six ways and see each other.

    of (P,): the group that a point is in; middle (S,): the point that stands for it; step_m (S,): its cell's side.
    """

    of: Indices
    middle: Rows
    step_m: Floats

    def __len__(self) -> int:
        return len(self.middle)

    def mean(self, values: Floats, weights: Floats) -> Floats:
        """Weighted means (S, C) of points' values (P, C)."""
        total = np.maximum(np.bincount(self.of, weights, len(self)), 1e-30)
        sums = [np.bincount(self.of, weights * column, len(self)) for column in values.T]
        return (np.stack(sums, -1) / total[:, None]).astype(np.float32)


def surfels(points: Texels, thing: Indices, step_m: Floats, visibility: Visibility) -> Surfels:
    """Of points whose things (P,) and cells' sides (P,) are known."""
    cell = np.floor(points.points_m / step_m[:, None]).astype(np.int64)
    cell -= cell.min(0, initial=0)
    key = thing.astype(np.int64) * 6 + nearest_axis(points.planes)
    for axis in cell.T:
        key = key * (axis.max(initial=0) + 1) + axis
    of, middle = _grouped(key, points.points_m)
    # What a thin wall parts is not one.
    high = points.points_m + RAISED * step_m[:, None] * points.planes
    beyond = chunked(lambda part: visibility.opaque.occluded(high[part], high[middle[of[part]]]), len(points))
    of, middle = _grouped(2 * of + beyond, points.points_m)
    return Surfels(of.astype(np.int32), middle, step_m[middle].astype(np.float32))


def _grouped(key: Rows, points_m: Floats) -> tuple[Rows, Rows]:
    """Groups (P,) of equal keys (P,), and the point nearest to the mean of each."""
    of = np.unique(key, return_inverse=True)[1].ravel()
    count = np.bincount(of)
    mean = np.stack([np.bincount(of, axis) for axis in points_m.T], -1) / np.maximum(count, 1)[:, None]
    apart = ((points_m - mean[of]) ** 2).sum(1)
    order = np.lexsort((apart, of))
    return of, order[np.cumsum(count) - count]


def blend(points: Texels, groups: Surfels, layout: TexelLayout, visibility: Visibility, usable: Mask) -> "csr_matrix":
    """What each texel of the map takes from surfels (H·W, S): those near it that see its own and look its way."""
    p = points.points_m[groups.middle]
    n = points.normals[groups.middle]
    step = groups.step_m[:, None]
    known = np.flatnonzero(usable)
    if not len(known):
        return scipy.sparse.csr_matrix((layout.source.size, len(groups)), dtype=np.float32)
    tree = scipy.spatial.cKDTree(np.hstack([p, TURNED * step * n])[known])
    near = tree.query(np.hstack([p, TURNED * step * n]), k=min(NEIGHBOURS, len(known)))[1].reshape(len(groups), -1)
    near = known[near]
    high = p + RAISED * step * points.planes[groups.middle]
    own = np.repeat(np.arange(len(groups)), near.shape[1])
    hidden = chunked(lambda part: visibility.opaque.occluded(high[own[part]], p[near.ravel()[part]]), len(own))
    hidden = hidden.reshape(near.shape) & (near != np.arange(len(groups))[:, None])
    hidden &= ~hidden.all(1, keepdims=True)
    blends = in_chunks(
        lambda part: _weights(points.take(part), groups, groups.of[part], near, hidden=hidden, middles=(p, n)),
        len(points),
    )
    table = scipy.sparse.vstack([*blends, scipy.sparse.csr_matrix((1, len(groups)), dtype=np.float32)], "csr")
    return table[layout.source]


def _weights(
    points: Texels, groups: Surfels, of: Indices, near: Rows, *, hidden: Mask, middles: tuple[Floats, Floats]
) -> "csr_matrix":
    near = near[of]
    hidden = hidden[of]
    step = groups.step_m[of, None]
    apart = ((points.points_m[:, None] - middles[0][near]) ** 2).sum(-1) / step**2
    apart += ((points.normals[:, None] - middles[1][near]) ** 2).sum(-1) * TURNED**2
    weights = np.where(hidden, 0, np.exp(-(apart - np.where(hidden, np.inf, apart).min(1, keepdims=True)) / WIDTH))
    weights[weights < LEAST * weights.sum(1, keepdims=True)] = 0
    weights /= weights.sum(1, keepdims=True)
    rows = np.repeat(np.arange(len(of)), near.shape[1])
    table = scipy.sparse.csr_matrix((weights.ravel().astype(np.float32), (rows, near.ravel())), (len(of), len(groups)))
    table.eliminate_zeros()
    return table


MOST_PX = 256  # along a texture's side, finer than texels are apart


def albedo(faces: Triangles, materials: Mapping[str, Material], points: Texels) -> Floats:
    """Linear reflectance (P, 3) of the body there, of what its coat lets in."""
    result = np.zeros((len(points), 3), np.float32)
    number = {name: nth for nth, name in enumerate(materials)}
    of = np.array([number.get(thing.material, -1) for thing in faces.things], np.int32)[faces.thing[points.face]]
    weights = np.column_stack([1 - points.uv.sum(1), points.uv])
    for name, material in materials.items():
        own = np.flatnonzero(of == number[name])
        if len(own) and material.kind == "body":
            tile = _tile(material)
            rows, columns = tile.shape[:2]
            uv = np.einsum("ni,nij->nj", weights[own], faces.uv[points.face[own]]) / material.tile_m % 1
            values = tile[(uv[:, 1] * rows).astype(int) % rows, (uv[:, 0] * columns).astype(int) % columns]
            values = np.clip(values * np.array(material.colour), 0, 0.99)
            result[own] = (1 - material.metal) * (under_coat(values, material.eta) if material.is_coated else values)
    return result


def _tile(material: Material) -> Floats:
    """Linear reflectance (h, w, 3), or (h, w, 1) of a grey one, of a texture, coarse."""
    if material.texture is None:
        return np.ones((1, 1, 1), np.float32)
    pixels = linear_texture(material.texture)
    height, width = (min(side, MOST_PX) for side in pixels.shape[:2])
    small = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small.reshape(height, width, -1), np.float32)


MIRRORS = 4  # followed by one ray
FAINT = 1e-3  # what a mirror returns of a ray is dropped below this
ROWS = 1 << 10  # points at once: times their rays
MOST_RAYS = 25_000_000  # in one table


@dataclass(frozen=True, slots=True)
class Response:
    """What each face (F,), and the last one for nothing, does with light.

    scatters: whether it has a body; eta of its coat, 0 for none; tint and roughness of what it mirrors; metal: the
    share that it mirrors without a coat; lamp it belongs to, -1 for none; what shows_lamps does so to direct light.
    """

    scatters: Mask
    eta: Floats
    tint: Floats
    metal: Floats
    roughness: Floats
    lamp: Indices
    shows_lamps: Mask

    def mirrored(self, face: Indices, cosine: Floats) -> Floats:
        """Share (R,) that goes on as from a mirror."""
        coat = np.where(self.eta[face] > 0, self._reflected(face, cosine), 0)
        return np.asarray(self.tint[face] * coat + (1 - coat) * self.metal[face])

    def scattered(self, face: Indices, cosine: Floats) -> Floats:
        """Luminance times pi (R,) towards a cosine, per light that entered and was scattered."""
        return self.scatters[face] * np.where(self.eta[face] > 0, 1 - self._reflected(face, cosine), 1)

    def _reflected(self, face: Indices, cosine: Floats) -> Floats:
        return fresnel(cosine, np.maximum(self.eta[face], 1.0)).astype(np.float32)


def response(faces: Triangles, materials: Mapping[str, Material], visibility: Visibility) -> Response:
    """How a table's faces respond to light. Metal mirrors in the luminance of its colour."""
    own = [*face_materials(faces, materials), None]
    thing = np.append(faces.thing, len(own) - 1)
    bodies = [m if m and m.kind == "body" else Material("mirror", tint=0) for m in own]
    metals = [
        m.tint if m and m.kind == "mirror" else b.metal * float(np.array(b.colour) @ LUMINANCE)
        for m, b in zip(own, bodies, strict=True)
    ]
    shows = np.zeros(len(thing), bool)
    shows[[face for mirror, *_ in visibility.mirrors for face in mirror.faces]] = True
    return Response(
        np.array([b.kind == "body" for b in bodies])[thing],
        np.array([b.eta if b.is_coated else 0 for b in bodies], np.float32)[thing],
        np.array([b.tint for b in bodies], np.float32)[thing],
        np.array(metals, np.float32)[thing],
        np.array([m.roughness if m else 0 for m in own], np.float32)[thing],
        np.append(faces.lamp, -1),
        shows,
    )


@dataclass(frozen=True, slots=True)
class FinalGather:
    """Illuminance of points: table (P, S + L) times the radiosity of surfels and lamps, plus sky (K, P) by mirrors.

    hits (H·W,) counts where rays ended on the map; escaped (P,) the share that left the scene by no pane to the sky.
    """

    table: "csr_matrix"
    sky: Floats
    hits: Rows
    escaped: Floats


@dataclass(slots=True)
class _RayBatch:
    """The rays under way: the point they belong to, from where, whereto, and what they weigh.

    is_direct: whether a lamp that they meet next is direct light, and counted as such.
    """

    point: Rows
    origins_m: Floats
    directions: Floats
    weight: Floats
    is_direct: Mask

    take = take

    def joined(self, other: "_RayBatch") -> "_RayBatch":
        return _RayBatch(*(np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(self)))


@dataclass(frozen=True, slots=True)
class Gatherer:
    """Sends rays from points and notes where they end; surfel_of (H·W,) is the surfel of each texel, -1 for none."""

    atlas: Atlas
    visibility: Visibility
    response: Response
    skies: Sequence[Sky]
    surfel_of: Indices
    surfels: int
    lamps: int

    def gather(self, points: Texels, *, rays: int, done: Callable[[float], object] | None = None) -> FinalGather:
        """Send about `rays` rays from every point; `done` is called with shares."""
        side = int(np.sqrt(min(rays, MOST_RAYS / max(len(points), 1))))
        found = []
        if side and len(points):
            found = in_chunks(lambda part: self._gather(points.take(part), side), len(points), chunk=ROWS, done=done)
        ends = np.concatenate([np.zeros(0, np.int32), *(part[3] for part in found)])
        hits = np.bincount(ends, minlength=self.atlas.height * self.atlas.width)
        shape = (0 if found else len(points), self.surfels + self.lamps)
        nothing = scipy.sparse.csr_matrix(shape, dtype=np.float32)
        sky = np.concatenate([np.zeros((len(self.skies), shape[0]), np.float32), *(part[1] for part in found)], 1)
        escaped = np.concatenate([np.ones(shape[0], np.float32), *(part[2] for part in found)])
        return FinalGather(scipy.sparse.vstack([nothing, *(part[0] for part in found)], "csr"), sky, hits, escaped)

    def _gather(self, points: Texels, side: int) -> "tuple[csr_matrix, Floats, Floats, Indices]":
        batch = _start(points, side)
        entries = []
        ends = []
        rays = np.float32(side * side)
        sky = np.zeros((len(self.skies), len(points)), np.float32)
        escaped = np.zeros(len(points), np.float32)
        for depth in range(MIRRORS + 1):
            hits = self.visibility.opaque.hits(batch.origins_m, batch.directions)
            way = batch.directions * np.where(hits.face < 0, FAR_M, hits.distance)[:, None]
            off_panes = self._off_panes(batch, way)
            batch.weight *= self.visibility.through_panes(batch.origins_m, way)
            gone = batch.take(hits.face < 0)
            if not depth:
                bare = ~self.visibility.crosses_sky_pane(gone.origins_m, FAR_M * gone.directions)
                escaped += np.bincount(gone.point, bare, minlength=len(points)).astype(np.float32) / rays
            for nth, light in enumerate(self.skies) if depth else ():
                luminance = light.luminance_cd_m2(gone.directions)
                sky[nth] += np.bincount(gone.point, np.pi * luminance * gone.weight, minlength=sky.shape[1])
            facing = np.einsum("ij,ij->i", batch.directions, self.visibility.normals[hits.face])
            met = np.flatnonzero((hits.face >= 0) & (facing < 0))
            batch = batch.take(met)
            hits = hits.take(met)
            cosine = -facing[met]
            lamp = self.response.lamp[hits.face]
            texel = self.atlas.index(hits.at(self.atlas.light_px))
            factor = batch.weight * np.where(lamp >= 0, ~batch.is_direct, self.response.scattered(hits.face, cosine))
            column = np.where(lamp >= 0, self.surfels + lamp, self.surfel_of[texel])
            kept = (column >= 0) & (factor > 0)
            entries.append((factor[kept], batch.point[kept], column[kept]))
            ends.append(texel[kept])
            batch = self._mirrored(batch, hits, cosine, points.dither)
            batch.is_direct &= depth == 0
            batch = batch.joined(off_panes)
            if not len(batch.point):
                break
        factor, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
        shape = (len(points), self.surfels + self.lamps)
        table = scipy.sparse.csr_matrix((factor / rays, (row, column)), shape, dtype=np.float32)
        return table, sky / rays, escaped, np.concatenate(ends).astype(np.int32)

    def _off_panes(self, batch: _RayBatch, way: Floats) -> _RayBatch:
        """The rays that go back from the first pane in their way; a lamp that they meet is no direct light."""
        rays, hits = self.visibility.first_panes(batch.origins_m, way)
        batch = batch.take(rays)
        way = way[rays]
        normals = self.visibility.normals[hits.face]
        along = np.einsum("ij,ij->i", batch.directions, normals)
        ends = batch.origins_m + hits.distance[:, None] * way - RAY_OFFSET_M * batch.directions
        directions = batch.directions - 2 * along[:, None] * normals
        weight = batch.weight * self.visibility.pane_mirrors(hits.face, along)
        return _RayBatch(batch.point, ends, directions, weight, np.zeros(len(weight), bool)).take(weight > FAINT)

    def _mirrored(self, batch: _RayBatch, hits: Hits, cosine: Floats, dither: Floats) -> _RayBatch:
        weight = batch.weight * self.response.mirrored(hits.face, cosine)
        on = np.flatnonzero(weight > FAINT)
        batch = batch.take(on)
        face = hits.face[on]
        plain = self.visibility.normals[face]
        normals = _facets(plain, self.response.roughness[face], dither[batch.point], on)
        along = np.einsum("ij,ij->i", batch.directions, normals)[:, None]
        directions = batch.directions - 2 * along * normals
        ends = batch.origins_m + hits.distance[on, None] * batch.directions
        # A facet may reflect a ray into its own surface.
        leaving = np.einsum("ij,ij->i", directions, plain) > 0
        shown = self.response.shows_lamps[face]
        return _RayBatch(batch.point, ends + RAY_OFFSET_M * plain, directions, weight[on], shown).take(leaving)


def _start(points: Texels, side: int) -> _RayBatch:
    """Side x side cosine-weighted rays from each point; their weights average to what enters its coat."""
    directions = cosine_weighted(points.normals)(*cell_spot(points, np.arange(side**2)[:, None], side))
    cosines = points.cosine(directions)
    weight = (points.entering(cosines) * (cosines > 0)).ravel()
    origins = np.tile(points.points_m, (side**2, 1))
    of = np.tile(np.arange(len(points)), side**2)
    return _RayBatch(of, origins, directions.reshape(-1, 3), weight, np.ones(len(of), bool))


def _facets(normals: Floats, roughness: Floats, dither: Floats, turn: NDArray[np.int64]) -> Floats:
    """Unit normals (R, 3) of facets around a face's, by GGX. Source: Walter et al. (2007), eqs 35 and 36."""
    rough = np.flatnonzero(roughness)
    a, b = ((dither[rough] + turn[rough, None] * JITTER) % 1).T
    slope = (roughness[rough] * np.sqrt(a / np.maximum(1 - a, 1e-6)))[:, None]
    u_axis, v_axis = tangents(normals[rough])
    angle = 2 * np.pi * b[:, None]
    tilted = normals[rough] + slope * (np.cos(angle) * u_axis + np.sin(angle) * v_axis)
    facets = normals.copy()
    facets[rough] = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    return facets


# Bounces of a ratio this even, whose rest is this small a share of the light, or a rest too faint, are summed up.
EVEN = 2e-3
REST = 0.03
FAINT_REST = 1e-4


def bounced(straight: Floats, reflectance: Floats, gathered: FinalGather, first: Floats, *, bounces: int) -> Floats:
    """Illuminance (K, S, C) of surfels by one bounce or more, of the radiosity (K, S, C) that direct light gives them.

    reflectance (S, C) of surfels; first (K, S): what comes by mirrors from lamps and the sky, grey. In the end each
    bounce is the same share of the one before, so the last ones are the sum of a geometric series.
    """
    count, size, channels = straight.shape
    table = gathered.table[:, :size]
    columns = (size, count * channels)
    if not bounces:
        return np.zeros(straight.shape, np.float32)
    by_mirrors = np.repeat(first.T[..., None], channels, 2).reshape(columns).astype(np.float32)
    step = table @ straight.transpose(1, 0, 2).reshape(columns) + by_mirrors
    total = step.copy()
    again = np.tile(reflectance, (1, count))
    ratio = np.zeros(columns[1])
    for left in reversed(range(bounces - 1)):
        last = step.sum(0, dtype=float)
        step = table @ (again * step)
        total += step
        earlier = ratio
        ratio = np.clip(step.sum(0, dtype=float) / np.maximum(last, 1e-30), 0, 0.999)
        rest = ratio * (1 - ratio**left) / (1 - ratio)
        share = rest * step.sum(0) / np.maximum(total.sum(0), 1e-30)
        if ((share <= FAINT_REST) | (np.abs(ratio - earlier) <= EVEN) & (share <= REST)).all():
            total += step * rest.astype(np.float32)
            break
    return np.ascontiguousarray(total.reshape(size, count, channels).transpose(1, 0, 2))
