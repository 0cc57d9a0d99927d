"""Rays against bodies that move: what a camera sees of them, and what they hide from each other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Indices, Mask, Pixels
from vobench.rendering.cutout import CutOuts
from vobench.rendering.embree import Hits, TriangleCaster
from vobench.rendering.geometry import RAY_OFFSET_M
from vobench.rendering.shot import moved, rays_in, turn
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles

REACH_M = 1e8  # beyond every scene
MOST_PASSED = 64  # backs and holes that a ray passes before it counts as lost between faces that touch
GRAZING = 1e-3  # the least cosine by which a ray is taken to leave a face's plane
# Embree works in float32, which resolves a place to this share of the scene's largest coordinate.
RESOLUTION = 1e-6
WATERTIGHT = 1e-3 * RESOLUTION  # a ray that passes a face's edge this close has met it
STEP_EDGES = 3  # edge tolerances that a ray moves on past a back, or aside to look for other faces
ASIDE = 5  # directions in which faces are looked for: straight on and to four sides
AXES = np.eye(3)


@dataclass(frozen=True, slots=True)
class Body:
    """A body's faces: all that can be seen, those that stop light, those with holes, panes; and a sphere around."""

    visible: TriangleCaster
    opaque: TriangleCaster
    holed: TriangleCaster | None
    panes: TriangleCaster | None
    center_m: Array
    radius_m: float

    def near(
        self,
        origins_m: Array,
        directions: Array,
        reach_m: Array | float = np.inf,
    ) -> Mask:
        """Which rays (R, 3) of unit length pass the sphere within `reach_m` of their origins (R, 3)."""
        to_center = self.center_m - origins_m
        along = dot(to_center, directions)
        nearest = np.clip(along, 0, reach_m)
        squared_distance = dot(to_center, to_center) - nearest * (2 * along - nearest)
        return np.asarray(squared_distance <= self.radius_m**2)


@dataclass(frozen=True, slots=True)
class Occluders:
    """Triangles (T, 3, 3) that stop light, and which of them (T,) have no holes."""

    corners_m: Array
    is_whole: Mask


