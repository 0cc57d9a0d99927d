"""Indirect light: surfels, which of them see each other by rays that follow mirrors and pass panes, and bounces."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
import scipy

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas
from vobench.rendering.blend_kernels import TURNED, Blending, count_weights, write_weights
from vobench.rendering.embree import Hits
from vobench.rendering.geometry import FAR_M, RAY_OFFSET_M, face_materials, take
from vobench.rendering.ray_kernels import FACE, Faces, chosen_rays, cosine_rays, end_rays, sorted_by_point
from vobench.rendering.sobol_pattern import SobolPattern
from vobench.rendering.texel import Texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.thread_pool import chunked, in_chunks
from vobench.rendering.unwrap import nearest_axis
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE, Material, fresnel, linear_texture, under_coat
from vobench.scene.triangles import Triangles

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import LinearOperator

RAISED = 0.25  # of a cell, above their faces: places that see each other there share light
NEIGHBOURS = 9  # surfels whose light a texel may take, its own included
PATTERN_SIDE = 64  # cells after which the dither of surfels repeats


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


def evenly_dithered(middles: Texels, step_m: Floats) -> Texels:
    """The middles (S,) of surfels, with dithers by which the rays of surfels beside one another fit together.

    Light from far surfels is averaged over neighbours, so that their rays count as if they were those of one point.
    """
    cell = np.floor(middles.points_m / step_m[:, None]).astype(np.int64)
    axis = nearest_axis(middles.planes) // 2
    row = np.where(axis == 0, cell[:, 1], cell[:, 0]) % PATTERN_SIDE
    column = np.where(axis == 2, cell[:, 1], cell[:, 2]) % PATTERN_SIDE
    pattern = SobolPattern(PATTERN_SIDE, 1, middles.dither[:1])
    return replace(middles, dither=pattern.offsets(row * PATTERN_SIDE + column, middles.dither))


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
    neighbours = np.sort(known[nearest.reshape(len(groups), -1)], axis=1)  # (S, K)

    raised_m = middles_m + RAISED * step_m * points.planes[groups.middle]
    surfel = np.repeat(np.arange(len(groups)), neighbours.shape[1])

    def hidden(part: slice) -> Mask:
        return visibility.opaque.occluded(raised_m[surfel[part]], middles_m[neighbours.ravel()[part]])

    is_hidden = chunked(hidden, len(surfel)).reshape(neighbours.shape)
    is_hidden = is_hidden & (neighbours != np.arange(len(groups))[:, None])
    is_hidden &= ~is_hidden.all(1, keepdims=True)
    blending = Blending(
        points_m=points.points_m,
        point_normals=points.normals,
        surfel_of_point=groups.of,
        neighbours=neighbours,
        is_hidden=is_hidden,
        middles_m=middles_m,
        normals=normals,
        step_m=groups.step_m,
    )

    texel_count = layout.source.size
    starts = np.zeros(texel_count + 1, np.int32)
    in_chunks(lambda part: count_weights(layout.source[part], blending, starts[1:][part]), texel_count)
    np.cumsum(starts, out=starts)
    columns = np.empty(starts[-1], np.int32)
    values = np.empty(starts[-1], np.float32)

    def write(part: slice) -> None:
        entries = slice(starts[part.start], starts[part.stop])
        write_weights(layout.source[part], blending, columns[entries], values[entries])

    in_chunks(write, texel_count)
    return scipy.sparse.csr_matrix((values, columns, starts), (texel_count, len(groups)))


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
ROWS = 1 << 9  # points at once: times their rays
MOST_RAYS = 25_000_000  # in one table
PHOTON_ROWS = 1 << 16  # photons at once


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

    point: Indices
    origins_m: Floats
    directions: Floats
    weight: Floats
    is_direct: Mask

    take = take

    def joined(self, other: "_RayBatch") -> "_RayBatch":
        columns = [(getattr(self, field.name), getattr(other, field.name)) for field in fields(self)]
        return _RayBatch(*(np.concatenate(column) for column in columns))


@dataclass(frozen=True, slots=True)
class _Found:
    """What rays (R,) found: of which point, in which column of the table, on which texel, and with which share.

    is_near: whether the last segment of the ray is shorter than NEAR_M.
    """

    point: Indices
    column: Indices
    texel: Indices
    share: Floats
    is_near: Mask

    take = take


def _concatenated(parts: Sequence[_Found]) -> _Found:
    """What the rays of all parts found, one part after the other."""
    columns = {}
    for column in fields(_Found):
        values = [getattr(part, column.name) for part in parts]
        columns[column.name] = np.concatenate(values)
    return _Found(**columns)


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
    faces: Faces = field(init=False, repr=False)

    def __post_init__(self) -> None:
        faces = face_table(self.visibility.faces, self.atlas, self.visibility, self.response)
        object.__setattr__(self, "faces", faces)

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
            points = turned(points, turn)
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

    def light(
        self,
        points: Texels,
        radiosity: Floats,
        *,
        side: int,
        turn: int,
    ) -> tuple[Floats, Floats, Floats]:
        """What side x side rays from every point find of the radiosity (S, C): near and far (P, C), and sky (K, P)."""
        points = turned(points, turn)

        def found(part: slice) -> tuple[Floats, Floats, Floats]:
            sample = self._sample(points.take(part), side)
            return sample.near @ radiosity, sample.far @ radiosity, sample.sky

        parts = in_chunks(found, len(points), chunk=ROWS)
        near, far, sky = zip(*parts, strict=True)
        return np.concatenate(near), np.concatenate(far), np.concatenate(sky, 1)

    def _sample(self, points: Texels, side: int) -> Sample:
        ray_count = np.float32(side * side)
        sky = np.zeros((len(self.skies), len(points)), np.float32)
        escaped = np.zeros(len(points), np.float32)
        batch = _start(points, side)
        parts = []
        for depth in range(MIRRORS + 1):
            found, batch, gone = self._followed(batch, points.dither, is_first=depth == 0)
            parts.append(found)
            if depth == 0:
                escaped += self._escaped(gone, len(points)) / ray_count
            else:
                self._add_sky(sky, gone)
            if not len(batch.point):
                break
        found = _concatenated(parts)
        found.share[:] /= ray_count
        return Sample(
            self._table(found, found.is_near, len(points)),
            self._table(found, ~found.is_near, len(points)),
            sky / ray_count,
            escaped,
            found.texel,
        )

    def _table(self, found: _Found, selected: Mask, point_count: int) -> "csr_matrix":
        """What the selected rays (R,) found, as a table (P, S + L) with an entry for each ray."""
        count = np.count_nonzero(selected)
        starts = np.empty(point_count + 1, np.int32)
        columns = np.empty(count, np.int32)
        shares = np.empty(count, np.float32)
        sorted_by_point(found.point, found.column, found.share, selected, starts, columns, shares)
        return scipy.sparse.csr_matrix((shares, columns, starts), (point_count, self.surfels + self.lamps))

    def deposited(self, photons: Photons) -> Floats:
        """The flux (S,) in lumens that photons bring to surfels, of coats what enters."""
        flux_lm = np.zeros(self.surfels)

        def trace(part: slice) -> Floats:
            photon = np.arange(len(photons.flux_lm), dtype=np.int32)[part]
            batch = _RayBatch(
                point=photon,
                origins_m=photons.origins_m[part],
                directions=photons.directions[part],
                weight=np.ones(len(photon), np.float32),
                is_direct=photons.is_shown[part],
            )
            total_lm = np.zeros(self.surfels)
            for depth in range(MIRRORS):
                if depth == 0:
                    # Light that the first face shows already goes on from it, and that alone counts.
                    shown = batch.take(batch.is_direct)
                    batch = batch.take(~batch.is_direct)
                    _, from_shown, _ = self._followed(shown, photons.dither, is_first=False)
                found, batch, _ = self._followed(batch, photons.dither, is_first=False)
                if depth == 0:
                    batch = batch.joined(from_shown)
                is_surfel = found.column < self.surfels
                arriving_lm = found.share[is_surfel] * photons.flux_lm[found.point[is_surfel]]
                total_lm += np.bincount(found.column[is_surfel], arriving_lm, self.surfels)
                if not len(batch.point):
                    break
            return total_lm

        for part_lm in in_chunks(trace, len(photons.flux_lm), chunk=PHOTON_ROWS):
            flux_lm += part_lm
        return flux_lm

    def _followed(
        self,
        batch: _RayBatch,
        dither: Floats,
        *,
        is_first: bool,
    ) -> tuple[_Found, _RayBatch, _RayBatch]:
        """Follow rays to the next face that is no pane: what they find, the rays that go on, those that met nothing."""
        hits = self.visibility.opaque.one_sided_hits(batch.origins_m, batch.directions)
        from_panes = self._reflected_by_panes(batch, hits, dither)
        count = len(batch.weight)
        found = _Found(
            point=np.empty(count, np.int32),
            column=np.empty(count, np.int32),
            texel=np.empty(count, np.int32),
            share=np.empty(count, np.float32),
            is_near=np.empty(count, bool),
        )
        onward = _RayBatch(
            point=np.empty(count, np.int32),
            origins_m=np.empty((count, 3), np.float32),
            directions=np.empty((count, 3), np.float32),
            weight=np.empty(count, np.float32),
            is_direct=np.empty(count, bool),
        )
        gone = np.empty(count, np.int64)
        found_count, onward_count, gone_count = end_rays(
            batch.origins_m,
            batch.directions,
            batch.weight,
            batch.is_direct,
            batch.point,
            hits.face,
            hits.u,
            hits.v,
            hits.distance,
            self.faces,
            self.surfel_of,
            (self.atlas.height, self.atlas.width),
            self.surfels if self.lamps else -1,
            dither,
            is_first,
            found.point,
            found.column,
            found.texel,
            found.share,
            found.is_near,
            onward.point,
            onward.origins_m,
            onward.directions,
            onward.weight,
            onward.is_direct,
            gone,
        )
        onward = onward.take(slice(onward_count))
        if len(from_panes.point):
            onward = onward.joined(from_panes)
        return found.take(slice(found_count)), onward, batch.take(gone[:gone_count])

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

    def _reflected_by_panes(self, batch: _RayBatch, hits: Hits, dither: Floats) -> _RayBatch:
        """The rays that go back from the first pane before a hit; those that pass lose what panes do not let through.

        A lamp that a reflected ray meets is no direct light.
        """
        reach_m = np.where(hits.face < 0, FAR_M, hits.distance)
        rays, panes = self.visibility.first_panes(batch.origins_m, batch.directions, reach_m)
        reflected = batch.take(rays)
        batch.weight[rays] *= self.visibility.through_panes(
            reflected.origins_m, reflected.directions * reach_m[rays, None]
        )
        normals = self.visibility.normals[panes.face]
        along_normal = np.einsum("ij,ij->i", reflected.directions, normals)
        weight = reflected.weight * self.visibility.pane_mirrors(panes.face, along_normal)
        selected = np.empty(len(weight), np.int64)
        selected = selected[: chosen_rays(weight, reflected.point, dither, selected)]
        reflected = reflected.take(selected)
        to_pane_m = (panes.distance[selected] - RAY_OFFSET_M)[:, None] * reflected.directions
        outward = 2 * along_normal[selected, None] * normals[selected]
        return _RayBatch(
            reflected.point,
            reflected.origins_m + to_pane_m,
            reflected.directions - outward,
            weight[selected],
            np.zeros(len(selected), bool),
        )


def turned(points: Texels, turn: int) -> Texels:
    """Points whose rays differ from those of any other turn."""
    dither = points.dither + np.float32(turn) * TURN
    dither -= np.floor(dither)
    return replace(points, dither=dither)


def face_table(faces: Triangles, atlas: Atlas, visibility: Visibility, response: Response) -> Faces:
    """What rays must know (F + 1,) of the faces of a table, the last one for nothing."""
    table = np.zeros(len(faces) + 1, FACE)
    table["normal"] = visibility.normals
    table["light_px"][:-1] = atlas.light_px
    table["twin"] = visibility.opaque.twin
    for name in ("lamp", "eta", "tint", "metal", "roughness", "scatters", "shows_lamps"):
        table[name] = getattr(response, name)
    return table


def _start(points: Texels, side: int) -> _RayBatch:
    """Side x side cosine-weighted rays from each point; their weights average to what enters its coat."""
    count = len(points) * side**2
    origins_m = np.empty((count, 3), np.float32)
    directions = np.empty((count, 3), np.float32)
    weight = np.empty(count, np.float32)
    vectors = (points.points_m, points.normals, points.planes)
    cosine_rays(*vectors, points.eta, points.dither, side, origins_m, directions, weight)
    point = np.repeat(np.arange(len(points), dtype=np.int32), side**2)
    return _RayBatch(point, origins_m, directions, weight, np.ones(count, bool))


# Bounces of a ratio this even, whose rest is this small a share of the light, or a rest too faint, are summed up.
EVEN = 2e-3
REST = 0.03
FAINT_REST = 1e-4


def bounced(
    straight: Floats,
    reflectance: Floats,
    table: "csr_matrix | LinearOperator",
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
