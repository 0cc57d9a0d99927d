"""Texels: the points of a scene at which its light is computed."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas, doubled_areas_px2
from vobench.rendering.geometry import RayCaster, face_materials, lengths, offset_from_surface, take, tangents
from vobench.rendering.texel_layout import TexelLayout, neighbours, texel_layout
from vobench.rendering.texel_owner import Owners, claimed
from vobench.rendering.thread_pool import chunked, in_chunks
from vobench.rendering.visibility import Visibility
from vobench.scene.material import Material, fresnel
from vobench.scene.triangles import Triangles

PULLED_M = 1e-3  # points at the edge of a chart are moved inwards by this, so that adjacent faces do not hide all
FACING = 0.1  # the smallest cosine between an interpolated normal and that of the flat face; a smaller one is not used

# The rays that test whether a point is inside a thing: the components of their directions along both tangents, if the
# component along the normal is 1.
TILTS = ((0.0, 0.0), (1.0, 0.4), (-1.0, -0.3), (0.3, -1.0), (-0.4, 1.0))

# Two faces touch if their normals are along an axis, by this cosine, and one is within this distance behind the other.
ALIGNED = 0.999
CONTACT_M = 4e-4


@dataclass(frozen=True, slots=True)
class Texels:
    """P points, one for each texel of the light map that shows light.

    `points_m` (P, 3) are their positions.
    `normals` (P, 3) are interpolated between the corners of faces, `planes` (P, 3) are those of the flat faces.
    `step_u_m`, `step_v_m` (P, 3) lead to the next texels along u and v. They are 0 at the edge of a chart.
    `index` (P,) is the index of the texel in the flat map.
    `face` (P,) is the face that the point is on, `uv` (P, 2) are the weights of its second and third corner there.
    `eta` (P,) is the refractive index of the coat, 0 without a coat.
    `dither` (P, 2) are random numbers in [0, 1), by which the patterns of rays of points differ.
    """

    points_m: Floats
    normals: Floats
    planes: Floats
    step_u_m: Floats
    step_v_m: Floats
    index: Rows
    face: Indices
    uv: Floats
    eta: Floats
    dither: Floats

    def __len__(self) -> int:
        return len(self.index)

    take = take

    def entering(self, cosine: Floats) -> Floats:
        """The share (..., P) of light at a cosine of incidence (..., P) that enters the coat; 1 without a coat."""
        share = np.ones(cosine.shape, np.float32)
        coated = np.flatnonzero(self.eta)
        share[..., coated] -= fresnel(cosine[..., coated], self.eta[coated]).astype(np.float32)
        return share

    def cosine(self, directions: Floats) -> Floats:
        """The cosine (..., P) between each normal and a vector (..., P, 3); 0 for vectors from behind the face."""
        is_before = np.einsum("...ij,ij->...i", directions, self.planes) > 0
        along_normal = np.einsum("...ij,ij->...i", directions, self.normals)
        return np.asarray(is_before * along_normal / lengths(directions))


def texels(
    faces: Triangles,
    materials: Mapping[str, Material],
    atlas: Atlas,
    owner: Owners,
    *,
    among: Mask,
    seed: int,
    visibility: Visibility | None = None,
) -> tuple[Texels, TexelLayout]:
    """The points on the faces in the mask `among` (F,), and their layout on the light map.

    With a visibility, points inside things and points that are covered by another face are omitted.
    """
    index = claimed(owner, among)
    beside = neighbours(index, atlas, owner)
    points = _placed(faces, materials, atlas, owner, index=index, beside=beside, seed=seed)
    is_inside = np.zeros(len(index), bool)
    if visibility is not None:
        is_inside = chunked(lambda part: _sees_only_backs(points.take(part), visibility), len(points))
        is_inside = is_inside | _touches_other_face(points, visibility)
    is_outside = ~is_inside
    points = points.take(is_outside)
    layout, in_plane = texel_layout(
        index,
        beside,
        is_outside,
        points_m=points.points_m,
        normals=points.normals,
        planes=points.planes,
        atlas=atlas,
        owner=owner,
        visibility=visibility,
    )
    points.step_u_m[~in_plane[:2].all(0)] = 0
    points.step_v_m[~in_plane[2:].all(0)] = 0
    return points, layout


def texel_areas_m2(
    faces: Triangles,
    atlas: Atlas,
    owner: Owners,
    among: Mask,
) -> Floats:
    """The area (H·W,) that each texel of the faces in the mask `among` (F,) represents; 0 for all other texels.

    Texels at the edge of a chart extend beyond their faces. The areas of all texels of a chart are therefore scaled by
    a common factor, so that their sum is the area of its faces.
    """
    face_areas_m2 = areas_m2(faces.corners_m)
    face_areas_px2 = np.abs(doubled_areas_px2(atlas.light_px.astype(float))) / 2
    covered_m2 = face_areas_m2 / np.maximum(face_areas_px2, 1e-12)
    index = claimed(owner, among)
    face = owner.face[index]
    is_charted = atlas.chart >= 0
    charts = int(atlas.chart.max(initial=-1)) + 1
    chart_m2 = np.bincount(atlas.chart[is_charted], face_areas_m2[is_charted], charts)
    chart_covered_m2 = np.bincount(atlas.chart[face], covered_m2[face], charts)
    factor = chart_m2 / np.maximum(chart_covered_m2, 1e-30)
    result = np.zeros(atlas.height * atlas.width)
    result[index] = covered_m2[face] * factor[atlas.chart[face]]
    return result


def _placed(
    faces: Triangles,
    materials: Mapping[str, Material],
    atlas: Atlas,
    owner: Owners,
    *,
    index: Rows,
    beside: Indices,
    seed: int,
) -> Texels:
    """The points of the texels at flat indices (P,), slightly off their faces. `beside` (4, P) are their neighbours."""
    face = owner.face[index]
    points_m = np.empty((len(index), 3), np.float32)
    normals = np.empty_like(points_m)
    planes = np.empty_like(points_m)
    steps_u_m = np.empty_like(points_m)
    steps_v_m = np.empty_like(points_m)

    step_of_face_u_m, step_of_face_v_m = _steps_m(faces.corners_m, atlas.light_px.astype(float))

    def place(part: slice) -> None:
        part_face = face[part]
        uv = owner.uv[index[part]]
        corner_weights = np.column_stack([1 - uv.sum(1), uv])
        plane = faces.plane[part_face]
        step_u_m = step_of_face_u_m[part_face]
        step_v_m = step_of_face_v_m[part_face]
        is_missing = beside[:, part] == np.arange(len(index))[part]
        on_face_m = np.einsum("ni,nij->nj", corner_weights, faces.corners_m[part_face])
        inwards_m = _inwards_m(step_u_m, step_v_m, is_missing)
        shape_normal = unit(np.einsum("ni,nij->nj", corner_weights, faces.normals[part_face]))
        agrees = np.einsum("ij,ij->i", shape_normal, plane)[:, None] > FACING
        points_m[part] = offset_from_surface(on_face_m + inwards_m, plane)
        normals[part] = np.where(agrees, shape_normal, plane)
        planes[part] = plane
        steps_u_m[part] = step_u_m
        steps_v_m[part] = step_v_m

    in_chunks(place, len(index))
    thing_materials = face_materials(faces, materials)
    thing_eta = np.array([kind.eta if kind and kind.is_coated else 0.0 for kind in thing_materials], np.float32)
    dither = np.random.default_rng([seed, 1]).random((atlas.height * atlas.width, 2), dtype=np.float32)
    return Texels(
        points_m,
        normals,
        planes,
        steps_u_m,
        steps_v_m,
        index,
        face,
        owner.uv[index],
        thing_eta[faces.thing[face]],
        dither[index],
    )


def _inwards_m(step_u_m: Array, step_v_m: Array, is_missing: Mask) -> Array:
    """The vectors (P, 3) that move points inwards from the edge of a chart, where neighbours (4, P) are missing."""
    along_u = (is_missing[0] * 1.0 - is_missing[1])[:, None] * unit(step_u_m)
    along_v = (is_missing[2] * 1.0 - is_missing[3])[:, None] * unit(step_v_m)
    return np.asarray(PULLED_M * (along_u + along_v))


def _steps_m(corners_m: Array, places: Array) -> tuple[Array, Array]:
    """The vectors (F, 3) on each face that correspond to one texel along u and along v.

    `corners_m` (F, 3, 3) are the corners of the faces, `places` (F, 3, 2) their places on the map in texels.
    """
    first_u, first_v = places[:, 1].T - places[:, 0].T
    second_u, second_v = places[:, 2].T - places[:, 0].T
    area = doubled_areas_px2(places)
    area = np.where(np.abs(area) < 1e-9, np.inf, area)[:, None]
    first_m = corners_m[:, 1] - corners_m[:, 0]
    second_m = corners_m[:, 2] - corners_m[:, 0]
    step_u_m = (second_v[:, None] * first_m - first_v[:, None] * second_m) / area
    step_v_m = (first_u[:, None] * second_m - second_u[:, None] * first_m) / area
    return step_u_m, step_v_m


def _sees_only_backs(points: Texels, visibility: Visibility) -> Mask:
    """Whether a point (P,) is inside a thing, like the floor under a crate: all rays from it hit backs of faces."""
    is_inside = np.ones(len(points), bool)
    for tilt_u, tilt_v in TILTS:
        rows = np.flatnonzero(is_inside)
        direction = points.planes[rows]
        if tilt_u or tilt_v:
            u_axis, v_axis = tangents(direction)
            direction = tilt_u * u_axis + tilt_v * v_axis + direction
        face = visibility.opaque.nearest(points.points_m[rows], direction)
        is_back = np.einsum("ij,ij->i", direction, visibility.normals[face]) > 0
        is_inside[rows] = (face >= 0) & is_back & (visibility.faces.lamp[face] < 0)
    return is_inside


def _touches_other_face(points: Texels, visibility: Visibility) -> Mask:
    """Whether another face touches the face of a point (P,), as the floor touches the bottom of a crate.

    Rays from these points do not find this, because the points are raised above their face and are already beyond the
    other one. Only faces whose normals are along an axis are tested.
    """
    is_touching = np.zeros(len(points), bool)
    solid = visibility.opaque.solid
    for axis, is_positive in np.ndindex(3, 2):
        sign = 1 if is_positive else -1
        rows = np.flatnonzero(sign * points.planes[:, axis] > ALIGNED)
        opposite = solid[sign * visibility.faces.plane[solid, axis] < -ALIGNED]
        if len(rows) and len(opposite):
            caster = RayCaster(visibility.faces, opposite)
            depth_m = points.planes[rows] * CONTACT_M
            is_touching[rows] = caster.stops(points.points_m[rows] - depth_m, depth_m)
    return is_touching
