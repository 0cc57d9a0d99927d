"""The first face that each ray hits from the front, with the accuracy of float64.

Embree, which finds the faces, computes in float32. If a ray passes so close to an edge that rounding can select the
wrong face, or none, the candidates around this point are compared in float64.
"""

from dataclasses import dataclass, replace

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Indices, Pixels
from vobench.rendering.back_face import back_faces
from vobench.rendering.cutout import CutOuts
from vobench.rendering.dot_product import dot
from vobench.rendering.embree import Hits, TriangleCaster
from vobench.scene.triangles import Triangles

REACH_M = 1e8  # beyond every scene
MOST_PASSED = 64  # the largest number of backs and holes that a ray passes; then it is caught between faces that touch
LEAST_STEEPNESS = 1e-3  # the smallest cosine to a normal by which a step along a ray is divided
RESOLUTION = 1e-6  # the resolution of coordinates in Embree's float32, relative to the largest coordinate of the scene
WATERTIGHT = 1e-3  # a ray hits a face if it passes its edge at less than this distance, relative to the resolution
STEP_EDGES = 3  # the step past a back face, and the shift of the rays that find candidates, relative to the resolution
SHIFTS = 5  # the number of rays that find candidates: the ray itself, and rays shifted to four sides
AXES = np.eye(3)


@dataclass(frozen=True, slots=True)
class FacePlanes:
    """The faces of a table and their planes, each in the frame of its body.

    `corners_m` (F, 3, 3) are their corners. The other arrays have a last entry for the face -1, which is no face.
    `normals` (F + 1, 3) and `offsets_m` (F + 1,) define the planes: normal · x = offset.
    `height_m` (F + 1,) is the smallest height of each triangle.
    `back` (F + 1,) is the face on the other side of a sheet, -1 for none.
    `resolution_m` is the resolution of float32 at the largest coordinate.
    """

    corners_m: Array
    normals: Array
    offsets_m: Array
    height_m: Floats
    back: Indices
    resolution_m: float


def face_planes(faces: Triangles) -> FacePlanes:
    """The planes of a table's faces."""
    corners_m = faces.corners_m
    no_normal = np.full((1, 3), np.nan)
    offsets_m = dot(faces.plane, corners_m.mean(1))
    height_m = np.append(least_height_m(corners_m), np.nan)
    largest_m = float(np.abs(corners_m).max(initial=0.0))
    return FacePlanes(
        corners_m=corners_m,
        normals=np.append(faces.plane, no_normal, axis=0),
        offsets_m=np.append(offsets_m, np.nan),
        height_m=height_m.astype(np.float32),
        back=back_faces(faces),
        resolution_m=RESOLUTION * max(1.0, largest_m),
    )


def least_height_m(corners_m: Array) -> Array:
    """The smallest of the three heights of each triangle (F, 3, 3)."""
    edges_m = corners_m - np.roll(corners_m, 1, axis=1)
    lengths_m = np.linalg.norm(edges_m, axis=2)
    longest_m = np.maximum(lengths_m.max(1), 1e-30)
    doubled_normals = np.cross(edges_m[:, 0], edges_m[:, 1])
    doubled_area_m2 = np.linalg.norm(doubled_normals, axis=1)
    return np.asarray(doubled_area_m2 / longest_m)


