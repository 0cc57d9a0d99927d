"""Baking: the light that each lamp of a scene alone gives every surface, directly and by bounces."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vobench import stop
from vobench.rendering import freed_memory
from vobench.rendering.albedo import albedo
from vobench.rendering.array_types import Floats, Indices
from vobench.rendering.atlas import Atlas
from vobench.rendering.baked_scene import INDIRECT_RAYS, BakedScene, BakeSettings, Patches, SunTrack
from vobench.rendering.bounce import bounced
from vobench.rendering.direct_light import direct_light
from vobench.rendering.face_response import response
from vobench.rendering.gathering import Rounds, Smoothing
from vobench.rendering.indirect_light import MOST_RAYS, Gatherer
from vobench.rendering.key_time import key_times_ns, moving_suns
from vobench.rendering.light_emitter import emitters
from vobench.rendering.mirror_image import mirror_images
from vobench.rendering.photons import Reflectors
from vobench.rendering.static_scene import StaticScene, bodies, sampled_faces, static_points
from vobench.rendering.surfel import Surfels, stratified_middles, surfels
from vobench.rendering.surfel_blend import blend
from vobench.rendering.texel import Texels
from vobench.rendering.unwrap import unwrap
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Sky
from vobench.scene.material import LUMINANCE
from vobench.scene.scene import Scene
from vobench.scene.triangles import Triangles

Report = Callable[[float], object]
Instant = tuple[int, float]  # the index of a light, and a time in ns

# The approximate shares of the work of a bake that are done after its first stages.
PLACED_DONE = 0.1
GATHER_DONE = 0.4

CELL_TEXELS = 2.5  # the smallest side of a surfel, in distances between samples
SKY_RAYS = 64  # the smallest number of rays from a surfel if the scene has a sky
BLIND = 0.02  # a surfel is inside something if a smaller share of its rays hits a surfel or escapes
UNSEEN = 1e-3  # the weight of a point in its surfel if no ray has hit it; otherwise it is the number of hits


def bake(
    scene: Scene,
    settings: BakeSettings,
    report: Report = lambda _: None,
) -> BakedScene:
    """Compute the light of a scene. Equal arguments give equal bytes.

    `report` is called repeatedly with the approximate share of the work that is done.
    """
    _generate_textures(scene)
    freed_memory.give_back()
    parts, faces, spacing_m = sampled_faces(scene, settings)
    atlas = unwrap(faces, spacing_m, bodies(scene, faces))
    visibility, points, layout, point_areas_m2 = static_points(scene, faces, atlas, settings.seed)
    freed_memory.give_back()
    cell_m = CELL_TEXELS * spacing_m[points.face]
    step_m = np.maximum(settings.indirect_spacing_m, cell_m).astype(np.float32)
    groups = surfels(points, faces.thing[points.face], step_m, visibility)
    surfel_of = np.append(groups.of, np.int32(-1))[layout.source]
    area_m2 = np.bincount(groups.of, point_areas_m2, len(groups))
    report(PLACED_DONE)

    # Rays from surfels find which others they see.
    gatherer = _gatherer(scene, faces, atlas, visibility, surfel_of=surfel_of, surfel_count=len(groups))
    rounds = _first_round(gatherer, points, groups, settings, report)
    is_usable = rounds.met() + rounds.escaped > BLIND
    spread = blend(points, groups, layout, visibility, is_usable)
    smoothing = Smoothing(spread[points.index[groups.middle]])

    # Direct light, and the light that mirroring faces pass on.
    # Where the sky is seen through a small opening only, the rays of some surfels miss it.
    escaped_around = smoothing.averaged(rounds.escaped[:, None])[:, 0]
    open_sky = (spread @ escaped_around)[points.index] > 0
    static = StaticScene(faces, visibility, atlas, points, layout, groups.of, open_sky)
    instants = [(index, t_ns) for index, light in enumerate(scene.lights) for t_ns in key_times_ns(light)]
    reflectors = Reflectors(gatherer, points, point_areas_m2, settings.seed)
    mirrored = _MirroredLight(scene, settings, reflectors, smoothing, instants=instants, area_m2=area_m2)
    # The points of a surfel are weighted by the rays that hit them, so that points hidden under a rug hardly count.
    point_hits = np.bincount(layout.source, rounds.hits, len(points) + 1)
    weights = point_hits[: len(points)] + UNSEEN
    first_light = _first_light(
        scene, settings, static, groups, weights, area_m2=area_m2, instants=instants, mirrored=mirrored, report=report
    )
    del static, points, layout, reflectors, mirrored  # bounces take memory of their own
    freed_memory.give_back()

    indirect, noise = _bounces(scene, settings, rounds, smoothing, first_light=first_light, instants=instants)
    first = [instants.index((index, key_times_ns(light)[0])) for index, light in enumerate(scene.lights)]
    patches = Patches(
        surfel_of=surfel_of,
        reflectance=first_light.reflectance,
        area_m2=area_m2,
        radiosity=first_light.radiosity[first] + first_light.reflectance * indirect[first],
    )
    return BakedScene(
        scene=scene,
        parts=parts,
        faces=faces,
        atlas=atlas,
        direct=first_light.direct,
        bounced=indirect[first],
        spread=spread,
        patches=patches,
        settings=settings,
        tracks=_tracks(instants, indirect, scene),
        light_noise=_root_mean_square(noise, area_m2),
    )


def _generate_textures(scene: Scene) -> None:
    """Generate the textures and panoramas of a scene, which are cached, while nothing else takes memory."""
    names = {thing.material for thing in scene.things} & scene.materials.keys()
    for name in sorted(names):
        texture = scene.materials[name].texture
        if texture is not None:
            texture.pixels()
    for light in scene.lights:
        if isinstance(light, Sky) and light.panorama is not None:
            light.panorama.map_under(light)


def _gatherer(
    scene: Scene,
    faces: Triangles,
    atlas: Atlas,
    visibility: Visibility,
    *,
    surfel_of: Indices,
    surfel_count: int,
) -> Gatherer:
    """The gatherer of a scene's indirect light."""
    return Gatherer(
        atlas,
        visibility,
        response(faces, scene.materials, visibility),
        [light for light in scene.lights if isinstance(light, Sky)],
        surfel_of,
        surfels=surfel_count,
        lamps=0,  # photons carry the light of lamps by mirrors
    )


