"""Indirect light: surfels, which of them see each other by rays that follow mirrors and pass panes, and bounces."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas
from vobench.rendering.direct_light import JITTER, place_in_cell
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
    """Groups of points of one thing in one cell, whose normals are nearest to one axis and that see each other.

    of (P,): the group that a point is in; middle (S,): the point that stands for it; step_m (S,): its cell's side.
    """

    of: Indices
    middle: Rows
    step_m: Floats

    def __len__(self) -> int:
        return len(self.middle)

    def mean(self, values: Floats, weights: Floats) -> Floats:
        """Weighted means (S, C) of points' values (P, C)."""
        totals = np.maximum(np.bincount(self.of, weights, len(self)), 1e-30)
        sums = [np.bincount(self.of, weights * column, len(self)) for column in values.T]
        means = np.stack(sums, -1) / totals[:, None]
        return means.astype(np.float32)


def surfels(
    points: Texels,
    thing: Indices,
    step_m: Floats,
    visibility: Visibility,
) -> Surfels:
    """The surfels of points whose things (P,) and cells' sides (P,) are known."""
    cell = np.floor(points.points_m / step_m[:, None]).astype(np.int64)
    cell -= cell.min(0, initial=0)
    key = thing.astype(np.int64) * 6 + nearest_axis(points.planes)
    for coordinate in cell.T:
        key = key * (coordinate.max(initial=0) + 1) + coordinate
    group, middle = _grouped(key, points.points_m)

    # Points on both sides of a thin wall are not one surfel.
    raised_m = points.points_m + RAISED * step_m[:, None] * points.planes

    def hidden(part: slice) -> Mask:
        return visibility.opaque.occluded(raised_m[part], raised_m[middle[group[part]]])

    is_beyond = chunked(hidden, len(points))
    group, middle = _grouped(2 * group + is_beyond, points.points_m)
    return Surfels(group.astype(np.int32), middle, step_m[middle].astype(np.float32))


def _grouped(key: Rows, points_m: Floats) -> tuple[Rows, Rows]:
    """Groups (P,) of equal keys (P,), and the point nearest to the mean of each."""
    group = np.unique(key, return_inverse=True)[1].ravel()
    count = np.bincount(group)
    coordinate_sums_m = [np.bincount(group, coordinate) for coordinate in points_m.T]
    sums_m = np.stack(coordinate_sums_m, -1)
    mean_m = sums_m / np.maximum(count, 1)[:, None]
    squared_m2 = ((points_m - mean_m[group]) ** 2).sum(1)
    order = np.lexsort((squared_m2, group))
    first = np.cumsum(count) - count
    return group, order[first]


def blend(
    points: Texels,
    groups: Surfels,
    layout: TexelLayout,
    visibility: Visibility,
    usable: Mask,
) -> "csr_matrix":
    """Weights (H·W, S) of surfels at each texel of the map: of those near it that see its surfel and face alike."""
    known = np.flatnonzero(usable)
    if not len(known):
        return scipy.sparse.csr_matrix((layout.source.size, len(groups)), dtype=np.float32)
    middles_m = points.points_m[groups.middle]
    normals = points.normals[groups.middle]
    step_m = groups.step_m[:, None]
    places = np.hstack([middles_m, TURNED * step_m * normals])  # (S, 6): apart in space or in direction
    tree = scipy.spatial.cKDTree(places[known])
    _, nearest = tree.query(places, k=min(NEIGHBOURS, len(known)))
    neighbours = known[nearest.reshape(len(groups), -1)]  # (S, K)

    raised_m = middles_m + RAISED * step_m * points.planes[groups.middle]
    surfel = np.repeat(np.arange(len(groups)), neighbours.shape[1])

    def hidden(part: slice) -> Mask:
        return visibility.opaque.occluded(raised_m[surfel[part]], middles_m[neighbours.ravel()[part]])

    is_hidden = chunked(hidden, len(surfel)).reshape(neighbours.shape)
    is_hidden = is_hidden & (neighbours != np.arange(len(groups))[:, None])
    is_hidden &= ~is_hidden.all(1, keepdims=True)

    def weights(part: slice) -> "csr_matrix":
        return _weights(
            points.take(part),
            groups,
            groups.of[part],
            neighbours,
            is_hidden=is_hidden,
            middles=(middles_m, normals),
        )

    blends = in_chunks(weights, len(points))
    none = scipy.sparse.csr_matrix((1, len(groups)), dtype=np.float32)  # of the point that stands for none
    table = scipy.sparse.vstack([*blends, none], "csr")
    return table[layout.source]


