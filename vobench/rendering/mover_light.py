"""The light around moving bodies: the shadows that they cast, and the light that they receive."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.emitter import Emitter
from vobench.rendering.face_response import response
from vobench.rendering.geometry import SHORT_OF_END, BoundingSphere, are_panes, bounding_sphere, tangents
from vobench.rendering.indirect_light import Gatherer
from vobench.rendering.light_emitter import emitters
from vobench.rendering.moving_body import MovingBody, moving_bodies
from vobench.rendering.sampled_emitter import (
    OPEN_SKY_SAMPLES,
    EmitterSamples,
    SampledEmitter,
    joined_samples,
    sampled_emitters,
)
from vobench.rendering.static_scene import bodies
from vobench.rendering.texel import Texels
from vobench.rendering.texel_owner import Owners
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, PointLight, Sky, SpotLight, Sun

MOST_MAPS = 512  # the largest number of shadow maps of one emitter: samples times bodies
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
    spheres = []
    for body, corners_m in zip(bodies, occluders_m, strict=True):
        spheres += [bounding_sphere(corners_m[body.part == part]) for part in np.unique(body.part)]
    centres_m = np.array([sphere.centre_m for sphere in spheres]).reshape(-1, 3)
    radii_m = np.array([sphere.radius_m for sphere in spheres])
    return BoundingSphere(centres_m, radii_m)


class MoverLight:
    """Computes the light that movers block and receive in a baked scene.

    `bodies` are the moving bodies.
    `texels` (P,) are the indices of the texels of the light map that lie on movers.
    """

    def __init__(self, baked: BakedScene, owner: Owners) -> None:
        faces = baked.faces
        materials = baked.scene.materials
        self._scene = baked.scene
        self._emitters: list[SampledEmitter] = []
        self._emitters_key: tuple[float, ...] | None = None
        is_solid = (faces.mover >= 0) & ~are_panes(faces, materials)
        self.bodies = moving_bodies(baked.scene.movers, faces, is_solid)

        # The radiosity of surfels with one column for each channel of each light (S, 3 L), for one matrix product.
        surfel_count = len(baked.patches.area_m2)
        by_surfel = baked.patches.radiosity.transpose(1, 0, 2)
        self._radiosity = np.ascontiguousarray(by_surfel).reshape(surfel_count, -1)
        self._rays = GATHER_RAYS if baked.settings.bounces else 0
        self._visibility = Visibility(faces, materials, np.flatnonzero(faces.mover < 0))
        self._gatherer = Gatherer(
            baked.atlas,
            self._visibility,
            response(faces, materials, self._visibility),
            [light for light in baked.scene.lights if isinstance(light, Sky)],
            baked.patches.surfel_of,
            surfels=surfel_count,
            lamps=len(baked.scene.lights),
        )

        # The points on movers, one for each of their texels.
        is_lit = bodies(baked.scene, faces) & (faces.mover >= 0)
        self.texels = np.flatnonzero((owner.face >= 0) & is_lit[owner.face])
        face = owner.face[self.texels]
        uv = owner.uv[self.texels]
        weights = np.column_stack([1 - uv.sum(1), uv])
        self._mover = faces.mover[face]
        self._points_m = np.einsum("ni,nij->nj", weights, faces.corners_m[face])
        self._normals = unit(np.einsum("ni,nij->nj", weights, faces.normals[face]))
        thing_materials = [materials.get(thing.material) for thing in faces.things]
        thing_eta = np.array([kind.eta if kind and kind.is_coated else 0.0 for kind in thing_materials])
        self._eta = thing_eta[faces.thing[face]].astype(np.float32)
        self._probe_place = self._probe_places()

    def _probe_places(self) -> Floats:
        """The coordinate (P,) of each point among the probes of all bodies: i + f lies between probes i and i + 1."""
        T_world_movers = self.poses(0)
        places = np.zeros(len(self._mover), np.float32)
        first_probe = 0
        for body in self.bodies:
            rows = np.flatnonzero(np.isin(self._mover, body.movers))
            T_first_world = se3.inverse(T_world_movers[body.movers[0]])
            T_first_mover = T_first_world @ T_world_movers[self._mover[rows]]
            rotated_m = np.einsum("nij,nj->ni", T_first_mover[:, :3, :3], self._points_m[rows])
            points_m = rotated_m + T_first_mover[:, :3, 3]
            # The coordinate stays below the last probe, so that interpolation never includes the next body.
            largest = max(len(body.probes_m) - 1 - 1e-3, 0)
            places[rows] = first_probe + np.minimum(body.probe_place(points_m), largest)
            first_probe += len(body.probes_m)
        return places

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
        samples = joined_samples(sampled)
        occluders_m = [body.placed(T_world_movers) for body in self.bodies]
        spheres = _part_spheres(self.bodies, occluders_m)
        part_counts = [len(np.unique(body.part)) for body in self.bodies]

        probes_by_body = [se3.apply(T_world_movers[body.movers[0]], body.probes_m) for body in self.bodies]
        probes_m = np.concatenate(probes_by_body)
        arriving = self._arriving(samples, probes_m)
        first_probes = np.cumsum([len(body_probes_m) for body_probes_m in probes_by_body])[:-1]
        body_means = np.array([strengths.mean(0) for strengths in np.split(arriving, first_probes)])  # (B, K)
        maps, map_of = _shadow_maps(samples.places, body_means > 0, occluders_m)

        points_m, normals = self._points_at(T_world_movers)
        return MoverLightAt(
            emitters=sampled,
            occluders_m=occluders_m,
            maps=maps.astype(np.float32),
            map_of=map_of.astype(np.int32),
            spheres=spheres,
            sphere_body=np.repeat(np.arange(len(self.bodies)), part_counts),
            places=samples.places.astype(np.float32),
            axes=samples.axes.astype(np.float32),
            reach=np.concatenate([arriving, body_means]).astype(np.float32),
            cubes=self._indirect_cubes(probes_m),
            points_m=points_m.astype(np.float32),
            normals=normals.astype(np.float32),
            probe_place=self._probe_place,
            eta=self._eta,
            hard=self._hard_illuminance_lx(points_m, normals, suns_ns),
        )

    def _points_at(self, T_world_movers: Array) -> tuple[Array, Array]:
        """The positions and the normals (P, 3) of the points, given the poses (M, 4, 4) of all movers."""
        T_world_mover = T_world_movers[self._mover]
        R = T_world_mover[:, :3, :3]
        rotated_m = np.einsum("nij,nj->ni", R, self._points_m)
        points_m = rotated_m + T_world_mover[:, :3, 3]
        return points_m, np.einsum("nij,nj->ni", R, self._normals)

    def sky_shares(self, sampled: Sequence[SampledEmitter], places_m: Floats, normals: Floats) -> Floats:
        """The share (P, E) of the sky's direct light at points (P, 3) that comes from each emitter.

        It is estimated with SHARE_SAMPLES rays per emitter. It is 1 for the emitters of other lights.
        """
        light = np.array([emitter.light for emitter in sampled], int)
        is_sky = np.array([isinstance(self._scene.lights[index], Sky) for index in light], bool)
        shares = np.ones((len(places_m), len(sampled)), np.float32)
        for column, emitter in enumerate(sampled):
            if is_sky[column]:
                shares[:, column] = self._estimated_lx(emitter, places_m, normals)

        # The shares of each sky are divided by their sum.
        for sky in np.unique(light[is_sky]):
            columns = np.flatnonzero(light == sky)
            total = shares[:, columns].sum(1, keepdims=True)
            shares[:, columns] /= np.maximum(total, 1e-30)
        return shares

    def _estimated_lx(self, emitter: SampledEmitter, places_m: Floats, normals: Floats) -> Floats:
        """The illuminance (P,) of points by an emitter of the sky, estimated from SHARE_SAMPLES of its samples."""
        sample_count = len(emitter.places)
        total_lx = np.zeros(len(places_m), np.float32)
        for sample in np.linspace(0, sample_count - 1, SHARE_SAMPLES).astype(int):
            total_lx += self._sample_lx(emitter, sample, places_m, normals)
        return total_lx * np.float32(sample_count / SHARE_SAMPLES)

    def _sample_lx(self, emitter: SampledEmitter, sample: int, places_m: Floats, normals: Floats) -> Floats:
        """The illuminance (P,) of points by one sample of the sky; 0 where the sample is occluded."""
        place = emitter.places[sample]
        axis = emitter.axes[sample, :3]
        is_on_pane = place[3] > 0
        vectors_m = place[:3] - place[3] * places_m
        distance_m = np.linalg.norm(vectors_m, axis=1)
        directions = vectors_m / distance_m[:, None]
        cosine = np.einsum("ij,ij->i", directions, normals)
        light_lx = emitter.strength[sample] * np.maximum(cosine, 0)
        if is_on_pane:
            light_lx = light_lx * np.abs(directions @ axis) / distance_m**2

        rows = np.flatnonzero(light_lx > 0)
        origins_m = (places_m + LIFT_M * normals)[rows].astype(np.float32)
        segments_m = (FAR_M * directions[rows]).astype(np.float32)
        is_visible = self._visibility.is_unoccluded(origins_m, segments_m)
        if not is_on_pane:
            is_visible = is_visible & ~self._visibility.crosses_sky_pane(origins_m, segments_m)
        light_lx[rows] *= is_visible
        return np.asarray(light_lx, np.float32)

    def _arriving(self, samples: EmitterSamples, probes_m: Array) -> Array:
        """The strength (N, K) of all samples that arrives at probes (N, 3).

        Stationary faces reduce it. For hard emitters, the strength is that without occlusion.
        """
        strength: Array = np.tile(samples.strength, (len(probes_m), 1))
        soft = np.flatnonzero(~samples.is_hard)
        if len(soft):
            light = samples.light[soft]
            is_open_sky = samples.is_open_sky[soft]
            places = samples.places[soft]
            vectors_m = places[:, :3] - places[:, 3:] * probes_m[:, None]  # (N, K, 3)
            strength[:, soft] *= self._pane_luminance_cd_m2(light, is_open_sky, vectors_m)
            strength[:, soft] *= self._transmission(light, is_open_sky, probes_m, vectors_m)
        return strength

    def _pane_luminance_cd_m2(self, light_of: Rows, is_open_sky: Mask, vectors_m: Array) -> Array:
        """The luminance of the sky along vectors (N, K, 3) to samples of panes; 1 for samples of other emitters."""
        directions = unit(vectors_m)
        luminance_cd_m2 = np.ones(vectors_m.shape[:2])
        for index, light in enumerate(self._scene.lights):
            panes = np.flatnonzero((light_of == index) & ~is_open_sky)
            if isinstance(light, Sky) and len(panes):
                seen_cd_m2 = light.luminance_cd_m2(directions[:, panes].reshape(-1, 3))
                luminance_cd_m2[:, panes] = seen_cd_m2.reshape(-1, len(panes))
        return luminance_cd_m2

    def _transmission(self, light_of: Rows, is_open_sky: Mask, probes_m: Array, vectors_m: Array) -> Floats:
        """The share (N, K) of light that stationary faces transmit along vectors (N, K, 3) from probes to samples.

        The rays of all emitters are traced at once, because each call costs more than the rays of one emitter.
        """
        is_sky = np.array([isinstance(light, Sky) for light in self._scene.lights])[light_of]
        segments_m = np.where(is_sky[:, None], FAR_M * unit(vectors_m), SHORT_OF_END * vectors_m).astype(np.float32)
        origins_m = np.broadcast_to(probes_m[:, None], segments_m.shape).astype(np.float32)
        flat_transmittance = self._visibility.transmittance(origins_m.reshape(-1, 3), segments_m.reshape(-1, 3))
        transmission = flat_transmittance.reshape(segments_m.shape[:2])

        # Light through a pane already belongs to the emitter of this pane.
        open_sky = np.flatnonzero(is_open_sky)
        if len(open_sky):
            sky_origins_m = origins_m[:, open_sky].reshape(-1, 3)
            sky_segments_m = segments_m[:, open_sky].reshape(-1, 3)
            crosses_pane = self._visibility.crosses_sky_pane(sky_origins_m, sky_segments_m)
            transmission[:, open_sky] *= ~crosses_pane.reshape(-1, len(open_sky))
        return transmission

    def _indirect_cubes(self, probes_m: Array) -> Floats:
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

    def _hard_illuminance_lx(self, points_m: Array, normals: Array, suns_ns: Sequence[float]) -> Floats:
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
        light_lx[rows] *= emitter.transmittance(self._visibility, points.points_m[rows], vectors_m[rows])
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


def _shadow_maps(places: Array, is_reaching: Mask, occluders_m: Sequence[Array]) -> tuple[Array, Indices]:
    """The matrices (M, 3, 4) of the shadow maps of all bodies, and the map (B, K) of each body and sample, -1 for none.

    A body has a map for each sample whose light reaches it (B, K). The maps of a body are adjacent.
    """
    numbers = np.cumsum(is_reaching).reshape(is_reaching.shape) - 1
    map_of = np.where(is_reaching, numbers, -1)
    matrices = []
    for rows, corners_m in zip(is_reaching, occluders_m, strict=True):
        matrices.append(shadow_matrices(places[rows], bounding_sphere(corners_m)))
    return np.concatenate(matrices), map_of


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