class Bodies:
    """The faces of a scene, each in its body's frame, and rays against them; body 0 is all that stands.

    normals (F + 1, 3) and offsets_m (F + 1,) are the planes of faces, body (F + 1,) whose they are; the last entry,
    that of the face -1, is nothing.
    """

    def __init__(self, scene: Scene) -> None:
        self.faces = triangles(scene)
        self.movers = scene.movers
        corners_m = self.faces.corners_m
        no_plane = np.full((1, 3), np.nan)
        self.normals = np.append(self.faces.plane, no_plane, axis=0)
        offsets_m = dot(self.faces.plane, corners_m.mean(1))
        self.offsets_m = np.append(offsets_m, np.nan)
        self.body = np.append(self.faces.mover + 1, 0)
        heights_m = np.append(_least_height_m(corners_m), np.nan)
        self._height_m = heights_m.astype(np.float32)
        largest_m = float(np.abs(corners_m).max(initial=0.0))
        self._edge_m = RESOLUTION * max(1.0, largest_m)
        self.ray_offset_m = max(RAY_OFFSET_M, self._edge_m)
        self._twin = back_faces(self.faces)
        self._cut_outs = CutOuts(self.faces, scene.materials)

        glass = {name for name, material in scene.materials.items() if material.kind == "pane"}
        of_glass = [thing.material in glass for thing in self.faces.things]
        is_pane = np.array(of_glass, bool)[self.faces.thing]
        # Of two faces back to back only one is there for rays: they could meet either.
        twin = self._twin[:-1]
        is_first = (twin < 0) | (twin > np.arange(len(is_pane)))
        self._is_solid = is_first & ~is_pane
        body_count = 1 + len(scene.movers)
        self._bodies = [self._body(index, is_pane) for index in range(body_count)]

    def visible(self, directions: Array, T_bodies_camera: Sequence[Array]) -> Hits:
        """The hits of a camera's rays along unit directions (R, 3) in its frame; without a hit, the distance is NaN."""
        world, *movers = self._bodies
        origins_m, world_directions = rays_in(T_bodies_camera[0], directions)
        hits = self._first_hits(world, origins_m, world_directions)
        self._close_gaps(world, origins_m, world_directions, hits)
        for body, T_body_camera in zip(movers, T_bodies_camera[1:], strict=True):
            origins_m, body_directions = rays_in(T_body_camera, directions)
            rays = np.flatnonzero(body.near(origins_m, body_directions))
            body_hits = self._first_hits(body, origins_m[rays], body_directions[rays])
            nearest_m = np.nan_to_num(hits.distance[rays], nan=np.inf)
            is_nearer = body_hits.distance < nearest_m
            hits.face[rays[is_nearer]] = body_hits.face[is_nearer]
            hits.distance[rays[is_nearer]] = body_hits.distance[is_nearer]
        return hits

    def behind_panes(
        self,
        directions: Array,
        T_bodies_camera: Sequence[Array],
        distance_m: Array,
    ) -> Mask:
        """Whether a pane is in front of the hit at a distance (R,); NaN stands for a ray without a hit."""
        is_behind = np.zeros(len(directions), bool)
        limit_m = np.nan_to_num(distance_m, nan=REACH_M)
        for body, T_body_camera in zip(self._bodies, T_bodies_camera, strict=True):
            if body.panes is not None:
                origins_m, body_directions = rays_in(T_body_camera, directions)
                is_behind |= body.panes.stops(origins_m, body_directions, limit_m)
        return is_behind

    def blocked(
        self,
        starts_m: Floats,
        vectors_m: Floats,
        T_bodies_world: Sequence[Array],
        reach: Floats,
    ) -> Mask:
        """Whether anything but glass is between starts and starts + reach * vectors (R, 3), both in the world."""
        is_blocked = self._stopped(self._bodies[0], starts_m, vectors_m, reach)
        return is_blocked | self.blocked_by_movers(starts_m, vectors_m, T_bodies_world, reach, where=~is_blocked)

    def blocked_by_movers(
        self,
        starts_m: Floats,
        vectors_m: Floats,
        T_bodies_world: Sequence[Array],
        reach: Floats,
        *,
        where: Mask,
    ) -> Mask:
        """Whether a mover is between starts and starts + reach * vectors (R, 3), of the rays in the mask `where`."""
        movers = self._bodies[1:]
        is_blocked = np.zeros(len(starts_m), bool)
        for body, T_body_world in zip(movers, T_bodies_world[1:], strict=True):
            body_starts_m = moved(T_body_world, starts_m.astype(float))
            body_vectors_m = turn(T_body_world, vectors_m.astype(float))
            length_m = np.linalg.norm(body_vectors_m, axis=1)
            is_near = body.near(body_starts_m, body_vectors_m / length_m[:, None], length_m)
            rays = np.flatnonzero(is_near & where & ~is_blocked & (reach > 0))
            is_blocked[rays] = self._stopped(body, body_starts_m[rays], body_vectors_m[rays], reach[rays])
        return is_blocked

    def stationary_occluders(self) -> Occluders:
        """All stationary triangles that can stop light."""
        rows = np.flatnonzero(self._is_solid & (self.body[:-1] == 0) & (self._height_m[:-1] > 0))
        is_cut_out = self._cut_outs.cutout_of_face[rows] >= 0
        return Occluders(self.faces.corners_m[rows], ~is_cut_out)

    def _body(self, index: int, is_pane: Mask) -> Body:
        has_area = self._height_m[:-1] > 0
        is_member = (self.body[:-1] == index) & has_area
        points_m = self.faces.corners_m[is_member].reshape(-1, 3)
        center_m = np.zeros(3)
        if len(points_m):
            center_m = (points_m.min(0) + points_m.max(0)) / 2
        distances_m = np.linalg.norm(points_m - center_m, axis=1)
        radius_m = float(distances_m.max(initial=0.0)) + RAY_OFFSET_M

        def caster(is_included: Mask) -> TriangleCaster:
            rows = np.flatnonzero(is_member & is_included)
            return TriangleCaster(self.faces.corners_m, rows, robust=False)

        is_solid = self._is_solid
        is_cut_out = self._cut_outs.cutout_of_face[:-1] >= 0
        has_holes = is_member & is_solid & is_cut_out
        is_glass = is_member & is_pane
        visible = caster(is_solid)
        return Body(
            visible=visible,
            opaque=caster(is_solid & ~has_holes) if has_holes.any() else visible,
            holed=caster(has_holes) if has_holes.any() else None,
            panes=caster(is_glass) if is_glass.any() else None,
            center_m=center_m,
            radius_m=radius_m,
        )

    def _stopped(
        self,
        body: Body,
        starts_m: Array | Floats,
        vectors_m: Array | Floats,
        reach: Floats,
    ) -> Mask:
        """Whether a body stops light between two points, from either side of its faces but not through their holes."""
        is_stopped = body.opaque.stops(starts_m, vectors_m, reach)
        if not body.holed:
            return is_stopped
        rays = np.flatnonzero(~is_stopped & (reach > 0))
        start_m = starts_m[rays]
        ahead_m = vectors_m[rays] * reach[rays, None]
        for _ in range(MOST_PASSED):
            if not len(rays):
                break
            hits = body.holed.hits(start_m, ahead_m, 1.0)
            is_hole = self._cut_outs.are_in_holes(hits)
            is_stopped[rays[(hits.face >= 0) & ~is_hole]] = True
            offset = RAY_OFFSET_M / np.linalg.norm(ahead_m, axis=1)
            step = (hits.distance + offset)[:, None]
            goes_on = is_hole & (step[:, 0] < 1)
            rays = rays[goes_on]
            start_m = (start_m + step * ahead_m)[goes_on]
            ahead_m = (ahead_m * (1 - step))[goes_on]
        return is_stopped

    def _first_hits(self, body: Body, origins_m: Array, directions: Array) -> Hits:
        """The first face of a body that rays (R, 3) in its frame meet from its front.

        Embree finds the face, in float32; the distance follows from the plane's equation. Where a ray passes so close
        to an edge that float32 may take the wrong face, float64 decides.
        """
        hits, cosine = self._float32_hits(body, origins_m, directions)
        origin_offsets_m = dot(self.normals[hits.face], origins_m)
        distance_m = (self.offsets_m[hits.face] - origin_offsets_m) / cosine
        first_weight = 1 - hits.u - hits.v
        least_weight = np.minimum(np.minimum(hits.u, hits.v), first_weight)
        edge_distance_m = least_weight * self._height_m[hits.face]
        doubtful = np.flatnonzero(-cosine * edge_distance_m < self._edge_m)
        distance_m[doubtful] = hits.distance[doubtful]
        exact = replace(hits, distance=distance_m)
        self._decide(body, origins_m, directions, exact, doubtful)
        return exact

    def _float32_hits(
        self, body: Body, origins_m: Array, directions: Array, most: int = MOST_PASSED
    ) -> tuple[Hits, Array]:
        """The first hits of rays that are neither backs nor holes, and the cosines (R,) to the normals of the faces."""
        hits = body.visible.hits(origins_m, directions, REACH_M)
        is_hole = self._cut_outs.are_in_holes(hits)
        cosine = self._turn_to_fronts(hits.face, directions)
        passed = np.flatnonzero((cosine >= 0) | is_hole)
        if len(passed) and most:
            steepness = np.maximum(np.abs(cosine[passed]), GRAZING)
            step_m = hits.distance[passed] + STEP_EDGES * self._edge_m / steepness
            start_m = origins_m[passed] + step_m[:, None] * directions[passed]
            further, cosine[passed] = self._float32_hits(body, start_m, directions[passed], most - 1)
            hits.face[passed] = further.face
            hits.u[passed] = further.u
            hits.v[passed] = further.v
            hits.distance[passed] = step_m + further.distance
        return hits, cosine

    def _turn_to_fronts(self, face: Indices, directions: Array) -> Array:
        """Cosines (R,) to the normals of faces; a face that is met from its back and has a twin becomes that."""
        cosine = dot(self.normals[face], directions)
        backs = np.flatnonzero(cosine >= 0)
        backs = backs[self._twin[face[backs]] >= 0]
        face[backs] = self._twin[face[backs]]
        cosine[backs] = -cosine[backs]
        return cosine

    def _close_gaps(
        self,
        body: Body,
        origins_m: Array,
        directions: Array,
        hits: Hits,
    ) -> None:
        """Close the gaps that float32 leaves between faces: rays that meet nothing are tried again a hair aside."""
        missed = np.flatnonzero(hits.face < 0)
        aside = directions[missed] + (self._edge_m * AXES.sum(0))
        face_aside = body.visible.hits(origins_m[missed], aside, REACH_M).face
        gaps = missed[face_aside >= 0]
        self._decide(body, origins_m, directions, hits, gaps)

    def _decide(
        self,
        body: Body,
        origins_m: Array,
        directions: Array,
        hits: Hits,
        doubtful: Pixels,
    ) -> None:
        """Decide the doubtful hits in float64, among the faces that Embree finds there and a little aside."""
        if not len(doubtful):
            return
        ahead = directions[doubtful]
        reach_m = hits.distance[doubtful]
        least_along = AXES[np.argmin(np.abs(ahead), axis=1)]
        right = unit(np.cross(ahead, least_along))
        down = np.cross(ahead, right)
        lever_m = np.where(reach_m > 0, reach_m, 1)[:, None]
        step = STEP_EDGES * self._edge_m / lever_m
        origins = np.concatenate([origins_m[doubtful]] * ASIDE)
        shifts = (0 * right, right, down, -right, -down)
        aside = np.concatenate([ahead + step * shift for shift in shifts])

        aside_hits, _ = self._float32_hits(body, origins, aside)
        candidates = aside_hits.face.reshape(ASIDE, -1)
        candidates[0] = hits.face[doubtful]
        straight_on = np.concatenate([ahead] * ASIDE)
        exact_m = self._exact_m(candidates.ravel(), origins, straight_on).reshape(ASIDE, -1)
        nearest = exact_m.argmin(0), np.arange(len(doubtful))
        is_met = np.isfinite(exact_m[nearest])
        hits.face[doubtful[is_met]] = candidates[nearest][is_met]
        hits.distance[doubtful[is_met]] = exact_m[nearest][is_met]
        # Past an outline; where all are faces, the ray is in a joint between them, and Embree's result stays.
        past = doubtful[~is_met & (candidates < 0).any(0)]
        hits.face[past] = -1
        hits.distance[past] = np.nan

    def _exact_m(self, face: Indices, origins_m: Array, directions: Array) -> Array:
        """How far along rays (R, 3) their faces' fronts are, infinite where they pass them by."""
        normals = self.normals[face]
        corners_m = self.faces.corners_m[face]
        cosine = dot(normals, directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance_m = (self.offsets_m[face] - dot(normals, origins_m)) / cosine
            points_m = origins_m + distance_m[:, None] * directions
            edges_m = np.roll(corners_m, -1, axis=1) - corners_m
            inward = np.cross(normals[:, None], unit(edges_m))
            inside_m = np.einsum("rei,rei->re", inward, points_m[:, None] - corners_m).min(1)
            is_inside = inside_m >= -WATERTIGHT / RESOLUTION * self._edge_m
            is_met = (cosine < 0) & (distance_m > 0) & is_inside
        return np.where(is_met, distance_m, np.inf)


def _least_height_m(corners_m: Array) -> Array:
    """The least of the three heights (F,) of triangles (F, 3, 3)."""
    edges_m = corners_m - np.roll(corners_m, 1, axis=1)
    lengths_m = np.linalg.norm(edges_m, axis=2)
    longest_m = np.maximum(lengths_m.max(1), 1e-30)
    doubled_normals = np.cross(edges_m[:, 0], edges_m[:, 1])
    doubled_area_m2 = np.linalg.norm(doubled_normals, axis=1)
    return np.asarray(doubled_area_m2 / longest_m)


def back_faces(faces: Triangles) -> Indices:
    """The face (F + 1,) of the same thing with the same corners and the opposite normal, -1 for none."""
    points_m = faces.corners_m.reshape(-1, 3)
    corner = _numbered(points_m).reshape(-1, 3)
    corner_sets = np.sort(corner, axis=1)
    key = _numbered(np.column_stack([corner_sets, faces.thing]))
    order = np.argsort(key, kind="stable")
    first = order[:-1]
    second = order[1:]
    cosine = dot(faces.plane[first], faces.plane[second])
    is_pair = (key[first] == key[second]) & (cosine < 0)
    is_pair[1:] &= ~is_pair[:-1]
    back = np.full(len(faces) + 1, -1, np.int32)
    back[first[is_pair]] = second[is_pair]
    back[second[is_pair]] = first[is_pair]
    return back


def _numbered(rows: NDArray[Any]) -> NDArray[np.int64]:
    """Numbers (N,) that are equal where rows (N, K) are."""
    order = np.lexsort(rows.T)
    is_new = (np.diff(rows[order], axis=0) != 0).any(1)
    numbers = np.zeros(len(rows), np.int64)
    numbers[order[1:]] = np.cumsum(is_new)
    return numbers


def dot(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Products (R,) of vectors (R, 3)."""
    return np.asarray(np.einsum("ri,ri->r", a, b))