def _weights(
    points: Texels,
    groups: Surfels,
    of: Indices,
    neighbours: Rows,
    *,
    is_hidden: Mask,
    middles: tuple[Floats, Floats],
) -> "csr_matrix":
    """Weights (P, S) of surfels at points whose surfels (P,) are known, by position and normal (S, 3) of each."""
    middles_m, normals = middles
    candidates = neighbours[of]
    hidden = is_hidden[of]
    step_m = groups.step_m[of, None]
    offset_m = points.points_m[:, None] - middles_m[candidates]
    squared = (offset_m**2).sum(-1) / step_m**2
    turn = points.normals[:, None] - normals[candidates]
    squared += (turn**2).sum(-1) * TURNED**2
    nearest = np.where(hidden, np.inf, squared).min(1, keepdims=True)
    closeness = np.exp(-(squared - nearest) / WIDTH)
    weights = np.where(hidden, 0, closeness)
    weights[weights < LEAST * weights.sum(1, keepdims=True)] = 0
    weights /= weights.sum(1, keepdims=True)

    rows = np.repeat(np.arange(len(of)), candidates.shape[1])
    entries = (weights.ravel().astype(np.float32), (rows, candidates.ravel()))
    table = scipy.sparse.csr_matrix(entries, (len(of), len(groups)))
    table.eliminate_zeros()
    return table


MOST_PX = 256  # along a texture's side, finer than texels are apart
BRIGHTEST = 0.99  # reflectance, which keeps bounces from adding up without end


def albedo(
    faces: Triangles,
    materials: Mapping[str, Material],
    points: Texels,
) -> Floats:
    """Linear reflectance (P, 3) of the body there, of what its coat lets in."""
    result = np.zeros((len(points), 3), np.float32)
    number = {name: nth for nth, name in enumerate(materials)}
    numbers = [number.get(thing.material, -1) for thing in faces.things]
    of_things = np.array(numbers, np.int32)
    material_of = of_things[faces.thing[points.face]]
    corner_weights = np.column_stack([1 - points.uv.sum(1), points.uv])
    for name, material in materials.items():
        rows = np.flatnonzero(material_of == number[name])
        if not len(rows) or material.kind != "body":
            continue
        tile = _tile(material)
        height, width = tile.shape[:2]
        corners_uv = faces.uv[points.face[rows]]
        uv = np.einsum("ni,nij->nj", corner_weights[rows], corners_uv) / material.tile_m % 1
        row = (uv[:, 1] * height).astype(int) % height
        column = (uv[:, 0] * width).astype(int) % width
        values = np.clip(tile[row, column] * np.array(material.colour), 0, BRIGHTEST)
        scattered = under_coat(values, material.eta) if material.is_coated else values
        result[rows] = (1 - material.metal) * scattered
    return result


def _tile(material: Material) -> Floats:
    """Linear reflectance (h, w, 3), or (h, w, 1) of a grey one, of a texture, coarse."""
    if material.texture is None:
        return np.ones((1, 1, 1), np.float32)
    pixels = linear_texture(material.texture)
    height = min(pixels.shape[0], MOST_PX)
    width = min(pixels.shape[1], MOST_PX)
    small = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small.reshape(height, width, -1), np.float32)


