"""Rays that are reflected by mirrors, coats and panes until they end at a face that scatters light."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.rendering.array_types import Floats, Indices
from vobench.rendering.atlas import Atlas
from vobench.rendering.embree import Hits
from vobench.rendering.face_response import Response
from vobench.rendering.geometry import FAR_M, RAY_OFFSET_M
from vobench.rendering.ray_batch import RayBatch, RayEnds, empty_batch, empty_ends
from vobench.rendering.ray_end_kernels import FACE, Faces, RayHits, RayTargets, end_rays
from vobench.rendering.ray_kernels import chosen_rays, cosine_rays
from vobench.rendering.texel import Texels
from vobench.rendering.visibility import Visibility
from vobench.scene.triangles import Triangles


@dataclass(frozen=True, slots=True)
class FollowedRays:
    """The rays of a batch after one more segment.

    `ends` are those that ended at surfels or lamps, `onward` those that a mirror, a coat or a pane reflected, and
    `escaped` those that met nothing. A ray can end at a surfel and be reflected, too.
    """

    ends: RayEnds
    onward: RayBatch
    escaped: RayBatch


class SpecularTracer:
    """Follows rays through the stationary part of a scene.

    `surfel_of` (H·W,) is the surfel of each texel, -1 for none.
    `lamp_column` is the column of the result for the first lamp, negative if the light of lamps is not counted.
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
        self._targets = RayTargets(
            faces=face_table(visibility.faces, atlas, visibility, response),
            surfel_of=surfel_of,
            height=atlas.height,
            width=atlas.width,
            lamp_column=lamp_column,
        )

    def follow(
        self,
        batch: RayBatch,
        dither: Floats,
        *,
        is_first: bool,
    ) -> FollowedRays:
        """Follow rays to the next face that is not a pane. In the batch, weights are reduced by panes on the way.

        `dither` (P, 2) are the random numbers of points.
        `is_first` is whether the rays come from the points themselves.
        """
        hits = self._visibility.opaque.one_sided_hits(batch.origins_m, batch.directions)
        from_panes = self._reflected_by_panes(batch, hits, dither)
        count = len(batch.weight)
        ends = empty_ends(count)
        onward = empty_batch(count)
        escaped = np.empty(count, np.int64)
        ray_hits = RayHits(hits.face, hits.u, hits.v, hits.distance)
        end_count, onward_count, escaped_count = end_rays(
            batch, ray_hits, self._targets, dither, is_first, ends, onward, escaped
        )
        onward = onward.take(slice(onward_count))
        if len(from_panes.point):
            onward = onward.joined(from_panes)
        return FollowedRays(ends.take(slice(end_count)), onward, batch.take(escaped[:escaped_count]))

    def _reflected_by_panes(self, batch: RayBatch, hits: Hits, dither: Floats) -> RayBatch:
        """The rays that the first pane before each hit reflects. In the batch, weights are reduced by all panes.

        The light of a lamp that a reflected ray meets is not direct light.
        """
        reach_m = np.where(hits.face < 0, FAR_M, hits.distance)
        rays, panes = self._visibility.first_panes(batch.origins_m, batch.directions, reach_m)
        at_panes = batch.take(rays)
        segments_m = at_panes.directions * reach_m[rays, None]
        first_hits = replace(panes, distance=panes.distance / reach_m[rays])
        transmittance = self._visibility.transmittance_of_crossed_panes(at_panes.origins_m, segments_m, first_hits)
        batch.weight[rays] *= transmittance

        normals = self._visibility.normals[panes.face]
        along_normal = np.einsum("ij,ij->i", at_panes.directions, normals)
        weight = at_panes.weight * self._visibility.pane_reflectance(panes.face, along_normal)
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
    """The properties (F + 1,) of faces that compiled kernels read. The last entry is for no face."""
    table = np.zeros(len(faces) + 1, FACE)
    table["normal"] = visibility.normals
    table["light_px"][:-1] = atlas.light_px
    table["twin"] = visibility.opaque.twin
    for name in ("lamp", "eta", "tint", "metal", "roughness", "scatters", "shows_lamps"):
        table[name] = getattr(response, name)
    return table


def hemisphere_rays(points: Texels, side: int) -> RayBatch:
    """Side x side cosine-distributed rays from each point. The weight of a ray is the share that enters the coat."""
    count = len(points) * side**2
    origins_m = np.empty((count, 3), np.float32)
    directions = np.empty((count, 3), np.float32)
    weight = np.empty(count, np.float32)
    vectors = (points.points_m, points.normals, points.planes)
    cosine_rays(*vectors, points.eta, points.dither, side, origins_m, directions, weight)
    point = np.repeat(np.arange(len(points), dtype=np.int32), side**2)
    return RayBatch(point, origins_m, directions, weight, np.ones(count, bool))