def _first_round(
    gatherer: Gatherer,
    points: Texels,
    groups: Surfels,
    settings: BakeSettings,
    report: Report,
) -> Rounds:
    """The first round of rays from all surfels."""
    rays = max(settings.indirect_rays, SKY_RAYS if gatherer.skies else 0)
    rays_each = min(rays, MOST_RAYS / max(len(groups), 1))
    return Rounds(
        gatherer,
        stratified_middles(points.take(groups.middle), groups.step_m),
        side=round(np.sqrt(rays_each / 2)),
        done=lambda share: report(PLACED_DONE + (GATHER_DONE - PLACED_DONE) * share),
    )


class _MirroredLight:
    """The light of lamps and suns, at K instants, that surfels receive by mirroring faces."""

    def __init__(
        self,
        scene: Scene,
        settings: BakeSettings,
        reflectors: Reflectors,
        smoothing: Smoothing,
        *,
        instants: list[Instant],
        area_m2: Floats,
    ) -> None:
        self._scene = scene
        self._settings = settings
        self._reflectors = reflectors
        self._smoothing = smoothing
        self._instants = instants
        self._area_m2 = area_m2

    def illuminance_lx(self, row: int, direct_lx: Floats, scattered_lm: float) -> Floats:
        """The illuminance (2, S) of surfels by each half of the photons of a light at the instant of a row.

        `direct_lx` (P,) is the direct illuminance of points, `scattered_lm` is the flux that they scatter.
        """
        index, t_ns = self._instants[row]
        light = self._scene.lights[index]
        if not self._settings.bounces or isinstance(light, Sky):
            return np.zeros((2, len(self._area_m2)), np.float32)
        share = self._settings.indirect_rays / INDIRECT_RAYS / len(self._instants)
        effort = share * self._reflectors.effort(direct_lx, scattered_lm)
        seed = [self._settings.seed, row]
        light_emitters = emitters(light, self._reflectors.visibility, t_ns=t_ns)
        flux_lm = self._reflectors.flux_lm(light_emitters, direct_lx, effort=effort, seed=seed)
        return self._smoothing.density(flux_lm.T, self._area_m2).T