TURN = np.array([0.4142135624, 0.7320508076], np.float32)  # by which further rays of a point differ
MIRRORS = 4  # followed by one ray
FAINT = 1e-3  # what a mirror returns of a ray is dropped below this
ROWS = 1 << 10  # points at once: times their rays
MOST_RAYS = 25_000_000  # in one table
PHOTON_ROWS = 1 << 16  # photons at once
NEAR_M = 1.0  # light from nearer changes between a surfel and its neighbours


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
        by_metal = (1 - coat) * self.metal[face]
        return np.asarray(self.tint[face] * coat + by_metal)

    def scattered(self, face: Indices, cosine: Floats) -> Floats:
        """Luminance times pi (R,) towards a cosine, per light that entered and was scattered."""
        leaving = np.where(self.eta[face] > 0, 1 - self._reflected(face, cosine), 1)
        return self.scatters[face] * leaving

    def _reflected(self, face: Indices, cosine: Floats) -> Floats:
        return fresnel(cosine, np.maximum(self.eta[face], 1.0)).astype(np.float32)


def response(
    faces: Triangles,
    materials: Mapping[str, Material],
    visibility: Visibility,
) -> Response:
    """How a table's faces respond to light. Metal mirrors in the luminance of its colour."""
    kinds = [*face_materials(faces, materials), None]  # the last one for nothing
    thing = np.append(faces.thing, len(kinds) - 1)
    shows_lamps = np.zeros(len(thing), bool)
    for mirror, *_ in visibility.mirrors:
        shows_lamps[mirror.faces] = True
    return Response(
        scatters=np.array([_is_body(kind) for kind in kinds])[thing],
        eta=np.array([_coat_eta(kind) for kind in kinds], np.float32)[thing],
        tint=np.array([kind.tint if kind and _is_body(kind) else 0 for kind in kinds], np.float32)[thing],
        metal=np.array([_metal(kind) for kind in kinds], np.float32)[thing],
        roughness=np.array([kind.roughness if kind else 0 for kind in kinds], np.float32)[thing],
        lamp=np.append(faces.lamp, -1),
        shows_lamps=shows_lamps,
    )


def _is_body(material: Material | None) -> bool:
    return material is not None and material.kind == "body"


def _coat_eta(material: Material | None) -> float:
    """The refractive index of a body's coat, 0 without one."""
    if material is None or material.kind != "body" or not material.is_coated:
        return 0
    return material.eta


def _metal(material: Material | None) -> float:
    """The share that a mirror or a metal reflects."""
    if material is None:
        return 0.0
    if material.kind == "mirror":
        return material.tint
    if material.kind != "body":
        return 0.0
    return material.metal * float(np.array(material.colour) @ LUMINANCE)


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
    """Rays on their journey: the row of the result they belong to, from where, whereto, and what they weigh.

    is_direct: whether a lamp that they meet next is direct light, and counted as such.
    """

    point: Rows
    origins_m: Floats
    directions: Floats
    weight: Floats
    is_direct: Mask

    take = take

    def joined(self, other: "_RayBatch") -> "_RayBatch":
        columns = [(getattr(self, field.name), getattr(other, field.name)) for field in fields(self)]
        return _RayBatch(*(np.concatenate(column) for column in columns))


@dataclass(frozen=True, slots=True)
class _Step:
    """Rays at the faces that they have met: with what cosine, on which texel, and the light (R,) scattered there.

    gone: the rays that met nothing; from_panes: those that panes on the way reflected.
    """

    batch: _RayBatch
    hits: Hits
    cosine: Floats
    texel: Indices
    scattered: Floats
    gone: _RayBatch
    from_panes: _RayBatch


@dataclass(frozen=True, slots=True)
class Sample:
    """What rays of some points found: near and far (P, S + L) are tables by how far the last segment of a ray led.

    sky (K, P) by mirrors and escaped (P,) as in FinalGather; texels (R,): where rays ended.
    """

    near: "csr_matrix"
    far: "csr_matrix"
    sky: Floats
    escaped: Floats
    texels: Indices


