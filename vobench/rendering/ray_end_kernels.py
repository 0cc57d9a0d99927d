"""Compiled kernels that evaluate where rays end: the light that they find, and the rays that faces reflect."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Rows
from vobench.rendering.compiled import compiled, float32
from vobench.rendering.ray_batch import RayBatch, RayEnds
from vobench.rendering.ray_kernels import ONE, facet_of, fresnel_of, roulette_weight

NEAR_M = float32(1.0)  # the light from surfaces within this distance differs between neighbouring surfels
LIFT_M = float32(1e-4)  # the distance from its face at which a reflected ray starts
NO_COLUMN = np.int32(-1)

# The properties of a face that rays need.
# normal: its unit normal.
# light_px: the positions of its corners on the light map, in px.
# twin: the index of the face on the other side of its sheet, -1 for none.
# The other fields are how it scatters light, as in `Response`.
FACE = np.dtype(
    [
        ("normal", np.float32, 3),
        ("light_px", np.float32, (3, 2)),
        ("twin", np.int32),
        ("lamp", np.int32),
        ("eta", np.float32),
        ("tint", np.float32),
        ("metal", np.float32),
        ("roughness", np.float32),
        ("scatters", np.bool_),
        ("shows_lamps", np.bool_),
    ]
)
Faces = NDArray[Any]  # of FACE


class RayHits(NamedTuple):
    """The hits of R rays, as in `embree.Hits`.

    `face` (R,) is the index of the face that each ray hit, negative if it hit none.
    `u` (R,) is the barycentric coordinate of the second corner of the face.
    `v` (R,) is the barycentric coordinate of the third corner.
    `distance` (R,) is the distance of the hit from the origin of the ray, in lengths of its direction.
    """

    face: Indices
    u: Floats
    v: Floats
    distance: Floats


class RayTargets(NamedTuple):
    """What rays can hit.

    `faces` (F + 1,) are the faces. The last entry stands for no face.
    `surfel_of` (H·W,) is the index of the surfel of each texel of the light map, -1 for none. The result has one column
    for each surfel.
    `height` is the height H of the light map in texels.
    `width` is the width W of the light map in texels.
    `lamp_column` is the column of the result for the first lamp. It is negative if the light of lamps is not counted.
    """

    faces: Faces
    surfel_of: Indices
    height: int
    width: int
    lamp_column: int


@compiled
def end_rays(
    rays: RayBatch,
    hits: RayHits,
    targets: RayTargets,
    dither: Floats,
    is_first: bool,
    ends: RayEnds,
    onward: RayBatch,
    escaped: Rows,
) -> tuple[int, int, int]:
    """Evaluate the ends of rays (R,).

    `dither` (P, 2) are two random numbers in [0, 1) of each point.
    `is_first` is whether the rays start at the points themselves, instead of at a reflection.
    `ends` receives the light that the rays find.
    `onward` receives the rays that faces reflect.
    `escaped` receives the indices of the rays that hit no face.

    Returns the numbers of entries in `ends`, `onward` and `escaped`.
    """
    end_count = 0
    onward_count = 0
    escaped_count = 0
    counts_lamps = targets.lamp_column >= 0
    for ray in range(len(rays.weight)):
        if hits.face[ray] < 0:
            escaped[escaped_count] = ray
            escaped_count += 1
            continue

        x = rays.directions[ray, 0]
        y = rays.directions[ray, 1]
        z = rays.directions[ray, 2]
        face_index, is_other_side = face_towards(targets.faces, hits.face[ray], x, y, z)
        face = targets.faces[face_index]
        normal = face.normal
        along_normal = normal[0] * x + normal[1] * y + normal[2] * z
        if along_normal >= 0:
            continue  # the ray hit the back of a face that has no other side
        coat_reflectance = np.float32(0)
        if face.eta > 0:
            cosine = min(-along_normal, ONE)
            coat_reflectance = np.float32(fresnel_of(cosine, face.eta))

        # The light that the ray finds on the face.
        point = rays.point[ray]
        u = hits.u[ray]
        v = hits.v[ray]
        if is_other_side:
            v = ONE - hits.u[ray] - hits.v[ray]  # the corners of the other side are in the opposite order
        texel = texel_at(face.light_px, u, v, targets.height, targets.width)
        column = NO_COLUMN
        share = rays.weight[ray]
        if face.lamp >= 0:
            if counts_lamps and not rays.is_direct[ray]:
                column = np.int32(targets.lamp_column + face.lamp)
        elif face.scatters:
            column = targets.surfel_of[texel]
            share *= ONE - coat_reflectance
        if column >= 0 and share > 0:
            ends.point[end_count] = point
            ends.column[end_count] = column
            ends.texel[end_count] = texel
            ends.share[end_count] = share
            ends.is_near[end_count] = hits.distance[ray] < NEAR_M
            end_count += 1

        # The weight with which the face reflects the ray.
        mirror_reflectance = face.tint * coat_reflectance + (ONE - coat_reflectance) * face.metal
        reflected_weight = rays.weight[ray] * mirror_reflectance
        weight = roulette_weight(reflected_weight, dither[point, 0], dither[point, 1], ray)
        if weight <= 0:
            continue

        # The direction in which the face reflects the ray.
        facet_x = float(normal[0])
        facet_y = float(normal[1])
        facet_z = float(normal[2])
        if face.roughness > 0:
            facet_x, facet_y, facet_z = facet_of(normal, face.roughness, dither[point], ray)
        reflected_x, reflected_y, reflected_z = reflected(x, y, z, facet_x, facet_y, facet_z)
        if reflected_x * normal[0] + reflected_y * normal[1] + reflected_z * normal[2] <= 0:
            continue  # a microfacet can reflect a ray into its own surface

        # The reflected ray.
        distance = hits.distance[ray]
        onward.point[onward_count] = point
        onward.origins_m[onward_count, 0] = rays.origins_m[ray, 0] + distance * x + LIFT_M * normal[0]
        onward.origins_m[onward_count, 1] = rays.origins_m[ray, 1] + distance * y + LIFT_M * normal[1]
        onward.origins_m[onward_count, 2] = rays.origins_m[ray, 2] + distance * z + LIFT_M * normal[2]
        onward.directions[onward_count, 0] = reflected_x
        onward.directions[onward_count, 1] = reflected_y
        onward.directions[onward_count, 2] = reflected_z
        onward.weight[onward_count] = weight
        onward.is_direct[onward_count] = face.shows_lamps and is_first
        onward_count += 1
    return end_count, onward_count, escaped_count


@compiled
def face_towards(faces: Faces, face: int, x: float, y: float, z: float) -> tuple[int, bool]:
    """The face on the side of a sheet from which a ray along (x, y, z) comes, given the face that it hit.

    Returns its index, and whether it is the other side of the face that was hit.
    """
    twin = faces[face].twin
    if twin < 0:
        return face, False
    normal = faces[face].normal
    if normal[0] * x + normal[1] * y + normal[2] * z > 0:
        return twin, True
    return face, False


@compiled
def texel_at(light_px: Floats, u: float, v: float, height: int, width: int) -> int:
    """The index of the texel of a light map (height, width) at a point of a face.

    `light_px` (3, 2) are the positions of the corners of the face on the light map, in px.
    `u` is the barycentric coordinate of the second corner.
    `v` is the barycentric coordinate of the third corner.
    """
    x_px = light_px[0, 0] + u * (light_px[1, 0] - light_px[0, 0]) + v * (light_px[2, 0] - light_px[0, 0])
    y_px = light_px[0, 1] + u * (light_px[1, 1] - light_px[0, 1]) + v * (light_px[2, 1] - light_px[0, 1])
    column = min(max(math.floor(x_px), 0), width - 1)
    row = min(max(math.floor(y_px), 0), height - 1)
    texel: int = row * width + column
    return texel


@compiled
def reflected(
    x: float, y: float, z: float, normal_x: float, normal_y: float, normal_z: float
) -> tuple[float, float, float]:
    """The direction (x, y, z) after its reflection at a surface with the unit normal (normal_x, normal_y, normal_z)."""
    along_normal = normal_x * x + normal_y * y + normal_z * z
    return x - 2 * along_normal * normal_x, y - 2 * along_normal * normal_y, z - 2 * along_normal * normal_z