@dataclass(frozen=True, slots=True)
class _FirstLight:
    """The light of K lights before any bounce between bodies.

    `direct` (L, H, W) is as in `BakedScene`. The other arrays are of S surfels.
    `reflectance` (S, 3) is their reflectance.
    `illuminance_lx` (K, S) is the direct illuminance.
    `radiosity` (K, S, 3) is the radiosity due to the direct illuminance, for white light.
    `mirrored_lx` (2, K, S) is the illuminance by way of reflecting faces, by each half of the photons.
    """

    direct: Floats
    reflectance: Floats
    illuminance_lx: Floats
    radiosity: Floats
    mirrored_lx: Floats


def _first_light(
    scene: Scene,
    settings: BakeSettings,
    static: StaticScene,
    groups: Surfels,
    weights: Floats,
    *,
    area_m2: Floats,
    instants: list[Instant],
    mirrored: _MirroredLight,
    report: Report,
) -> _FirstLight:
    """Compute the direct and the mirrored light at some instants.

    `weights` (P,) are those of points in the means of their surfels. `area_m2` (S,) are the areas of surfels.
    """
    albedos = albedo(static.faces, scene.materials, static.points)
    freed_memory.give_back()
    direct = np.zeros((len(scene.lights), static.atlas.height, static.atlas.width), np.float32)
    illuminance_lx = np.zeros((len(instants), len(groups)), np.float32)
    radiosity = np.zeros((len(instants), len(groups), 3), np.float32)
    mirrored_lx = np.zeros((2, len(instants), len(groups)), np.float32)
    # From the last to the first instant, so that the layer of a moving sun is that of its first instant in the end.
    for row in reversed(range(len(instants))):
        index, t_ns = instants[row]
        direct_lx = direct_points(scene, index, static, settings, t_ns=t_ns)
        illuminance_lx[row] = groups.mean(direct_lx[:, None], weights)[:, 0]
        radiosity[row] = groups.mean(albedos * direct_lx[:, None], weights)
        direct[index] = direct_layer(scene, index, static, direct_lx)
        scattered_lm = float((radiosity[row] @ LUMINANCE * area_m2).sum())
        mirrored_lx[:, row] = mirrored.illuminance_lx(row, direct_lx, scattered_lm)
        freed_memory.give_back()
        report(1 - (1 - GATHER_DONE) * row / len(instants))
    return _FirstLight(direct, groups.mean(albedos, weights), illuminance_lx, radiosity, mirrored_lx)


def _bounces(
    scene: Scene,
    settings: BakeSettings,
    rounds: Rounds,
    smoothing: Smoothing,
    *,
    first_light: _FirstLight,
    instants: list[Instant],
) -> tuple[Floats, Floats]:
    """The indirect light (K, S, 3) of surfels in lx, and its standard error (S,) relative to all light."""
    radiosity = first_light.radiosity
    reflectance = first_light.reflectance
    if not settings.bounces:
        return np.zeros(radiosity.shape, np.float32), np.zeros(len(reflectance), np.float32)

    # All bounces but the last use the rays of the first round, whose noise averages out over all that the last finds.
    # The second to last is smoothed as light is shown.
    lights = _Lights(scene, instants)
    mirrored_lx = first_light.mirrored_lx.mean(0)
    by_mirrors_lx = mirrored_lx + lights.of_skies(rounds.sky_lx())
    pilot_lx = bounced(radiosity, reflectance, rounds.table(), by_mirrors_lx, bounces=max(settings.bounces - 2, 0))
    if settings.bounces > 1:
        second_to_last = rounds.first_light(smoothing, _as_columns(radiosity + reflectance * pilot_lx))
        pilot_lx = _by_light(second_to_last, radiosity.shape) + by_mirrors_lx[..., None]

    last = rounds.refined(
        smoothing,
        radiosity=_as_columns(radiosity + reflectance * pilot_lx),
        luminance=lights.channel_luminances(radiosity.shape[2]),
        sky_weights=lights.sky_weights,
        direct=lights.luminance(first_light.illuminance_lx[..., None]),
        by_mirrors=np.stack([lights.luminance(half_lx[..., None]) for half_lx in first_light.mirrored_lx]),
        noise=settings.light_noise,
    )
    last_by_mirrors_lx = mirrored_lx + lights.of_skies(last.sky_lx)
    return _by_light(last.light_lx, radiosity.shape) + last_by_mirrors_lx[..., None], last.noise