@dataclass(frozen=True, slots=True)
class Photons:
    """Rays of light that set out from mirroring faces: from where and whereto (R, 3), and their flux (R,) in lumens.

    is_shown: whether the face that they meet first has that light already, as an image in a smooth mirror.
    """

    origins_m: Floats
    directions: Floats
    flux_lm: Floats
    is_shown: Mask
    dither: Floats


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

    def gather(
        self,
        points: Texels,
        *,
        rays: int,
        done: Callable[[float], object] | None = None,
    ) -> FinalGather:
        """Send about `rays` rays from every point; `done` is called with shares."""
        rays_each = min(rays, MOST_RAYS / max(len(points), 1))
        found = self.sample(points, side=int(np.sqrt(rays_each)), done=done)
        return FinalGather(found.near + found.far, found.sky, self.hits(found), found.escaped)

    def hits(self, sample: Sample) -> Rows:
        """How many rays ended on each texel of the map (H·W,)."""
        return np.bincount(sample.texels, minlength=self.atlas.height * self.atlas.width)

    def sample(
        self,
        points: Texels,
        *,
        side: int,
        turn: int = 0,
        done: Callable[[float], object] | None = None,
    ) -> Sample:
        """Send side x side rays from every point, in each turn others; `done` is called with shares."""
        parts = list[Sample]()
        if side and len(points):
            turned = points.dither + np.float32(turn) * TURN
            turned -= np.floor(turned)
            points = replace(points, dither=turned)
            parts = in_chunks(lambda part: self._sample(points.take(part), side), len(points), chunk=ROWS, done=done)
        unasked = 0 if parts else len(points)
        no_entries = scipy.sparse.csr_matrix((unasked, self.surfels + self.lamps), dtype=np.float32)
        no_sky = np.zeros((len(self.skies), unasked), np.float32)
        all_escaped = np.ones(unasked, np.float32)
        return Sample(
            near=scipy.sparse.vstack([no_entries, *(part.near for part in parts)], "csr"),
            far=scipy.sparse.vstack([no_entries, *(part.far for part in parts)], "csr"),
            sky=np.concatenate([no_sky, *(part.sky for part in parts)], 1),
            escaped=np.concatenate([all_escaped, *(part.escaped for part in parts)]),
            texels=np.concatenate([np.zeros(0, np.int32), *(part.texels for part in parts)]),
        )

    def _sample(self, points: Texels, side: int) -> Sample:
        batch = _start(points, side)
        parts = []
        texels = []
        ray_count = np.float32(side * side)
        sky = np.zeros((len(self.skies), len(points)), np.float32)
        escaped = np.zeros(len(points), np.float32)
        for depth in range(MIRRORS + 1):
            step = self._step(batch)
            if depth == 0:
                escaped += self._escaped(step.gone, len(points)) / ray_count
            else:
                self._add_sky(sky, step.gone)
            lamp = self.response.lamp[step.hits.face]
            is_lamp = lamp >= 0
            factor = np.where(is_lamp, step.batch.weight * ~step.batch.is_direct, step.scattered)
            column = np.where(is_lamp, self.surfels + lamp, self.surfel_of[step.texel])
            counts = (column >= 0) & (factor > 0)
            parts.append(
                (
                    factor[counts] / ray_count,
                    step.batch.point[counts],
                    column[counts],
                    step.hits.distance[counts] < NEAR_M,
                )
            )
            texels.append(step.texel[counts])
            batch = self._onwards(step, points.dither, is_first=depth == 0)
            if not len(batch.point):
                break
        factor, row, column, is_near = (np.concatenate(columns) for columns in zip(*parts, strict=True))

        def table(chosen: Mask) -> "csr_matrix":
            entries = (factor[chosen], (row[chosen], column[chosen]))
            return scipy.sparse.csr_matrix(entries, (len(points), self.surfels + self.lamps), dtype=np.float32)

        found = np.concatenate(texels)
        return Sample(table(is_near), table(~is_near), sky / ray_count, escaped, found)

    def deposited(self, photons: Photons) -> Floats:
        """The flux (S,) in lumens that photons bring to surfels, of coats what enters."""
        flux_lm = np.zeros(self.surfels)

        def trace(part: slice) -> Floats:
            photon = np.arange(len(photons.flux_lm))[part]
            batch = _RayBatch(
                point=photon,
                origins_m=photons.origins_m[part],
                directions=photons.directions[part],
                weight=np.ones(len(photon), np.float32),
                is_direct=photons.is_shown[part],
            )
            total_lm = np.zeros(self.surfels)
            for _ in range(MIRRORS):
                step = self._step(batch)
                surfel = self.surfel_of[step.texel]
                counts = np.flatnonzero((surfel >= 0) & ~step.batch.is_direct)
                arriving_lm = step.scattered[counts] * photons.flux_lm[step.batch.point[counts]]
                total_lm += np.bincount(surfel[counts], arriving_lm, self.surfels)
                batch = self._onwards(step, photons.dither, is_first=False)
                if not len(batch.point):
                    break
            return total_lm

        for part_lm in in_chunks(trace, len(photons.flux_lm), chunk=PHOTON_ROWS):
            flux_lm += part_lm
        return flux_lm

    def _step(self, batch: _RayBatch) -> _Step:
        """Follow rays to the next face that is no pane."""
        hits = self.visibility.opaque.hits(batch.origins_m, batch.directions)
        lengths_m = np.where(hits.face < 0, FAR_M, hits.distance)
        segments_m = batch.directions * lengths_m[:, None]
        from_panes = self._reflected_by_panes(batch, segments_m)
        batch.weight *= self.visibility.through_panes(batch.origins_m, segments_m)
        gone = batch.take(hits.face < 0)
        along_normal = np.einsum("ij,ij->i", batch.directions, self.visibility.normals[hits.face])
        met = np.flatnonzero((hits.face >= 0) & (along_normal < 0))
        batch = batch.take(met)
        hits = hits.take(met)
        cosine = -along_normal[met]
        texel = self.atlas.index(hits.at(self.atlas.light_px)).astype(np.int32)
        scattered = batch.weight * self.response.scattered(hits.face, cosine)
        return _Step(batch, hits, cosine, texel, scattered, gone, from_panes)

    def _escaped(self, gone: _RayBatch, point_count: int) -> Floats:
        """How many (P,) of the rays of each point that met nothing crossed no pane that shows the sky."""
        by_no_pane = ~self.visibility.crosses_sky_pane(gone.origins_m, FAR_M * gone.directions)
        return np.bincount(gone.point, by_no_pane, minlength=point_count).astype(np.float32)

    def _add_sky(self, sky: Floats, gone: _RayBatch) -> None:
        """Add the illuminance of points (K, P) by rays that met nothing, from each of the skies."""
        for nth, light in enumerate(self.skies):
            luminance_cd_m2 = light.luminance_cd_m2(gone.directions)
            ray_lx = np.pi * luminance_cd_m2 * gone.weight
            sky[nth] += np.bincount(gone.point, ray_lx, minlength=sky.shape[1])

    def _reflected_by_panes(self, batch: _RayBatch, segments_m: Floats) -> _RayBatch:
        """The rays that go back from the first pane on their segment; a lamp that they meet is no direct light."""
        rays, hits = self.visibility.first_panes(batch.origins_m, segments_m)
        batch = batch.take(rays)
        normals = self.visibility.normals[hits.face]
        along_normal = np.einsum("ij,ij->i", batch.directions, normals)
        to_pane_m = hits.distance[:, None] * segments_m[rays]
        ends_m = batch.origins_m + to_pane_m - RAY_OFFSET_M * batch.directions
        directions = batch.directions - 2 * along_normal[:, None] * normals
        weight = batch.weight * self.visibility.pane_mirrors(hits.face, along_normal)
        is_direct = np.zeros(len(weight), bool)
        reflected = _RayBatch(batch.point, ends_m, directions, weight, is_direct)
        return reflected.take(weight > FAINT)

    def _onwards(self, step: _Step, dither: Floats, *, is_first: bool) -> _RayBatch:
        """The rays that go on from the faces and panes that they have met."""
        weight = step.batch.weight * self.response.mirrored(step.hits.face, step.cosine)
        rays = np.flatnonzero(weight > FAINT)
        batch = step.batch.take(rays)
        face = step.hits.face[rays]
        face_normals = self.visibility.normals[face]
        normals = facets(face_normals, self.response.roughness[face], dither[batch.point], rays)
        along_normal = np.einsum("ij,ij->i", batch.directions, normals)[:, None]
        directions = batch.directions - 2 * along_normal * normals
        ends_m = batch.origins_m + step.hits.distance[rays, None] * batch.directions
        # A facet may reflect a ray into its own surface.
        is_leaving = np.einsum("ij,ij->i", directions, face_normals) > 0
        is_direct = self.response.shows_lamps[face] & is_first
        origins_m = ends_m + RAY_OFFSET_M * face_normals
        mirrored = _RayBatch(batch.point, origins_m, directions, weight[rays], is_direct)
        return mirrored.take(is_leaving).joined(step.from_panes)


