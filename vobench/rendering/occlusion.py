"""Ray casting with stationary and moving bodies: the faces that a camera sees, and whether a segment is blocked."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Mask, Rows
from vobench.rendering.cutout import CutOuts
from vobench.rendering.dot_product import dot
from vobench.rendering.embree import Hits, TriangleCaster
from vobench.rendering.front_hit import REACH_M, FrontCaster, face_planes
from vobench.rendering.geometry import RAY_OFFSET_M
from vobench.rendering.shot import moved, of_rays, rays_in, spanned, turn
from vobench.scene.scene import Scene, triangles
from vobench.scene.swaying import in_wind

CONE_MARGIN_RAD = 1e-3
LEAST_LENGTH_M = 1e-12  # by which vectors are divided at least
MOST_HOLES = 64  # the largest number of holes that a ray passes; then it counts as not blocked


@dataclass(frozen=True, slots=True)
class Body:
    """The faces of one rigid body, in its frame.

    `fronts` finds the faces that a camera sees.
    `opaque` are the faces without holes that block light, `holed` those with holes, and `panes` are of glass. The last
    two are None if the body has no such faces.
    `centre_m` (3,) and `radius_m` are a bounding sphere.
    """

    fronts: FrontCaster
    opaque: TriangleCaster
    holed: TriangleCaster | None
    panes: TriangleCaster | None
    centre_m: Array
    radius_m: float

    def in_cone(self, T_body_camera: Array, axis: Array, angle_rad: float) -> bool:
        """Whether the bounding sphere is partly inside a cone of rays from a camera at one of several poses (K, 4, 4).

        `axis` (3,) is the cone's axis in the camera's frame, and `angle_rad` half of its opening angle.
        """
        centre_m = self.centre_seen_from(T_body_camera)
        distance_m = np.maximum(np.linalg.norm(centre_m, axis=1), LEAST_LENGTH_M)
        off_axis_rad = np.arccos(np.clip(centre_m @ axis / distance_m, -1, 1))
        sphere_rad = np.arcsin(np.minimum(self.radius_m / distance_m, 1))
        is_inside = (off_axis_rad <= angle_rad + sphere_rad) | (distance_m <= self.radius_m)
        return bool(is_inside.any())

    def centre_seen_from(self, T_body_frame: Array) -> Array:
        """The centre (K, 3) of the bounding sphere in frames with the poses (K, 4, 4) in the frame of the body."""
        return se3.apply(se3.inverse(T_body_frame), self.centre_m[None]).reshape(-1, 3)

    def near(
        self,
        origins_m: Array,
        directions: Array,
        reach_m: Array | float = np.inf,
    ) -> Mask:
        """Whether rays (R, 3) with unit directions meet the bounding sphere within `reach_m` of their origins."""
        return is_near_sphere(self.centre_m, self.radius_m, origins_m, directions, reach_m)


def is_near_sphere(
    centre_m: Array,
    radius_m: float,
    origins_m: Array,
    directions: Array,
    reach_m: Array | float,
) -> Mask:
    """Whether rays (R, 3) with unit directions meet a sphere within `reach_m` of their origins.

    `centre_m` is one centre (3,) or (1, 3), or one for each ray (R, 3).
    """
    to_centre_m = centre_m - origins_m
    along_m = dot(to_centre_m, directions)
    nearest_m = np.clip(along_m, 0, reach_m)
    squared_m2 = dot(to_centre_m, to_centre_m) - nearest_m * (2 * along_m - nearest_m)
    return np.asarray(squared_m2 <= radius_m**2)


@dataclass(frozen=True, slots=True)
class Occluders:
    """Triangles (T, 3, 3) that block light, and whether each has no holes (T,)."""

    corners_m: Array
    is_whole: Mask


class Bodies:
    """The faces of a scene, each in the frame of its body. Body 0 has all stationary faces, the others are movers.

    Leaves in wind are movers, too, after those of the scene.

    `normals` (F + 1, 3) and `offsets_m` (F + 1,) define the planes of the faces: normal · x = offset.
    `body` (F + 1,) is the body of each face. The last entries are for the face -1, which is no face.
    """

    def __init__(self, scene: Scene) -> None:
        swaying = in_wind(scene, triangles(scene))
        self.faces = swaying.faces
        self.movers = swaying.movers
        self.rigid_count = len(scene.movers)  # the movers before the leaves in wind
        self._planes = face_planes(self.faces)
        self.normals = self._planes.normals
        self.offsets_m = self._planes.offsets_m
        self.body = np.append(self.faces.mover + 1, 0)
        self.ray_offset_m = max(RAY_OFFSET_M, self._planes.resolution_m)
        self._cut_outs = CutOuts(self.faces, scene.materials)

        pane_materials = {name for name, material in scene.materials.items() if material.kind == "pane"}
        is_pane_by_thing = np.array([thing.material in pane_materials for thing in self.faces.things], bool)
        self._is_pane = is_pane_by_thing[self.faces.thing]
        # Of two faces back to back, only the first is included, because a ray could hit either of them.
        back = self._planes.back[:-1]
        is_first_of_pair = (back < 0) | (back > np.arange(len(back)))
        self._is_solid = is_first_of_pair & ~self._is_pane
        self._has_area = self._planes.height_m[:-1] > 0
        self._is_cut_out = self._cut_outs.cutout_of_face[:-1] >= 0
        self._bodies = [self._create_body(index) for index in range(1 + len(self.movers))]

    def visible(self, directions: Array, T_bodies_camera: Sequence[Array]) -> Hits:
        """The first hits of rays from a camera along unit directions (R, 3) in its frame.

        `T_bodies_camera` are the poses of the camera in the frames of all bodies.
        """
        stationary, *movers = self._bodies
        origins_m, stationary_directions = rays_in(T_bodies_camera[0], directions)
        hits = stationary.fronts.hits(origins_m, stationary_directions)
        stationary.fronts.close_gaps(origins_m, stationary_directions, hits)
        if not movers:
            return hits
        axis, widest = _cone(directions)
        for index, body in enumerate(movers, start=1):
            if not body.in_cone(spanned(T_bodies_camera, index), axis, widest):
                continue
            T_body_camera = T_bodies_camera[index]
            origins_m, body_directions = rays_in(T_body_camera, directions)
            rays = np.flatnonzero(body.near(origins_m, body_directions))
            body_hits = body.fronts.hits(origins_m[rays], body_directions[rays])
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
        """Whether a pane is in front of the hit at a distance (R,), which is NaN for a ray without a hit."""
        is_behind = np.zeros(len(directions), bool)
        limit_m = np.nan_to_num(distance_m, nan=REACH_M)
        for index, body in enumerate(self._bodies):
            if body.panes is not None:
                origins_m, body_directions = rays_in(T_bodies_camera[index], directions)
                is_behind |= body.panes.stops(origins_m, body_directions, limit_m)
        return is_behind

    def blocked(
        self,
        starts_m: Floats,
        vectors_m: Floats,
        T_bodies_world: Sequence[Array],
        reach: Floats,
    ) -> Mask:
        """Whether anything except glass is between starts and starts + reach * vectors (R, 3), in the world frame."""
        is_blocked = self._blocked_by_body(self._bodies[0], starts_m, vectors_m, reach)
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
        """Whether a mover is between starts and starts + reach * vectors (R, 3), in the world frame.

        Only the rays in the mask `where` (R,) are tested.
        """
        movers = self._bodies[1:]
        is_blocked = np.zeros(len(starts_m), bool)
        traced = np.flatnonzero(where & (reach > 0))
        if not len(traced):
            return is_blocked
        origins_m = starts_m[traced].astype(float)
        segments_m = vectors_m[traced].astype(float)
        lengths_m = np.linalg.norm(segments_m, axis=1)
        directions = segments_m / np.maximum(lengths_m, LEAST_LENGTH_M)[:, None]
        low_m = np.minimum(origins_m, origins_m + segments_m).min(0)
        high_m = np.maximum(origins_m, origins_m + segments_m).max(0)
        for index, body in enumerate(movers, start=1):
            centres_m = body.centre_seen_from(spanned(T_bodies_world, index))
            is_above_low = centres_m.max(0) + body.radius_m >= low_m
            is_below_high = centres_m.min(0) - body.radius_m <= high_m
            if not (is_above_low & is_below_high).all():
                continue
            T_body_rays = of_rays(T_bodies_world[index], traced)
            centre_m = body.centre_seen_from(T_body_rays)  # (1, 3), or one for each ray
            is_near = is_near_sphere(centre_m, body.radius_m, origins_m, directions, lengths_m)
            rays = np.flatnonzero(is_near & ~is_blocked[traced])
            T_body_near = of_rays(T_body_rays, rays)
            body_starts_m = moved(T_body_near, origins_m[rays])
            body_vectors_m = turn(T_body_near, segments_m[rays])
            of_all = traced[rays]
            is_blocked[of_all] = self._blocked_by_body(body, body_starts_m, body_vectors_m, reach[of_all])
        return is_blocked

    def stationary_occluders(self) -> Occluders:
        """All stationary triangles that can block light."""
        is_stationary = self.body[:-1] == 0
        rows = np.flatnonzero(self._is_solid & is_stationary & self._has_area)
        return Occluders(self.faces.corners_m[rows], ~self._is_cut_out[rows])

    def _create_body(self, index: int) -> Body:
        is_member = (self.body[:-1] == index) & self._has_area
        is_solid = is_member & self._is_solid
        has_holes = is_solid & self._is_cut_out
        is_pane = is_member & self._is_pane

        visible = self._caster(is_solid)
        opaque = visible
        holed = None
        if has_holes.any():
            opaque = self._caster(is_solid & ~has_holes)
            holed = self._caster(has_holes)
        centre_m, radius_m = _bounding_sphere(self.faces.corners_m[is_member].reshape(-1, 3))
        return Body(
            fronts=FrontCaster(visible, self._planes, self._cut_outs),
            opaque=opaque,
            holed=holed,
            panes=self._caster(is_pane) if is_pane.any() else None,
            centre_m=centre_m,
            radius_m=radius_m,
        )

    def _caster(self, is_included: Mask) -> TriangleCaster:
        """A caster of rays against the faces in a mask (F,)."""
        return TriangleCaster(self.faces.corners_m, np.flatnonzero(is_included), robust=False)

    def _blocked_by_body(
        self,
        body: Body,
        starts_m: Array | Floats,
        vectors_m: Array | Floats,
        reach: Floats,
    ) -> Mask:
        """Whether a body is between starts and starts + reach * vectors (R, 3), in the frame of the body.

        Both sides of its faces block light, but their holes do not.
        """
        is_blocked = body.opaque.stops(starts_m, vectors_m, reach)
        if body.holed:
            rays = np.flatnonzero(~is_blocked & (reach > 0))
            segments_m = vectors_m[rays] * reach[rays, None]
            is_blocked[self._blocked_between_holes(body.holed, rays, starts_m[rays], segments_m)] = True
        return is_blocked

    def _blocked_between_holes(
        self,
        holed: TriangleCaster,
        rays: Rows,
        starts_m: Array | Floats,
        segments_m: Array | Floats,
    ) -> Rows:
        """The rays (R,) whose segments (R, 3) from starts (R, 3) hit faces with holes at an opaque point."""
        blocked = [rays[:0]]
        for _ in range(MOST_HOLES):
            if not len(rays):
                break
            hits = holed.hits(starts_m, segments_m, 1.0)
            is_hole = self._cut_outs.are_in_holes(hits)
            blocked.append(rays[(hits.face >= 0) & ~is_hole])

            # Those in a hole continue slightly behind it.
            lengths_m = np.maximum(np.linalg.norm(segments_m, axis=1), LEAST_LENGTH_M)
            offset = RAY_OFFSET_M / lengths_m
            step = (hits.distance + offset)[:, None]
            continues = is_hole & (step[:, 0] < 1)
            rays = rays[continues]
            starts_m = (starts_m + step * segments_m)[continues]
            segments_m = (segments_m * (1 - step))[continues]
        return np.concatenate(blocked)


def _cone(directions: Array) -> tuple[Array, float]:
    """The axis (3,) of a cone around unit directions (R, 3), and half of its opening angle with a margin, in rad.

    Directions that are NaN are ignored.
    """
    known = directions[np.isfinite(directions).all(1)]
    axis = unit(known.sum(0))
    least_cosine = float((known @ axis).min(initial=1.0))
    return axis, float(np.arccos(np.clip(least_cosine, -1, 1))) + CONE_MARGIN_RAD


def _bounding_sphere(points_m: Array) -> tuple[Array, float]:
    """The centre (3,) and the radius, with a margin, of a sphere around points (N, 3), of which there may be none."""
    centre_m = np.zeros(3)
    if len(points_m):
        centre_m = (points_m.min(0) + points_m.max(0)) / 2
    distances_m = np.linalg.norm(points_m - centre_m, axis=1)
    return centre_m, float(distances_m.max(initial=0.0)) + RAY_OFFSET_M