def _as_columns(values: Floats) -> Floats:
    """Values (K, S, C) of lights as columns (S, K * C)."""
    rows, columns, channels = values.shape
    by_column = np.ascontiguousarray(values.transpose(1, 0, 2))
    return by_column.reshape(columns, rows * channels).astype(np.float32)


def _by_light(columns: Floats, shape: tuple[int, ...]) -> Floats:
    """Columns (S, K * C) as values (K, S, C) of lights."""
    light_count, surfel_count, channels = shape
    return np.ascontiguousarray(columns.reshape(surfel_count, light_count, channels).transpose(1, 0, 2))


class _Lights:
    """The lights of a scene at the instants (K,) for which they are baked.

    `sky_weights` are the luminances of the colours of the skies.
    """

    def __init__(self, scene: Scene, instants: list[Instant]) -> None:
        lights = [scene.lights[index] for index, _ in instants]
        index = np.array([index for index, _ in instants], np.int64)
        # A light that is baked for several instants counts with their mean.
        share = 1 / np.bincount(index, minlength=1)[index] if len(index) else np.zeros(0)
        colours = np.array([light.colour for light in lights]).reshape(-1, 3)
        self._weights = (share[:, None] * colours * LUMINANCE).astype(np.float32)
        self._sky_rows = [row for row, light in enumerate(lights) if isinstance(light, Sky)]
        self.sky_weights = self._weights[self._sky_rows].sum(1)

    def luminance(self, values: Floats) -> Floats:
        """The sum (S,) over all lights of the values (K, S, C), weighted by the luminance of each channel."""
        total = np.zeros(values.shape[1], np.float32)
        for weight, of_light in zip(self._weights, values, strict=True):
            has_colours = of_light.shape[-1] > 1
            total += (of_light * weight).sum(-1) if has_colours else of_light[:, 0] * weight.sum()
        return total

    def channel_luminances(self, channels: int) -> Floats:
        """The luminance (K * C,) of each channel of each light."""
        return np.asarray(self._weights[:, :channels].ravel())

    def of_skies(self, sky_lx: Floats) -> Floats:
        """The light of the N skies (N, S) in a table of the light of all K lights (K, S)."""
        result = np.zeros((len(self._weights), sky_lx.shape[1]), np.float32)
        result[self._sky_rows] = sky_lx
        return result


def _tracks(
    instants: list[Instant],
    indirect: Floats,
    scene: Scene,
) -> tuple[SunTrack, ...]:
    """The indirect light (K, S, 3) of moving suns."""
    tracks = []
    for sun in moving_suns(scene):
        rows = [row for row, (index, _) in enumerate(instants) if index == sun]
        times_ns = tuple(instants[row][1] for row in rows)
        tracks.append(SunTrack(sun, times_ns, indirect[rows]))
    return tuple(tracks)


def _root_mean_square(noise: Floats, area_m2: Floats) -> float:
    """The root mean square of the noise (S,) of surfels, weighted by their areas (S,); 0 without surfels."""
    if area_m2.sum() > 0:
        return float(np.sqrt(np.average(noise**2, weights=area_m2)))
    return 0.0


def direct_points(
    scene: Scene,
    index: int,
    static: StaticScene,
    settings: BakeSettings,
    *,
    t_ns: float,
) -> Floats:
    """The direct illuminance (P,) of points in lx by one light at level 1."""
    light = scene.lights[index]
    total = np.zeros(len(static.points), np.float32)
    side = round(np.sqrt(settings.light_rays))
    everywhere = np.ones(len(static.points), bool)
    images = mirror_images(light, static.visibility, t_ns=t_ns)
    for emitter in [*emitters(light, static.visibility, t_ns=t_ns), *images]:
        stop.check()
        total += direct_light(
            emitter,
            static.points,
            static.layout,
            static.cells,
            static.visibility,
            side=side,
            among=static.open_sky if emitter.sky == "open" else everywhere,
        )
    return total


def direct_layer(
    scene: Scene,
    index: int,
    static: StaticScene,
    light: Floats,
) -> Floats:
    """The map (H, W) of the direct illuminance (P,) of points by one light. On a lamp it is π times the luminance."""
    layer = static.layout.filled(light)
    lamp = scene.lights[index]
    if isinstance(lamp, AreaLight):
        lamp_face = int(np.flatnonzero(static.faces.lamp == index)[0])
        layer[static.atlas.block(lamp_face)] = np.pi * lamp.luminance_cd_m2
    return layer