def _start(points: Texels, side: int) -> _RayBatch:
    """Side x side cosine-weighted rays from each point; their weights average to what enters its coat."""
    a, b = place_in_cell(points, np.arange(side**2)[:, None], side)
    directions = cosine_weighted(points.normals)(a, b)  # (side², P, 3)
    cosines = points.cosine(directions)
    weight = (points.entering(cosines) * (cosines > 0)).ravel()
    origins_m = np.tile(points.points_m, (side**2, 1))
    point = np.tile(np.arange(len(points)), side**2)
    return _RayBatch(point, origins_m, directions.reshape(-1, 3), weight, np.ones(len(point), bool))


def facets(
    normals: Floats,
    roughness: Floats,
    dither: Floats,
    turn: NDArray[np.int64],
) -> Floats:
    """Unit normals (R, 3) of facets around a face's, by GGX. Source: Walter et al. (2007), eqs 35 and 36."""
    rough = np.flatnonzero(roughness)
    jitter = (dither[rough] + turn[rough, None] * JITTER) % 1
    a, b = jitter.T
    steepness = np.sqrt(a / np.maximum(1 - a, 1e-6))
    slope = (roughness[rough] * steepness)[:, None]
    u_axis, v_axis = tangents(normals[rough])
    angle = 2 * np.pi * b[:, None]
    aside = np.cos(angle) * u_axis + np.sin(angle) * v_axis
    tilted = normals[rough] + slope * aside
    facets = normals.copy()
    facets[rough] = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    return facets


