"""The light around moving bodies: occluders that cast their shadows, samples of emitters, and light probes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
import scipy

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.emitter import Emitter
from vobench.rendering.face_response import response
from vobench.rendering.geometry import BoundingSphere, are_panes, sample_points, tangents
from vobench.rendering.indirect_light import Gatherer
from vobench.rendering.light_emitter import emitters
from vobench.rendering.solid_angle import rectangle
from vobench.rendering.static_scene import bodies
from vobench.rendering.texel import Texels
from vobench.rendering.texel_owner import Owners
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.mesh import face_corners
from vobench.scene.scene import Mover
from vobench.scene.triangles import Triangles
from vobench.scene.weld import distinct_rows

HULL_DIRECTIONS = 20  # the number of directions in which the outermost vertex of a shape is found
SMALL = 1 / 32  # a thing casts no shadow if its size relative to that of the body is smaller
HULL_FILLED = 1.4  # the ratio of the volumes of hull and shape above which the hull does not represent the shape
CELL = 1 / 24  # the size of a grid cell, relative to that of the shape, in which vertices are merged


def occluder(corners_m: Array) -> Array:
    """A few triangles (K, 3, 3) with nearly the same silhouettes as the faces (F, 3, 3) of a thing.

    They are the convex hull of the outermost vertices. If the hull is much larger than the shape, vertices that are
    close together are merged instead.
    """
    points_m = np.unique(corners_m.reshape(-1, 3), axis=0)
    outermost = np.unique((_spiral(HULL_DIRECTIONS) @ points_m.T).argmax(1))
    try:
        hull = scipy.spatial.ConvexHull(points_m[outermost])
    except (scipy.spatial.QhullError, ValueError):  # flat, or fewer than four points
        return _merged(corners_m)
    a, b, c = np.moveaxis(corners_m, 1, 0)
    volume_m3 = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    if hull.volume > HULL_FILLED * volume_m3:
        return _merged(corners_m)
    return np.asarray(points_m[outermost][hull.simplices])


def _merged(corners_m: Array) -> Array:
    """Triangles (K, 3, 3) with all vertices in a grid cell merged at their mean, without those that have no area."""
    points_m = corners_m.reshape(-1, 3)
    cell_m = max(float(np.ptp(points_m, axis=0).max()) * CELL, 1e-6)
    cell = distinct_rows(np.rint(points_m / cell_m).astype(np.int64)).inverse
    count = np.bincount(cell)
    sums_m = np.stack([np.bincount(cell, column) for column in points_m.T], -1)
    merged_m = (sums_m / count[:, None])[cell].reshape(-1, 3, 3)
    return np.asarray(merged_m[areas_m2(merged_m) > 0])


def _spiral(count: int) -> Array:
    """Unit vectors (count, 3), evenly distributed on the sphere. Source: González (2010), the Fibonacci lattice."""
    steps = np.arange(count) + 0.5
    height = 1 - 2 * steps / count
    angle = np.pi * (1 + np.sqrt(5)) * steps
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], -1)


PROBES_M = 0.5  # the distance between the probes of a body
MOST_PROBES = 6  # the largest number of probes of a body


@dataclass(frozen=True, slots=True)
class MovingBody:
    """Movers with the same name: a single thing, or all limbs of a person.

    `movers` are the indices of the movers in the scene.
    `corners_m` (K, 3, 3) are the triangles that cast the body's shadow, each in the frame of its mover.
    `mover` (K,) is the index of each triangle's mover.
    `probes_m` (N, 3) are the positions of the light probes along the body, in the frame of its first mover.
    `part` (K,) is the index of the probe that is nearest to each triangle at the start.
    """

    movers: tuple[int, ...]
    corners_m: Array
    mover: Rows
    probes_m: Array
    part: Rows

    def placed(self, T_world_movers: Array) -> Array:
        """The triangles (K, 3, 3) in the world frame, given the poses (M, 4, 4) of all movers."""
        T = T_world_movers[self.mover]
        rotated_m = np.einsum("kij,kcj->kci", T[:, :3, :3], self.corners_m)
        return np.asarray(rotated_m + T[:, None, :3, 3])

    def probe_place(self, points_m: Array) -> Array:
        """The coordinate (P,) of points (P, 3) along the row of probes: 0 at the first probe, 1 at the second one.

        The points are given in the frame of the first mover.
        """
        last = len(self.probes_m) - 1
        if not last:
            return np.zeros(len(points_m))
        axis_m = self.probes_m[-1] - self.probes_m[0]
        fraction = (points_m - self.probes_m[0]) @ axis_m / (axis_m @ axis_m)
        return np.asarray(last * np.clip(fraction, 0, 1))


def moving_bodies(scene_movers: Sequence[Mover], faces: Triangles, is_solid: Mask) -> list[MovingBody]:
    """The bodies that the movers of a scene form; consecutive movers with the same name are one body.

    `is_solid` (F,) selects the faces that can cast shadows. Movers without such faces form no body.
    """
    result = []
    for _, members in groupby(range(len(scene_movers)), key=lambda index: scene_movers[index].name):
        movers = tuple(members)
        body_rows = np.flatnonzero(is_solid & np.isin(faces.mover, movers))
        small_m = SMALL * _size_m(faces.corners_m[body_rows])
        shapes_m = []
        shape_movers = []
        for mover in movers:
            rows = np.flatnonzero(is_solid & (faces.mover == mover))
            for thing in np.unique(faces.thing[rows]):
                thing_m = faces.corners_m[rows[faces.thing[rows] == thing]]
                if _size_m(thing_m) < small_m:
                    continue
                shape_m = occluder(thing_m)
                shapes_m.append(shape_m)
                shape_movers.append(np.full(len(shape_m), mover))
        if not shapes_m:
            continue
        no_part = np.zeros(0, np.int64)
        body = MovingBody(movers, np.concatenate(shapes_m), np.concatenate(shape_movers), np.zeros((1, 3)), no_part)
        T_world_movers = np.array([mover.path.pose(0) for mover in scene_movers])
        T_first_world = se3.inverse(T_world_movers[movers[0]])
        points_m = se3.apply(T_first_world, body.placed(T_world_movers).reshape(-1, 3))
        body = replace(body, probes_m=_probes_m(points_m))
        middles_m = points_m.reshape(-1, 3, 3).mean(1)
        result.append(replace(body, part=np.rint(body.probe_place(middles_m)).astype(np.int64)))
    return result


def _size_m(corners_m: Array) -> float:
    """The longest side of the bounding box of faces (K, 3, 3); 0 without faces."""
    if not len(corners_m):
        return 0.0
    return float(np.ptp(corners_m.reshape(-1, 3), axis=0).max())


def _probes_m(points_m: Array) -> Array:
    """The positions (N, 3) of probes along the longest axis of the bounding box of points (P, 3)."""
    low_m = points_m.min(0)
    size_m = np.ptp(points_m, axis=0)
    longest = int(size_m.argmax())
    count = int(np.clip(np.ceil(size_m[longest] / PROBES_M), 1, MOST_PROBES))
    shares = np.full((count, 3), 0.5)
    shares[:, longest] = (np.arange(count) + 0.5) / count
    return np.asarray(low_m + shares * size_m)


# The number of samples per metre of the radius of a panel and of a pane, and the limits of this number.
PER_RADIUS_M = 14
PANE_PER_RADIUS_M = 5
FEWEST_SAMPLES = 2
PANEL_SAMPLES = 9
OPEN_SKY_SAMPLES = 24
MOST_MAPS = 512  # the largest number of shadow maps of one emitter: samples times bodies
GOLDEN = (0.7548776662, 0.5698402910)  # steps of a low-discrepancy sequence in the unit square: Roberts (2018), R2


@dataclass(frozen=True, slots=True)
class SampledEmitter:
    """An emitter, approximated by K samples.

    `light` is the index of the light that the emitter belongs to.
    `ball` is the bounding sphere of the emitter; its radius is infinite for the open sky.
    `places` (K, 4) are homogeneous: a position and 1, or the direction towards an infinitely distant sample and 0.
    `axes` (K, 4) are the normal of a one-sided emitter and 0, or the normal of a two-sided pane and 1. They are 0 for
    an emitter that radiates equally in all directions.
    `strength` (K,) is the illuminance at normal incidence times the squared distance. It is the area for a pane, since
    the luminance of the sky depends on the direction, and 1 for a hard emitter.
    `is_hard` is whether the emitter casts hard shadows. Its illuminance is then computed at each point instead of at
    the probes.
    """

    light: int
    ball: BoundingSphere
    places: Array
    axes: Array
    strength: Array
    is_hard: bool = False


def sampled_emitters(
    lights: Sequence[Light], visibility: Visibility, suns_ns: Sequence[float], most_samples: int = OPEN_SKY_SAMPLES
) -> list[SampledEmitter]:
    """The emitters of all lights, in the order of the lights. Each has at most `most_samples` samples.

    `suns_ns` (L,) is the time at which the direction of a moving sun is evaluated.
    """
    result = []
    for index, light in enumerate(lights):
        match light:
            case AreaLight():
                result.append(_sampled_panel(index, light))
            case PointLight() | SpotLight():
                place = np.array([[*light.position_m, 1.0]])
                ball = BoundingSphere(light.position_m, 0.0)
                result.append(SampledEmitter(index, ball, place, np.zeros((1, 4)), np.ones(1), is_hard=True))
            case Sun():
                direction = light.direction(suns_ns[index])
                [emitter] = emitters(light, visibility, t_ns=suns_ns[index])
                place = np.array([[*direction, 0.0]])
                result.append(SampledEmitter(index, emitter.ball, place, np.zeros((1, 4)), np.ones(1), is_hard=True))
            case Sky():
                result += _sampled_sky(index, light, visibility)
    return [_with_fewer(emitter, most_samples) for emitter in result]


def _with_fewer(emitter: SampledEmitter, most: int) -> SampledEmitter:
    """The emitter with at most `most` of its samples; the strengths are scaled to compensate for the others."""
    count = len(emitter.places)
    if count <= most:
        return emitter
    rows = np.linspace(0, count - 1, most).astype(int)
    return replace(
        emitter, places=emitter.places[rows], axes=emitter.axes[rows], strength=emitter.strength[rows] * count / most
    )


def _spread(corners_m: Array, count: int) -> Array:
    """About `count` points (K, 3) that are distributed over triangles. Their mean is the centroid of the triangles.

    On a rectangle, they are the centres of nearly square cells.
    """
    face = rectangle(corners_m)
    if face is not None:
        width_m = np.linalg.norm(face.edge_u_m)
        length_m = np.linalg.norm(face.edge_v_m)
        columns = int(np.clip(np.rint(np.sqrt(count * width_m / length_m)), 1, count))
        rows = max(1, count // columns)
        u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
        return np.asarray(face.corner_m + u.reshape(-1, 1) * face.edge_u_m + v.reshape(-1, 1) * face.edge_v_m)
    steps = np.arange(count)[:, None] * GOLDEN + 0.5
    a, b = (steps % 1).T
    points_m = sample_points(corners_m, a, b)
    area_m2 = areas_m2(corners_m)
    centroid_m = area_m2 @ corners_m.mean(1) / area_m2.sum()
    return np.asarray(points_m + centroid_m - points_m.mean(0))


def _sample_count(wanted: float) -> int:
    """The number of samples that is nearest to `wanted` within the limits."""
    return int(np.clip(np.rint(wanted), FEWEST_SAMPLES, PANEL_SAMPLES))


def _ball(corners_m: Array) -> BoundingSphere:
    """The smallest sphere around the centre of the bounding box that contains all corners."""
    points_m = corners_m.reshape(-1, 3)
    centre_m = (points_m.min(0) + points_m.max(0)) / 2
    return BoundingSphere(centre_m, float(np.linalg.norm(points_m - centre_m, axis=1).max()))


def _sampled_panel(index: int, light: AreaLight) -> SampledEmitter:
    """An area light as an emitter; each sample has the normal of the nearest face."""
    corners_m = face_corners(light.mesh)
    ball = _ball(corners_m)
    points_m = _spread(corners_m, _sample_count(PER_RADIUS_M * ball.radius_m))
    count = len(points_m)
    middles_m = corners_m.mean(1)
    nearest = np.linalg.norm(points_m[:, None] - middles_m, axis=2).argmin(1)
    axes = np.column_stack([face_normals(corners_m)[nearest], np.zeros(count)])
    strength = np.full(count, light.luminance_cd_m2 * areas_m2(corners_m).sum() / count)
    return SampledEmitter(index, ball, np.column_stack([points_m, np.ones(count)]), axes, strength)


def _sampled_sky(index: int, light: Sky, visibility: Visibility) -> list[SampledEmitter]:
    """The emitters of a sky: one for each pane through which it is visible, and one for the open sky."""
    result = []
    for pane in visibility.sky_panes:
        ball = _ball(pane.corners_m)
        points_m = _spread(pane.corners_m, _sample_count(PANE_PER_RADIUS_M * ball.radius_m))
        count = len(points_m)
        places = np.column_stack([points_m, np.ones(count)])
        strength = np.full(count, areas_m2(pane.corners_m).sum() / count)
        result.append(SampledEmitter(index, ball, places, np.tile([*pane.normal, 1.0], (count, 1)), strength))
    directions = _spiral(2 * OPEN_SKY_SAMPLES)[:OPEN_SKY_SAMPLES]
    places = np.column_stack([directions, np.zeros(OPEN_SKY_SAMPLES)])
    strength = 2 * np.pi / OPEN_SKY_SAMPLES * light.luminance_cd_m2(directions)
    everywhere = BoundingSphere(np.zeros(3), np.inf)
    return [*result, SampledEmitter(index, everywhere, places, np.zeros((OPEN_SKY_SAMPLES, 4)), strength)]


MARGIN = 1.08  # the radius that a shadow map covers, relative to that of the body, so that its border is empty
WIDEST = 0.95  # the largest sine of half the field of view of a shadow map
GATHER_RAYS = 36  # the number of rays from each face of a probe's cube
AXES = np.concatenate([np.eye(3), -np.eye(3)])  # the normals of the faces of a probe's cube
FAR_M = 1e3  # the length of a ray to the sky
SHARE_SAMPLES = 4  # the number of samples of an emitter from which its share of the sky's light is estimated
LIFT_M = 1e-3  # the distance of the origin of a ray from its surface


@dataclass(frozen=True, slots=True)
class MoverLightAt:
    """The movers at one instant and the light around them, as the input of the kernels in `mover_kernels`.

    There are B bodies with N probes in total, K samples of all emitters, M shadow maps, and P points on movers.

    `occluders_m` are the triangles (T, 3, 3) that cast the shadow of each body, in the world frame.
    `maps` (M, 3, 4) are the matrices of the shadow maps; see `shadow_matrices`. A body has a map for each sample whose
    light reaches it. The maps of a body are adjacent.
    `map_of` (B, K) is the index of the map for each body and sample, -1 if there is none.
    `spheres` are S bounding spheres of parts of the bodies; `sphere_body` (S,) is the index of each sphere's body.
    `places` and `axes` (K, 4) are those of each sample.
    `reach` (N + B, K) is the strength of each sample that arrives at each probe, followed by the mean over the probes
    of each body.
    `cubes` (N, 6, L, 3) are the indirect illuminances at each probe on faces with the normals AXES, for each light at
    level 1.
    `points_m` and `normals` (P, 3) are the positions and normals of the points.
    `probe_place` (P,) is the coordinate of each point among the probes, `eta` (P,) the refractive index of its coat.
    `hard` (H, P) is the illuminance by each hard emitter, without the shadows of movers.
    """

    emitters: Sequence[SampledEmitter]
    occluders_m: Sequence[Array]
    maps: Floats
    map_of: Indices
    spheres: BoundingSphere
    sphere_body: Rows
    places: Floats
    axes: Floats
    reach: Floats
    cubes: Floats
    points_m: Floats
    normals: Floats
    probe_place: Floats
    eta: Floats
    hard: Floats

    def sample_range(self, emitter: int) -> tuple[int, int]:
        """The index of the first sample of an emitter, and the number of its samples."""
        earlier_counts = [len(other.places) for other in self.emitters[:emitter]]
        return sum(earlier_counts), len(self.emitters[emitter].places)

    def gathered(self, colours: Floats) -> Floats:
        """The indirect illuminance (P, 3) of the points, for lights with colours (L, 3).

        The cubes of the two nearest probes are interpolated, and the faces are weighted by the squared normal.
        """
        cubes = np.einsum("nslc,lc->nsc", self.cubes, colours)
        probe = self.probe_place.astype(np.int64)
        fraction = (self.probe_place - probe)[:, None]
        next_probe = np.minimum(probe + 1, len(cubes) - 1)
        total = np.zeros((len(self.normals), 3), np.float32)
        for axis in range(3):
            side = np.where(self.normals[:, axis] < 0, axis + 3, axis)
            light = (1 - fraction) * cubes[probe, side] + fraction * cubes[next_probe, side]
            total += self.normals[:, axis, None] ** 2 * light
        return total


def _part_spheres(bodies: Sequence[MovingBody], occluders_m: Sequence[Array]) -> BoundingSphere:
    """The bounding spheres (S,) of the parts of all bodies."""
    balls = []
    for body, corners_m in zip(bodies, occluders_m, strict=True):
        balls += [_ball(corners_m[body.part == part]) for part in np.unique(body.part)]
    centres_m = np.array([ball.centre_m for ball in balls]).reshape(-1, 3)
    return BoundingSphere(centres_m, np.array([ball.radius_m for ball in balls]))


class MoverLight:
    """Computes the light that movers block and receive in a baked scene.

    `bodies` are the moving bodies.
    `texels` (P,) are the indices of the texels of the light map that lie on movers.
    """

    def __init__(self, baked: BakedScene, owner: Owners) -> None:
        faces = baked.faces
        materials = baked.scene.materials
        self._scene = baked.scene
        # All lights beside one another (S, 3 L), so that one product serves them all.
        surfel_count = len(baked.patches.area_m2)
        by_surfel = baked.patches.radiosity.transpose(1, 0, 2)
        self._radiosity = np.ascontiguousarray(by_surfel).reshape(surfel_count, -1)
        self._rays = GATHER_RAYS if baked.settings.bounces else 0
        self._emitters: list[SampledEmitter] = []
        self._emitters_key: tuple[float, ...] | None = None
        is_solid = (faces.mover >= 0) & ~are_panes(faces, materials)
        self.bodies = moving_bodies(baked.scene.movers, faces, is_solid)
        self._visibility = Visibility(faces, materials, np.flatnonzero(faces.mover < 0))
        self._gatherer = Gatherer(
            baked.atlas,
            self._visibility,
            response(faces, materials, self._visibility),
            [light for light in baked.scene.lights if isinstance(light, Sky)],
            baked.patches.surfel_of,
            len(baked.patches.area_m2),
            len(baked.scene.lights),
        )

        is_lit = bodies(baked.scene, faces) & (faces.mover >= 0)
        self.texels = np.flatnonzero((owner.face >= 0) & is_lit[owner.face])
        face = owner.face[self.texels]
        uv = owner.uv[self.texels]
        weights = np.column_stack([1 - uv.sum(1), uv])
        self._mover = faces.mover[face]
        self._points_m = np.einsum("ni,nij->nj", weights, faces.corners_m[face])
        self._normals = unit(np.einsum("ni,nij->nj", weights, faces.normals[face]))
        kinds = [materials.get(thing.material) for thing in faces.things]
        etas = np.array([kind.eta if kind and kind.is_coated else 0.0 for kind in kinds])
        self._eta = etas[faces.thing[face]].astype(np.float32)
        self._probe_place = self._probe_places()

    def _probe_places(self) -> Floats:
        """The coordinate (P,) of each point among the probes of all bodies: i + f lies between probes i and i + 1."""
        T_world_movers = self.poses(0)
        first = 0
        result = np.zeros(len(self._mover), np.float32)
        for body in self.bodies:
            rows = np.flatnonzero(np.isin(self._mover, body.movers))
            T_first_world = se3.inverse(T_world_movers[body.movers[0]])
            T = T_first_world @ T_world_movers[self._mover[rows]]
            points_m = np.einsum("nij,nj->ni", T[:, :3, :3], self._points_m[rows]) + T[:, :3, 3]
            # The coordinate stays below the last probe, so that interpolation never includes the next body.
            last = len(body.probes_m) - 1
            result[rows] = first + np.minimum(body.probe_place(points_m), max(last - 1e-3, 0))
            first += len(body.probes_m)
        return result

    def poses(self, t_ns: float) -> Array:
        """The poses T_world_mover (M, 4, 4) of all movers at a time."""
        return np.array([mover.path.pose(t_ns) for mover in self._scene.movers])

    def emitters(self, suns_ns: Sequence[float]) -> list[SampledEmitter]:
        """The emitters of all lights. With many bodies they have fewer samples, so that there are fewer shadow maps.

        `suns_ns` (L,) is the time at which the direction of a moving sun is evaluated. The emitters of the last call
        are returned again if no time has changed.
        """
        key = tuple(suns_ns)
        if key != self._emitters_key:
            most = min(max(MOST_MAPS // max(len(self.bodies), 1), 1), OPEN_SKY_SAMPLES)
            self._emitters = sampled_emitters(self._scene.lights, self._visibility, suns_ns, most)
            self._emitters_key = key
        return self._emitters

    def at(self, t_ns: float, suns_ns: Sequence[float]) -> MoverLightAt:
        """The movers at a time, and the light around them.

        `suns_ns` (L,) is the time at which the direction of a moving sun is evaluated.
        """
        T_world_movers = self.poses(t_ns)
        sampled = self.emitters(suns_ns)
        places = np.concatenate([np.zeros((0, 4)), *(emitter.places for emitter in sampled)])
        axes = np.concatenate([np.zeros((0, 4)), *(emitter.axes for emitter in sampled)])
        occluders_m = [body.placed(T_world_movers) for body in self.bodies]
        balls = [_ball(corners_m) for corners_m in occluders_m]
        probes_m = [se3.apply(T_world_movers[body.movers[0]], body.probes_m) for body in self.bodies]
        all_probes_m = np.concatenate(probes_m)
        arriving = self._arriving(sampled, all_probes_m)
        probe_counts = [len(body_probes_m) for body_probes_m in probes_m]
        arriving_by_body = np.split(arriving, np.cumsum(probe_counts)[:-1])
        body_means = [part.mean(0) for part in arriving_by_body]

        is_reaching = np.array(body_means) > 0
        map_of = np.where(is_reaching, np.cumsum(is_reaching).reshape(is_reaching.shape) - 1, -1)
        maps = [shadow_matrices(places[rows], ball) for rows, ball in zip(is_reaching, balls, strict=True)]

        spheres = _part_spheres(self.bodies, occluders_m)
        T = T_world_movers[self._mover]
        points_m = np.einsum("nij,nj->ni", T[:, :3, :3], self._points_m) + T[:, :3, 3]
        normals = np.einsum("nij,nj->ni", T[:, :3, :3], self._normals)
        return MoverLightAt(
            emitters=sampled,
            occluders_m=occluders_m,
            maps=np.concatenate(maps).astype(np.float32),
            map_of=map_of.astype(np.int32),
            spheres=spheres,
            sphere_body=np.repeat(np.arange(len(self.bodies)), [len(np.unique(body.part)) for body in self.bodies]),
            places=places.astype(np.float32),
            axes=axes.astype(np.float32),
            reach=np.concatenate([arriving, body_means]).astype(np.float32),
            cubes=self._cubes(all_probes_m),
            points_m=points_m.astype(np.float32),
            normals=normals.astype(np.float32),
            probe_place=self._probe_place,
            eta=self._eta,
            hard=self._hard(points_m, normals, suns_ns),
        )

    def sky_shares(self, sampled: Sequence[SampledEmitter], places_m: Floats, normals: Floats) -> Floats:
        """The share (P, E) of the sky's direct light at points (P, 3) that comes from each emitter.

        It is estimated with SHARE_SAMPLES rays per emitter. It is 1 for the emitters of other lights.
        """
        weights = np.ones((len(places_m), len(sampled)), np.float32)
        is_sky = np.zeros(len(sampled), bool)
        for nth, emitter in enumerate(sampled):
            is_sky[nth] = isinstance(self._scene.lights[emitter.light], Sky)
            if is_sky[nth]:
                selected = np.linspace(0, len(emitter.places) - 1, SHARE_SAMPLES).astype(int)
                weights[:, nth] = 0
                for sample in selected:
                    weights[:, nth] += self._seen(emitter, sample, places_m, normals)
                weights[:, nth] *= len(emitter.places) / SHARE_SAMPLES
        for light in np.unique([emitter.light for emitter in sampled]):
            members = np.array([emitter.light == light for emitter in sampled]) & is_sky
            total = np.maximum(weights[:, members].sum(1, keepdims=True), 1e-30)
            weights[:, members] /= total
        return weights

    def _seen(self, emitter: SampledEmitter, sample: int, places_m: Floats, normals: Floats) -> Floats:
        """The illuminance (P,) of points by one sample of the sky; 0 where the sample is occluded."""
        place = emitter.places[sample]
        axis = emitter.axes[sample, :3]
        vectors_m = place[:3] - place[3] * places_m
        distance_m = np.linalg.norm(vectors_m, axis=1)
        directions = vectors_m / distance_m[:, None]
        light = emitter.strength[sample] * np.maximum(np.einsum("ij,ij->i", directions, normals), 0)
        if place[3]:
            light = light * np.abs(directions @ axis) / distance_m**2
        rows = np.flatnonzero(light > 0)
        origins_m = (places_m + LIFT_M * normals)[rows].astype(np.float32)
        ends_m = (FAR_M * directions[rows]).astype(np.float32)
        passing = self._visibility.clear(origins_m, ends_m)
        if not place[3]:
            passing = passing & ~self._visibility.crosses_sky_pane(origins_m, ends_m)
        light[rows] *= passing
        return np.asarray(light, np.float32)

    def _arriving(self, sampled: Sequence[SampledEmitter], probes_m: Array) -> Array:
        """The strength (N, K) of all samples that arrives at probes (N, 3).

        Stationary faces reduce it. For hard emitters, the strength is that without occlusion.
        """
        if not sampled:
            return np.zeros((len(probes_m), 0))
        counts = [len(emitter.places) for emitter in sampled]
        strengths = np.concatenate([emitter.strength for emitter in sampled])
        result: Array = np.tile(strengths, (len(probes_m), 1))
        soft = np.flatnonzero(np.repeat([not emitter.is_hard for emitter in sampled], counts))
        if not len(soft):
            return result
        places = np.concatenate([emitter.places for emitter in sampled])[soft]
        light_index = np.repeat([emitter.light for emitter in sampled], counts)[soft]
        is_finite = np.repeat([bool(np.isfinite(emitter.ball.radius_m)) for emitter in sampled], counts)[soft]
        is_sky = np.array([isinstance(light, Sky) for light in self._scene.lights])[light_index]

        vectors_m = places[:, :3] - places[:, 3:] * probes_m[:, None]  # (N, K, 3)
        directions = unit(vectors_m)
        arriving = result[:, soft]
        for index, light in enumerate(self._scene.lights):
            by_pane = np.flatnonzero(is_sky & is_finite & (light_index == index))
            if isinstance(light, Sky) and len(by_pane):
                luminance_cd_m2 = light.luminance_cd_m2(directions[:, by_pane].reshape(-1, 3))
                arriving[:, by_pane] *= luminance_cd_m2.reshape(len(probes_m), -1)

        # The rays of all emitters at once, because each call costs more than the rays of one emitter.
        ends_m = np.where(is_sky[:, None], FAR_M * directions, vectors_m * (1 - 1e-3)).astype(np.float32)
        origins_m = np.broadcast_to(probes_m[:, None], ends_m.shape).astype(np.float32)
        passing = self._visibility.passing(origins_m.reshape(-1, 3), ends_m.reshape(-1, 3))
        arriving *= passing.reshape(arriving.shape)
        open_sky = np.flatnonzero(is_sky & ~is_finite)
        if len(open_sky):
            # Light through a pane already belongs to the emitter of this pane.
            crosses_pane = self._visibility.crosses_sky_pane(
                origins_m[:, open_sky].reshape(-1, 3), ends_m[:, open_sky].reshape(-1, 3)
            )
            arriving[:, open_sky] *= ~crosses_pane.reshape(len(probes_m), -1)
        result[:, soft] = arriving
        return result

    def _cubes(self, probes_m: Array) -> Floats:
        """The indirect illuminance (N, 6, L, 3) at probes (N, 3), by the normals AXES and by lights at level 1."""
        normals = np.tile(AXES, (len(probes_m), 1)).astype(np.float32)
        lights = self._scene.lights
        places_m = np.repeat(probes_m, 6, axis=0).astype(np.float32)
        gathered = self._gatherer.gather(_points(places_m, normals), rays=self._rays)
        surfel_count = len(self._radiosity)
        by_surfels = gathered.table[:, :surfel_count] @ self._radiosity
        result = by_surfels.reshape(len(normals), len(lights), 3)
        by_mirrors = gathered.table[:, surfel_count:].toarray()  # (6 N, L)
        sky_row = 0
        for index, light in enumerate(lights):
            if isinstance(light, AreaLight):
                result[:, index] += np.pi * light.luminance_cd_m2 * by_mirrors[:, index, None]
            if isinstance(light, Sky):
                result[:, index] += gathered.sky[sky_row][:, None]
                sky_row += 1
        return np.asarray(result.reshape(len(probes_m), 6, len(lights), 3))

    def _hard(self, points_m: Array, normals: Array, suns_ns: Sequence[float]) -> Floats:
        """The illuminance (H, P) of points by each hard emitter; only stationary faces cast shadows."""
        points = _points(points_m.astype(np.float32), normals.astype(np.float32), self._eta)
        middle = np.full(len(points), 0.5, np.float32)
        rows = []
        for index, light in enumerate(self._scene.lights):
            if isinstance(light, PointLight | SpotLight | Sun):
                [emitter] = emitters(light, self._visibility, t_ns=suns_ns[index])
                rows.append(self._by_one_ray(emitter, points, middle))
        return np.array(rows, np.float32).reshape(len(rows), len(points))

    def _by_one_ray(self, emitter: Emitter, points: Texels, middle: Floats) -> Floats:
        """The illuminance (P,) of points by an emitter, with one shadow ray per point to its centre."""
        vectors_m, strength = emitter.towards(points)(middle, middle)
        cosine = points.cosine(vectors_m)
        light_lx = strength * np.maximum(cosine, 0) * points.entering(cosine)
        rows = np.flatnonzero(light_lx > 0)
        light_lx[rows] *= emitter.passing(self._visibility, points.points_m[rows], vectors_m[rows])
        return np.asarray(light_lx, np.float32)


def _points(points_m: Floats, normals: Floats, eta: Floats | None = None) -> Texels:
    """Points (P, 3) with normals in the form of texels that are not part of the light map."""
    count = len(points_m)
    no_index = np.zeros(count, np.int64)
    dither = np.random.default_rng(0).random((count, 2), dtype=np.float32)
    no_step = np.zeros((count, 3), np.float32)
    coat_eta = np.zeros(count, np.float32) if eta is None else eta
    no_uv = np.zeros((count, 2), np.float32)
    no_face = no_index.astype(np.int32)
    return Texels(points_m, normals, normals, no_step, no_step, no_index, no_face, no_uv, coat_eta, dither)


def shadow_matrices(places: Array, ball: BoundingSphere) -> Array:
    """The matrices (K, 3, 4) of the shadow maps that show a ball from samples (K, 4), applied to points in the world.

    The first two coordinates range from -1 to 1 across the map. For a sample with a position, they are multiplied by
    the third coordinate, which is the depth in metres. For a sample with a direction, the third coordinate increases
    through the ball from 0 to 1 towards the light.
    """
    has_position = places[:, 3] > 0
    radius_m = MARGIN * ball.radius_m
    to_ball_m = ball.centre_m - places[:, :3]
    distance_m = np.maximum(np.linalg.norm(to_ball_m, axis=1), 1e-6)
    ahead = np.where(has_position[:, None], to_ball_m / distance_m[:, None], -places[:, :3])
    u_axis, v_axis = tangents(ahead)
    sine = np.minimum(radius_m / distance_m, WIDEST)
    scale = np.where(has_position, np.sqrt(1 - sine**2) / sine, 1 / radius_m)[:, None]
    origin_m = np.where(has_position[:, None], places[:, :3], ball.centre_m)
    along = np.where(has_position[:, None], ahead, -ahead / (2 * radius_m))

    rows = np.stack([scale * u_axis, scale * v_axis, along], 1)  # (K, 3, 3)
    offsets = -np.einsum("kij,kj->ki", rows, origin_m)
    offsets[~has_position, 2] += 0.5
    return np.concatenate([rows, offsets[..., None]], 2)
