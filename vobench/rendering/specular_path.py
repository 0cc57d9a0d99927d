"""Rays that are followed by mirrors, coats and panes until they end at a face that scatters light."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask
from vobench.rendering.atlas import Atlas
from vobench.rendering.embree import Hits
from vobench.rendering.face_response import Response
from vobench.rendering.geometry import FAR_M, RAY_OFFSET_M, take
from vobench.rendering.ray_kernels import FACE, Faces, chosen_rays, cosine_rays, end_rays
from vobench.rendering.texel import Texels
from vobench.rendering.visibility import Visibility
from vobench.scene.triangles import Triangles


@dataclass(slots=True)
class RayBatch:
    """Rays (R,) on their way: the row `point` of the result that each counts for, its origin, direction and weight.

    is_direct: whether the light of a lamp that it meets next is direct light, which is counted elsewhere.
    """

    point: Indices
    origins_m: Floats
    directions: Floats
    weight: Floats
    is_direct: Mask

    take = take

    def joined(self, other: "RayBatch") -> "RayBatch":
        """The rays of both batches."""
        columns = [(getattr(self, field.name), getattr(other, field.name)) for field in fields(self)]
        return RayBatch(*(np.concatenate(column) for column in columns))


@dataclass(frozen=True, slots=True)
class RayEnds:
    """Where rays (R,) ended.

    point: that each ray counts for. column: of the table, for the surfel or lamp that it met, and share: what it counts
    there. texel: where it ended on the map. is_near: whether the last segment of the ray is shorter than NEAR_M.
    """

    point: Indices
    column: Indices
    texel: Indices
    share: Floats
    is_near: Mask

    take = take


def joined_ends(parts: Sequence[RayEnds]) -> RayEnds:
    """The ends of the rays of all parts, one part after the other."""
    columns = {}
    for column in fields(RayEnds):
        values = [getattr(part, column.name) for part in parts]
        columns[column.name] = np.concatenate(values)
    return RayEnds(**columns)


@dataclass(frozen=True, slots=True)
class FollowedRays:
    """What became of the rays of a batch after one more segment.

    ends: those that ended at surfels or lamps. onward: those that continue from a mirror, a coat or a pane. escaped:
    those that met nothing.
    """

    ends: RayEnds
    onward: RayBatch
    escaped: RayBatch


class SpecularTracer:
    """Follows rays through the stationary part of a scene.

    surfel_of (H·W,): the surfel of each texel, -1 for none. lamp_column: the column of the table for the first lamp,
    negative if lamps do not count.
    """

    def __init__(
        self,
        atlas: Atlas,
        visibility: Visibility,
        response: Response,
        surfel_of: Indices,
        *,
        lamp_column: int,
    ) -> None:
        self._visibility = visibility
        self._surfel_of = surfel_of
        self._map_size = (atlas.height, atlas.width)
        self._lamp_column = lamp_column
        self._faces = face_table(visibility.faces, atlas, visibility, response)

    def follow(
        self,
        batch: RayBatch,
        dither: Floats,
        *,
        is_first: bool,
    ) -> FollowedRays:
        """Follow rays to the next face that is not a pane. The weights in the batch lose what panes absorb and reflect.

        dither (P, 2): the random numbers of points. is_first: whether the rays come from the points themselves.
        """
        hits = self._visibility.opaque.one_sided_hits(batch.origins_m, batch.directions)
        from_panes = self._reflected_by_panes(batch, hits, dither)
        count = len(batch.weight)
        ends = RayEnds(
            point=np.empty(count, np.int32),
            column=np.empty(count, np.int32),
            texel=np.empty(count, np.int32),
            share=np.empty(count, np.float32),
            is_near=np.empty(count, bool),
        )
        onward = RayBatch(
            point=np.empty(count, np.int32),
            origins_m=np.empty((count, 3), np.float32),
            directions=np.empty((count, 3), np.float32),
            weight=np.empty(count, np.float32),
            is_direct=np.empty(count, bool),
        )
        escaped = np.empty(count, np.int64)
        end_count, onward_count, escaped_count = end_rays(
            batch.origins_m,
            batch.directions,
            batch.weight,
            batch.is_direct,
            batch.point,
            hits.face,
            hits.u,
            hits.v,
            hits.distance,
            self._faces,
            self._surfel_of,
            self._map_size,
            self._lamp_column,
            dither,
            is_first,
            ends.point,
            ends.column,
            ends.texel,
            ends.share,
            ends.is_near,
            onward.point,
            onward.origins_m,
            onward.directions,
            onward.weight,
            onward.is_direct,
            escaped,
        )
        onward = onward.take(slice(onward_count))
        if len(from_panes.point):
            onward = onward.joined(from_panes)
        return FollowedRays(ends.take(slice(end_count)), onward, batch.take(escaped[:escaped_count]))

    def _reflected_by_panes(self, batch: RayBatch, hits: Hits, dither: Floats) -> RayBatch:
        """The rays that the first pane before a hit reflects. The weights in the batch lose what panes do not transmit.

        A lamp that a reflected ray meets is not direct light.
        """
        reach_m = np.where(hits.face < 0, FAR_M, hits.distance)
        rays, panes = self._visibility.first_panes(batch.origins_m, batch.directions, reach_m)
        at_panes = batch.take(rays)
        segments_m = at_panes.directions * reach_m[rays, None]
        batch.weight[rays] *= self._visibility.through_panes(at_panes.origins_m, segments_m)

        normals = self._visibility.normals[panes.face]
        along_normal = np.einsum("ij,ij->i", at_panes.directions, normals)
        weight = at_panes.weight * self._visibility.pane_mirrors(panes.face, along_normal)
        selected = np.empty(len(weight), np.int64)
        selected = selected[: chosen_rays(weight, at_panes.point, dither, selected)]
        reflected = at_panes.take(selected)
        to_pane_m = (panes.distance[selected] - RAY_OFFSET_M)[:, None] * reflected.directions
        outward = 2 * along_normal[selected, None] * normals[selected]
        return RayBatch(
            point=reflected.point,
            origins_m=reflected.origins_m + to_pane_m,
            directions=reflected.directions - outward,
            weight=weight[selected],
            is_direct=np.zeros(len(selected), bool),
        )


def face_table(faces: Triangles, atlas: Atlas, visibility: Visibility, response: Response) -> Faces:
    """The properties (F + 1,) of faces that the kernels of rays read, the last entry for no face."""
    table = np.zeros(len(faces) + 1, FACE)
    table["normal"] = visibility.normals
    table["light_px"][:-1] = atlas.light_px
    table["twin"] = visibility.opaque.twin
    for name in ("lamp", "eta", "tint", "metal", "roughness", "scatters", "shows_lamps"):
        table[name] = getattr(response, name)
    return table


def hemisphere_rays(points: Texels, side: int) -> RayBatch:
    """Side x side cosine-weighted rays from each point; their weights are the shares that enter its coat."""
    count = len(points) * side**2
    origins_m = np.empty((count, 3), np.float32)
    directions = np.empty((count, 3), np.float32)
    weight = np.empty(count, np.float32)
    vectors = (points.points_m, points.normals, points.planes)
    cosine_rays(*vectors, points.eta, points.dither, side, origins_m, directions, weight)
    point = np.repeat(np.arange(len(points), dtype=np.int32), side**2)
    return RayBatch(point, origins_m, directions, weight, np.ones(count, bool))