# Bounces of a ratio this even, whose rest is this small a share of the light, or a rest too faint, are summed up.
EVEN = 2e-3
REST = 0.03
FAINT_REST = 1e-4


def bounced(
    straight: Floats,
    reflectance: Floats,
    table: "csr_matrix",
    first: Floats,
    *,
    bounces: int,
) -> Floats:
    """Illuminance (K, S, C) of surfels by one bounce or more, of the radiosity (K, S, C) that direct light gives them.

    reflectance (S, C) of surfels; table (S, S) times their radiosity is their light; first (K, S): what comes by
    mirrors from lamps and the sky, grey. In the end each bounce is the same share of the one before, so the last ones
    are the sum of a geometric series.
    """
    light_count, surfel_count, channels = straight.shape
    if not bounces:
        return np.zeros(straight.shape, np.float32)
    columns = (surfel_count, light_count * channels)
    grey = np.repeat(first.T[..., None], channels, 2)
    by_mirrors = grey.reshape(columns).astype(np.float32)
    sent = straight.transpose(1, 0, 2).reshape(columns)
    step = table @ sent + by_mirrors
    total = step.copy()
    column_reflectance = np.tile(reflectance, (1, light_count))
    ratio = np.zeros(columns[1])
    for bounces_left in reversed(range(bounces - 1)):
        previous_sum = step.sum(0, dtype=float)
        step = table @ (column_reflectance * step)
        total += step
        previous_ratio = ratio
        growth = step.sum(0, dtype=float) / np.maximum(previous_sum, 1e-30)
        ratio = np.clip(growth, 0, 0.999)
        rest = ratio * (1 - ratio**bounces_left) / (1 - ratio)  # of the geometric series, in units of the last step
        total_sum = np.maximum(total.sum(0), 1e-30)
        rest_share = rest * step.sum(0) / total_sum
        is_even = np.abs(ratio - previous_ratio) <= EVEN
        is_done = (rest_share <= FAINT_REST) | is_even & (rest_share <= REST)
        if is_done.all():
            total += step * rest.astype(np.float32)
            break
    by_surfel = total.reshape(surfel_count, light_count, channels)
    return np.ascontiguousarray(by_surfel.transpose(1, 0, 2))