class FrontCaster:
    """Casts rays at the faces of one body, in the frame of the body. Backs of faces and holes are invisible."""

    def __init__(self, triangles: TriangleCaster, planes: FacePlanes, cut_outs: CutOuts) -> None:
        self._triangles = triangles
        self._planes = planes
        self._cut_outs = cut_outs

    def hits(self, origins_m: Array, directions: Array) -> Hits:
        """The first hits of rays with origins (R, 3) and unit directions (R, 3)."""
        planes = self._planes
        hits, cosine = self._float32_hits(origins_m, directions)
        origin_offsets_m = dot(planes.normals[hits.face], origins_m)
        distance_m = (planes.offsets_m[hits.face] - origin_offsets_m) / cosine

        first_weight = 1 - hits.u - hits.v
        smallest_weight = np.minimum(np.minimum(hits.u, hits.v), first_weight)
        edge_distance_m = smallest_weight * planes.height_m[hits.face]  # from the hit, at least
        ray_distance_m = -cosine * edge_distance_m  # from the ray, because a ray can pass obliquely
        doubtful = np.flatnonzero(ray_distance_m < planes.resolution_m)
        distance_m[doubtful] = hits.distance[doubtful]
        exact_hits = replace(hits, distance=distance_m)
        self._decide(origins_m, directions, exact_hits, doubtful)
        return exact_hits

    def close_gaps(self, origins_m: Array, directions: Array, hits: Hits) -> None:
        """Add hits, in place, for rays that have passed through a gap between two faces due to float32.

        A ray without a hit may have passed through a gap if a slightly shifted ray has a hit.
        """
        missed = np.flatnonzero(hits.face < 0)
        shift = self._planes.resolution_m * AXES.sum(0)
        directions_aside = directions[missed] + shift
        face_aside = self._triangles.hits(origins_m[missed], directions_aside, REACH_M).face
        gaps = missed[face_aside >= 0]
        self._decide(origins_m, directions, hits, gaps)

    def _float32_hits(
        self,
        origins_m: Array,
        directions: Array,
        most_passed: int = MOST_PASSED,
    ) -> tuple[Hits, Array]:
        """The first hits of rays with fronts of faces, and the cosines (R,) to the normals of these faces."""
        hits = self._triangles.hits(origins_m, directions, REACH_M)
        is_hole = self._cut_outs.are_in_holes(hits)
        cosine = self._turn_to_fronts(hits.face, directions)
        passed = np.flatnonzero((cosine >= 0) | is_hole)
        if not len(passed) or not most_passed:
            return hits, cosine

        # These rays continue slightly behind the back or the hole.
        steepness = np.maximum(np.abs(cosine[passed]), LEAST_STEEPNESS)
        step_m = hits.distance[passed] + STEP_EDGES * self._planes.resolution_m / steepness
        next_origins_m = origins_m[passed] + step_m[:, None] * directions[passed]
        next_hits, cosine[passed] = self._float32_hits(next_origins_m, directions[passed], most_passed - 1)
        hits.face[passed] = next_hits.face
        hits.u[passed] = next_hits.u
        hits.v[passed] = next_hits.v
        hits.distance[passed] = step_m + next_hits.distance
        return hits, cosine

    def _turn_to_fronts(self, face: Indices, directions: Array) -> Array:
        """The cosines (R,) between directions and the normals of faces; negative for fronts.

        If a ray hits the back of one side of a sheet, the face is replaced, in place, by the other side.
        """
        planes = self._planes
        cosine = dot(planes.normals[face], directions)
        backs = np.flatnonzero(cosine >= 0)
        sheets = backs[planes.back[face[backs]] >= 0]
        face[sheets] = planes.back[face[sheets]]
        cosine[sheets] = -cosine[sheets]
        return cosine

    def _decide(
        self,
        origins_m: Array,
        directions: Array,
        hits: Hits,
        doubtful: Pixels,
    ) -> None:
        """Replace doubtful hits (D,), in place, by the nearest hit in float64 with the candidates around them.

        A ray can miss all its candidates. If some of the shifted rays hit nothing, the ray has passed an outline, and
        has no hit. Otherwise it has hit the edge between two faces, and keeps its hit.
        """
        if not len(doubtful):
            return
        candidates = self._candidates(origins_m[doubtful], directions[doubtful], hits.take(doubtful))
        repeated_origins_m = np.concatenate([origins_m[doubtful]] * SHIFTS)
        repeated_directions = np.concatenate([directions[doubtful]] * SHIFTS)
        candidate_distance_m = self._exact_m(candidates.ravel(), repeated_origins_m, repeated_directions)
        candidate_distance_m = candidate_distance_m.reshape(SHIFTS, -1)

        nearest = candidate_distance_m.argmin(0), np.arange(len(doubtful))
        nearest_m = candidate_distance_m[nearest]
        is_hit = np.isfinite(nearest_m)
        hits.face[doubtful[is_hit]] = candidates[nearest][is_hit]
        hits.distance[doubtful[is_hit]] = nearest_m[is_hit]
        passes_outline = ~is_hit & (candidates < 0).any(0)
        missed = doubtful[passes_outline]
        hits.face[missed] = -1
        hits.distance[missed] = np.nan

    def _candidates(self, origins_m: Array, directions: Array, hits: Hits) -> Indices:
        """The faces (SHIFTS, D) of the hits of rays (D, 3), in the first row, and of shifted rays; -1 for none."""
        least_along = AXES[np.argmin(np.abs(directions), axis=1)]
        right = unit(np.cross(directions, least_along))
        down = np.cross(directions, right)
        lever_m = np.where(hits.distance > 0, hits.distance, 1)[:, None]
        shift = STEP_EDGES * self._planes.resolution_m / lever_m
        shifts = (0 * right, right, down, -right, -down)
        directions_aside = np.concatenate([directions + shift * aside for aside in shifts])
        hits_aside, _ = self._float32_hits(np.concatenate([origins_m] * SHIFTS), directions_aside)
        candidates = hits_aside.face.reshape(SHIFTS, -1)
        candidates[0] = hits.face
        return candidates

    def _exact_m(self, face: Indices, origins_m: Array, directions: Array) -> Array:
        """The distances (R,), in float64, at which rays (R, 3) hit the fronts of faces (R,); infinite without a hit."""
        planes = self._planes
        normals = planes.normals[face]
        corners_m = planes.corners_m[face]
        cosine = dot(normals, directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance_m = (planes.offsets_m[face] - dot(normals, origins_m)) / cosine
            points_m = origins_m + distance_m[:, None] * directions
            edges_m = np.roll(corners_m, -1, axis=1) - corners_m
            inward = np.cross(normals[:, None], unit(edges_m))
            inside_m = np.einsum("rei,rei->re", inward, points_m[:, None] - corners_m).min(1)
            is_inside = inside_m >= -WATERTIGHT * planes.resolution_m
            is_hit = (cosine < 0) & (distance_m > 0) & is_inside
        return np.where(is_hit, distance_m, np.inf)
