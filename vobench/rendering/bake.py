"""Baked light: what each light alone gives every face; on disk, and read back."""

import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import scipy
from annotated_types import Ge

from vobench import stop
from vobench.errors import RenderError, SettingError
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering import freed_memory
from vobench.rendering.albedo import albedo
from vobench.rendering.array_types import Floats, Indices, Mask
from vobench.rendering.atlas import Atlas
from vobench.rendering.bounce import bounced
from vobench.rendering.direct_light import direct_light
from vobench.rendering.emitter import emitters
from vobench.rendering.face_response import response
from vobench.rendering.gathering import Rounds, Smoothing
from vobench.rendering.geometry import are_panes, face_materials
from vobench.rendering.indirect_light import MOST_RAYS, Gatherer
from vobench.rendering.mirror_image import mirror_images
from vobench.rendering.photons import Reflectors
from vobench.rendering.sun_tiles import FaceParts, sunlit_parts
from vobench.rendering.surfel import Surfels, stratified_middles, surfels
from vobench.rendering.surfel_blend import blend
from vobench.rendering.texel import Texels, texel_areas_m2, texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Light, Sky, Sun
from vobench.scene.material import LUMINANCE, Material, Picture, Texture
from vobench.scene.panorama import PanoramaMap
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles
from vobench.setting import Positive, settings
from vobench.trajectory.nanoseconds import NS_PER_S

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

Report = Callable[[float], object]
MOVER_COARSER = 2
SUNLIT_FINER = 2  # the half shadow of the sun is 1 cm wide for each metre to what casts it
CELL_TEXELS = 2.5  # along a surfel's side at least, where samples are far from each other
# the shares of a bake that are done after each, about
PLACED_DONE = 0.1
GATHER_DONE = 0.4
SKY_RAYS = 64  # at least from a surfel to tell whether it sees the sky
BLIND = 0.02  # of a surfel's rays: one that sees less is inside something
TEXTURE_FIELDS = ("texture", "emission_texture")
SAMPLES = 4_000_000  # of light, by default: what a bake of minutes takes
UNSEEN = 1e-3  # hits, of a texel that no ray has found
INDIRECT_RAYS = 72  # from a surfel at first, by default
SUN_STEP_RAD = np.deg2rad(3)  # between the suns whose indirect light is baked


@settings(kw_only=False)
class BakeSettings:
    """How finely light is sampled; rays per sample are squares so that they can be stratified.

    bounces: at most; they end where they add no more. indirect_rays: from each surfel at first; more follow from those
    whose light has a relative standard error above light_noise, up to 8 times as many.
    """

    spacing_m: Positive = 0.025
    light_rays: Annotated[int, Ge(1)] = 16
    indirect_spacing_m: Positive = 0.1
    indirect_rays: Annotated[int, Ge(0)] = INDIRECT_RAYS
    bounces: Annotated[int, Ge(0)] = 64
    seed: Annotated[int, Ge(0)] = 0
    light_noise: Positive = 0.02


@dataclass(frozen=True, slots=True)
class SunTrack:
    """Indirect light (K, S, 3) of the moving sun among the lights, at times_ns (K,) increasing."""

    light: int
    times_ns: tuple[float, ...]
    bounced: Floats


@dataclass(frozen=True, slots=True)
class Patches:
    """What surfels send out: surfel_of (H·W,) is the one that each texel is in, -1 for none.

    reflectance (S, 3), area_m2 (S,); radiosity (L, S, 3) under each light if it is white, in lm/m².
    """

    surfel_of: Indices
    reflectance: Floats
    area_m2: Floats
    radiosity: Floats


@dataclass(frozen=True, slots=True)
class BakedScene:
    """A scene with its light: all that drawing a picture needs. Its faces' places on the map are in `atlas`.

    faces (T,) is the table of the parts of the scene's faces, which have samples at different distances.
    direct (L, H, W): what each light alone gives straight at level 1 if it is white: illuminance in lux, under a coat
    the share that enters it; on a lamp pi times its luminance. bounced (L, S, 3): what it gives surfels by bounces;
    spread (H·W, S) lays that on the map. A moving sun's layers are those of its first instant; see `tracks` for more.
    light_noise: the relative standard error of the light that its rays leave, root mean square over surfaces.
    """

    scene: Scene
    parts: FaceParts
    faces: Triangles
    atlas: Atlas
    direct: Floats
    bounced: Floats
    spread: "csr_matrix"
    patches: Patches
    settings: BakeSettings = field(default_factory=BakeSettings)
    tracks: tuple[SunTrack, ...] = ()
    light_noise: float = 0.0

    @property
    def light_uv(self) -> Floats:
        """Places (F, 3, 2) of faces' corners on the map in [0, 1]."""
        return self.atlas.light_uv


@dataclass(frozen=True, slots=True)
class StaticScene:
    """What does not move of a scene, as rays and as points.

    cells (P,): the surfel of each point; open_sky (P,): whether it may see the sky by no pane.
    """

    faces: Triangles
    visibility: Visibility
    atlas: Atlas
    points: Texels
    layout: TexelLayout
    cells: Indices
    open_sky: Mask


def bodies(scene: Scene, faces: Triangles) -> Mask:
    """The faces (F,) that light can show on."""
    kinds = face_materials(faces, scene.materials)
    return np.array([kind is not None and kind.kind == "body" for kind in kinds], bool)[faces.thing]


def sampled_faces(scene: Scene, settings: BakeSettings) -> tuple[FaceParts, Triangles, Array]:
    """Parts of a scene's faces, the table (T,) of these, and the distance (T,) between samples on each.

    Faces are divided so that samples are near to one another only where edges of the sun's shadows are.
    """
    faces = triangles(scene)
    directions = []
    for light in scene.lights:
        if isinstance(light, Sun):
            directions += [light.direction(t_ns) for t_ns in key_times_ns(light)]
    is_static = faces.mover < 0
    parts, is_fine = sunlit_parts(
        faces,
        is_receiver=bodies(scene, faces) & is_static,
        is_opaque=is_static & ~are_panes(faces, scene.materials),
        sun_directions=directions,
        spacing_m=_asked_m(faces, settings),
    )
    parted = parts.of(faces)
    return parts, parted, spacings_m(scene, parted, settings, is_fine)


def _asked_m(faces: Triangles, settings: BakeSettings) -> Array:
    """The distance between samples (F,) that the thing of each face asks for, or else the settings."""
    things_ask_m = [thing.spacing_m or settings.spacing_m for thing in faces.things]
    return np.array(things_ask_m)[faces.thing]


def spacings_m(scene: Scene, faces: Triangles, settings: BakeSettings, is_fine: Mask) -> Array:
    """Between samples on each face (F,): what its thing asks for, less on fine faces (F,), more on movers.

    On what asks for nothing it grows with the scene, so that SAMPLES do.
    """
    static_factor = np.where(is_fine, 1 / SUNLIT_FINER, 1.0)
    factor = np.where(faces.mover < 0, static_factor, MOVER_COARSER)
    spacing_m = _asked_m(faces, settings) * factor

    asks = np.array([thing.spacing_m is not None for thing in faces.things])
    is_free = bodies(scene, faces) & ~asks[faces.thing]
    sample_count = (areas_m2(faces.corners_m[is_free]) / spacing_m[is_free] ** 2).sum()
    growth = max(1.0, float(np.sqrt(sample_count / SAMPLES)))
    return np.asarray(spacing_m * np.where(is_free, growth, 1.0))


def static_points(
    scene: Scene,
    faces: Triangles,
    atlas: Atlas,
    seed: int,
) -> tuple[Visibility, Texels, TexelLayout, Floats]:
    """A scene without its movers, as rays and as points, these on the map, and the area (P,) of each."""
    is_static = faces.mover < 0
    visibility = Visibility(faces, scene.materials, np.flatnonzero(is_static))
    owner = owners(atlas)
    points, layout = texels(faces, scene.materials, atlas, owner, among=is_static, seed=seed, visibility=visibility)
    return visibility, points, layout, texel_areas_m2(faces, atlas, owner, is_static)[points.index]


def static_scene(baked: BakedScene) -> StaticScene:
    """The stationary part of a baked scene, computed once more."""
    visibility, points, layout, _ = static_points(baked.scene, baked.faces, baked.atlas, baked.settings.seed)
    cells = baked.patches.surfel_of[points.index]
    open_sky = np.ones(len(points), bool)
    return StaticScene(baked.faces, visibility, baked.atlas, points, layout, cells, open_sky)


def bake(
    scene: Scene,
    settings: BakeSettings,
    report: Report = lambda _: None,
) -> BakedScene:
    """Compute the light of a scene; the same bytes for the same arguments.

    `report` is called now and then with the share of the work that is done, about.
    """
    _paint(scene)
    freed_memory.give_back()
    parts, faces, spacing_m = sampled_faces(scene, settings)
    atlas = unwrap(faces, spacing_m, bodies(scene, faces))
    visibility, points, layout, point_areas_m2 = static_points(scene, faces, atlas, settings.seed)
    freed_memory.give_back()
    thing = faces.thing[points.face]
    cell_m = CELL_TEXELS * spacing_m[points.face]
    step_m = np.maximum(settings.indirect_spacing_m, cell_m).astype(np.float32)
    groups = surfels(points, thing, step_m, visibility)
    surfel_of = np.append(groups.of, np.int32(-1))[layout.source]
    area_m2 = np.bincount(groups.of, point_areas_m2, len(groups))
    report(PLACED_DONE)

    skies = [light for light in scene.lights if isinstance(light, Sky)]
    gatherer = Gatherer(
        atlas,
        visibility,
        response(faces, scene.materials, visibility),
        skies,
        surfel_of,
        surfels=len(groups),
        lamps=0,  # what lamps give by mirrors is carried by photons
    )
    rays = max(settings.indirect_rays, SKY_RAYS if skies else 0)
    rays_each = min(rays, MOST_RAYS / max(len(groups), 1))
    middles = stratified_middles(points.take(groups.middle), groups.step_m)
    rounds = Rounds(
        gatherer,
        middles,
        side=round(np.sqrt(rays_each / 2)),
        done=lambda share: report(PLACED_DONE + (GATHER_DONE - PLACED_DONE) * share),
    )
    is_usable = rounds.met() + rounds.escaped > BLIND
    spread = blend(points, groups, layout, visibility, is_usable)
    smoothing = Smoothing(spread[points.index[groups.middle]])
    open_sky = (spread @ rounds.escaped)[points.index] > 0
    static = StaticScene(faces, visibility, atlas, points, layout, groups.of, open_sky)

    # A surfel is represented by its points that rays have found, not by those that lie hidden under a rug.
    point_hits = np.bincount(layout.source, rounds.hits, len(points) + 1)
    weights = point_hits[: len(points)] + UNSEEN
    instants = [(index, t_ns) for index, light in enumerate(scene.lights) for t_ns in key_times_ns(light)]
    reflectors = Reflectors(gatherer, points, point_areas_m2, settings.seed)

    by_photons = _PhotonLight(scene, settings, reflectors, smoothing, instants=instants, area_m2=area_m2)
    straight = _straight(
        scene,
        settings,
        static,
        groups,
        weights,
        area_m2=area_m2,
        instants=instants,
        by_photons=by_photons,
        report=report,
    )
    del static, points, layout, reflectors, by_photons  # bounces take memory of their own
    freed_memory.give_back()
    indirect, noise = _bounces(scene, settings, rounds, smoothing, straight=straight, instants=instants)
    first = [instants.index((index, key_times_ns(light)[0])) for index, light in enumerate(scene.lights)]
    patches = Patches(
        surfel_of=surfel_of,
        reflectance=straight.reflectance,
        area_m2=area_m2,
        radiosity=straight.received[first] + straight.reflectance * indirect[first],
    )
    mean_noise = float(np.sqrt(np.average(noise**2, weights=area_m2))) if area_m2.sum() > 0 else 0.0
    tracks = _tracks(instants, indirect, scene)
    return BakedScene(
        scene, parts, faces, atlas, straight.direct, indirect[first], spread, patches, settings, tracks, mean_noise
    )


class _PhotonLight:
    """What lamps and suns at some instants give surfels by way of mirroring faces."""

    def __init__(
        self,
        scene: Scene,
        settings: BakeSettings,
        reflectors: Reflectors,
        smoothing: Smoothing,
        *,
        instants: list[tuple[int, float]],
        area_m2: Floats,
    ) -> None:
        self._scene = scene
        self._settings = settings
        self._reflectors = reflectors
        self._smoothing = smoothing
        self._instants = instants
        self._area_m2 = area_m2

    def lx(self, row: int, light: Floats, scattered_lm: float) -> Floats:
        """The illuminance (2, S) by each half of the photons of the light of an instant.

        `light` (P,) is its direct light on points, which scatter `scattered_lm`.
        """
        index, t_ns = self._instants[row]
        lamp = self._scene.lights[index]
        if not self._settings.bounces or isinstance(lamp, Sky):
            return np.zeros((2, len(self._area_m2)), np.float32)
        share = self._settings.indirect_rays / INDIRECT_RAYS / len(self._instants)
        effort = share * self._reflectors.effort(light, scattered_lm)
        seed = [self._settings.seed, row]
        light_emitters = emitters(lamp, self._reflectors.visibility, t_ns=t_ns)
        flux_lm = self._reflectors.flux_lm(light_emitters, light, effort=effort, seed=seed)
        return self._smoothing.density(flux_lm.T, self._area_m2).T


def _paint(scene: Scene) -> None:
    """Paint the textures and panoramas of a scene, which are cached, while nothing else takes memory."""
    names = {thing.material for thing in scene.things} & scene.materials.keys()
    for name in sorted(names):
        texture = scene.materials[name].texture
        if texture is not None:
            texture.pixels()
    for light in scene.lights:
        if isinstance(light, Sky) and light.panorama is not None:
            light.panorama.map_under(light)


@dataclass(frozen=True, slots=True)
class _Straight:
    """What K lights give before any bounce between bodies.

    direct (L, H, W) as in BakedScene; of surfels reflectance (S, 3), illuminance_lx (K, S), the radiosity (K, S, 3)
    that it gives them if the light is white, and by_mirrors_lx (2, K, S), by each half of the photons.
    """

    direct: Floats
    reflectance: Floats
    illuminance_lx: Floats
    received: Floats
    by_mirrors_lx: Floats


def _straight(
    scene: Scene,
    settings: BakeSettings,
    static: StaticScene,
    groups: Surfels,
    weights: Floats,
    *,
    area_m2: Floats,
    instants: list[tuple[int, float]],
    by_photons: "_PhotonLight",
    report: Report,
) -> _Straight:
    """Trace the direct light of the lights at some instants; weights (P,) of points in their surfels, area_m2 (S,)."""
    scatters = albedo(static.faces, scene.materials, static.points)
    freed_memory.give_back()
    direct = np.zeros((len(scene.lights), static.atlas.height, static.atlas.width), np.float32)
    illuminance_lx = np.zeros((len(instants), len(groups)), np.float32)
    received = np.zeros((len(instants), len(groups), 3), np.float32)
    by_mirrors_lx = np.zeros((2, len(instants), len(groups)), np.float32)
    # Backwards, so that a moving sun's layer ends as that of its first instant.
    for row in reversed(range(len(instants))):
        index, t_ns = instants[row]
        light = direct_points(scene, index, static, settings, t_ns=t_ns)
        illuminance_lx[row] = groups.mean(light[:, None], weights)[:, 0]
        received[row] = groups.mean(scatters * light[:, None], weights)
        direct[index] = direct_layer(scene, index, static, light)
        scattered_lm = float((received[row] @ LUMINANCE * area_m2).sum())
        by_mirrors_lx[:, row] = by_photons.lx(row, light, scattered_lm)
        freed_memory.give_back()
        report(1 - (1 - GATHER_DONE) * row / len(instants))
    return _Straight(direct, groups.mean(scatters, weights), illuminance_lx, received, by_mirrors_lx)


def _bounces(
    scene: Scene,
    settings: BakeSettings,
    rounds: Rounds,
    smoothing: Smoothing,
    *,
    straight: _Straight,
    instants: list[tuple[int, float]],
) -> tuple[Floats, Floats]:
    """The indirect light (K, S, 3) of surfels, and its noise (S,) relative to all light."""
    lights = _Lights(scene, instants)
    received = straight.received
    reflectance = straight.reflectance
    by_mirrors_lx = straight.by_mirrors_lx.mean(0)
    if not settings.bounces:
        return np.zeros(received.shape, np.float32), np.zeros(len(reflectance), np.float32)

    # All bounces but the last, by the rays of the first round, whose noise averages out over all that the last finds.
    # The last of these is smoothed as light is shown.
    first_lx = by_mirrors_lx + lights.of_skies(rounds.sky_lx())
    pilot = bounced(received, reflectance, rounds.table(), first_lx, bounces=max(settings.bounces - 2, 0))
    if settings.bounces > 1:
        light_lx = rounds.first_light(smoothing, _as_columns(received + reflectance * pilot))
        pilot = _by_light(light_lx, received.shape) + first_lx[..., None]
    gathered = rounds.refined(
        smoothing,
        radiosity=_as_columns(received + reflectance * pilot),
        luminance=lights.channel_luminances(received.shape[2]),
        sky_weights=lights.sky_weights,
        direct=lights.luminance(straight.illuminance_lx[..., None]),
        by_mirrors=np.stack([lights.luminance(half_lx[..., None]) for half_lx in straight.by_mirrors_lx]),
        noise=settings.light_noise,
    )
    last_lx = by_mirrors_lx + lights.of_skies(gathered.sky_lx)
    return _by_light(gathered.light_lx, received.shape) + last_lx[..., None], gathered.noise


def _as_columns(values: Floats) -> Floats:
    """Values (K, S, C) of lights as columns (S, K * C)."""
    return np.ascontiguousarray(values.transpose(1, 0, 2)).reshape(values.shape[1], -1).astype(np.float32)


def _by_light(columns: Floats, shape: tuple[int, ...]) -> Floats:
    """Columns (S, K * C) as values (K, S, C) of lights."""
    light_count, surfel_count, channels = shape
    return np.ascontiguousarray(columns.reshape(surfel_count, light_count, channels).transpose(1, 0, 2))


class _Lights:
    """The lights of a scene at the instants (K,) that they are baked for."""

    def __init__(self, scene: Scene, instants: list[tuple[int, float]]) -> None:
        lights = [scene.lights[index] for index, _ in instants]
        index = np.array([index for index, _ in instants], np.int64)
        # A light that is baked for several instants counts with their mean.
        share = 1 / np.bincount(index, minlength=1)[index] if len(index) else np.zeros(0)
        colours = np.array([light.colour for light in lights]).reshape(-1, 3)
        self._weights = (share[:, None] * colours * LUMINANCE).astype(np.float32)
        self._sky_rows = [row for row, light in enumerate(lights) if isinstance(light, Sky)]
        self.sky_weights = self._weights[self._sky_rows].sum(1)

    def luminance(self, values: Floats) -> Floats:
        """The sum (S,) over all lights of what they give (K, S, C), by its luminance."""
        total = np.zeros(values.shape[1], np.float32)
        for weight, of_light in zip(self._weights, values, strict=True):
            total += (of_light * weight).sum(-1) if of_light.shape[-1] > 1 else of_light[:, 0] * weight.sum()
        return total

    def channel_luminances(self, channels: int) -> Floats:
        """The luminance (K * C,) of each channel of each light."""
        return np.asarray(self._weights[:, :channels].ravel())

    def of_skies(self, sky_lx: Floats) -> Floats:
        """What each sky gives (N, S) as what each light does (K, S)."""
        result = np.zeros((len(self._weights), sky_lx.shape[1]), np.float32)
        result[self._sky_rows] = sky_lx
        return result


def _tracks(
    instants: list[tuple[int, float]],
    indirect: Floats,
    scene: Scene,
) -> tuple[SunTrack, ...]:
    tracks = []
    for sun in moving_suns(scene):
        rows = [row for row, (index, _) in enumerate(instants) if index == sun]
        times_ns = tuple(instants[row][1] for row in rows)
        tracks.append(SunTrack(sun, times_ns, indirect[rows]))
    return tuple(tracks)


def moving_suns(scene: Scene) -> tuple[int, ...]:
    """Which lights are suns that move."""
    return tuple(index for index, light in enumerate(scene.lights) if light.moves)


def key_times_ns(light: Light) -> tuple[float, ...]:
    """The instants that a light is baked for: one, or so many that a moving sun travels SUN_STEP_RAD between."""
    if not isinstance(light, Sun):
        return (0.0,)
    if not light.moves:
        return (light.times_s[0] * NS_PER_S,)
    times_ns = np.array(light.times_s) * NS_PER_S
    steps = np.ceil(np.diff(travelled_rad(light)) / SUN_STEP_RAD)
    step_counts = np.maximum(steps, 1).astype(int)
    inner_ns = []
    for (start_ns, end_ns), count in zip(pairwise(times_ns), step_counts, strict=True):
        inner_ns.append(np.linspace(start_ns, end_ns, count, endpoint=False))
    return (*np.concatenate(inner_ns).tolist(), float(times_ns[-1]))


def travelled_rad(sun: Sun) -> Array:
    """How far (K,) a sun has travelled along its path, at most, at each of its times."""
    azimuth_rad = np.deg2rad(sun.azimuth_deg)
    elevation_rad = np.deg2rad(sun.elevation_deg)
    height_rad = np.abs(elevation_rad)
    widest = np.cos(np.minimum(height_rad[1:], height_rad[:-1]))  # of the circles of equal elevation
    across_rad = np.diff(azimuth_rad) * widest
    steps_rad = np.hypot(across_rad, np.diff(elevation_rad))
    return np.concatenate([[0.0], np.cumsum(steps_rad)])


def direct_points(
    scene: Scene,
    index: int,
    static: StaticScene,
    settings: BakeSettings,
    *,
    t_ns: float,
) -> Floats:
    """The direct light (P,) of one light on the points."""
    light = scene.lights[index]
    total = np.zeros(len(static.points), np.float32)
    side = round(np.sqrt(settings.light_rays))
    images = mirror_images(light, static.visibility, t_ns=t_ns)
    for emitter in [*emitters(light, static.visibility, t_ns=t_ns), *images]:
        stop.check()
        everywhere = np.ones(len(static.points), bool)
        is_reachable = static.open_sky if emitter.sky == "open" else everywhere
        total += direct_light(
            emitter,
            static.points,
            static.layout,
            static.cells,
            static.visibility,
            side=side,
            among=is_reachable,
        )
    return total


def direct_layer(
    scene: Scene,
    index: int,
    static: StaticScene,
    light: Floats,
) -> Floats:
    """The map (H, W) of the direct light (P,) of one light on the points, its glow included."""
    layer = static.layout.filled(light)
    lamp = scene.lights[index]
    if isinstance(lamp, AreaLight):
        lamp_face = int(np.flatnonzero(static.faces.lamp == index)[0])
        layer[static.atlas.block(lamp_face)] = np.pi * lamp.luminance_cd_m2
    return layer


LIGHT = "light.npy"
PLACES = "surfels.npz"
TEXTURES = "textures.npz"
SETTINGS_FILE = "settings.json"
NOISE_FILE = "noise.json"
SPREAD_ARRAYS = ("data", "indices", "indptr")


def save_baked(folder: Path, baked: BakedScene) -> None:
    """Write the light of a baked scene into a folder, and its textures as they were painted for it."""
    (folder / SETTINGS_FILE).write_text(json.dumps(asdict(baked.settings)))
    (folder / NOISE_FILE).write_text(json.dumps({"light_noise": baked.light_noise}))
    np.save(folder / LIGHT, baked.direct)
    spread = {f"spread_{name}": getattr(baked.spread, name) for name in SPREAD_ARRAYS}
    patches = {field.name: getattr(baked.patches, field.name) for field in fields(Patches)}
    np.savez(
        folder / PLACES,
        light_px=baked.atlas.light_px,
        chart=baked.atlas.chart,
        parent=baked.parts.parent,
        weights=baked.parts.weights,
        bounced=baked.bounced,
        **spread,
        **patches,
    )
    for track in baked.tracks:
        np.savez(folder / f"sun.{track.light}.npz", times_ns=track.times_ns, bounced=track.bounced)
    np.savez(folder / TEXTURES, **_painted(baked))
    for index, light in enumerate(baked.scene.lights):
        if isinstance(light, Sky) and light.panorama is not None:
            shown = light.panorama.map_under(light)
            np.savez(folder / f"panorama.{index}.npz", daylight=shown.daylight, lamps=shown.lamps)


def _painted(baked: BakedScene) -> dict[str, Any]:
    """The pixels of all textures of a baked scene's things that are no pictures, by the names of `_textures`."""
    materials = baked.scene.materials
    names = {thing.material for thing in baked.faces.things} & materials.keys()
    shown = {id(getattr(materials[name], part)) for name in names for part in TEXTURE_FIELDS}
    painted = {name: texture for name, texture in _textures(materials).items() if id(texture) in shown}
    return {name: texture.pixels() for name, texture in painted.items()}


def _textures(materials: Mapping[str, Material]) -> dict[str, Texture]:
    """The textures that are no pictures yet, each by the first material and the field that have it."""
    named = dict[int, tuple[str, Texture]]()
    for name, material in reversed(list(materials.items())):
        for part in TEXTURE_FIELDS:
            texture = getattr(material, part)
            if texture is not None and not isinstance(texture, Picture):
                named[id(texture)] = (f"{name}.{part}", texture)
    return dict(named.values())


def _with_pictures(scene: Scene, pictures: Mapping[str, Any]) -> Scene:
    """The scene with pictures, by the names of `_textures`, in place of textures that would be painted once more."""
    painted = {}
    for name, texture in _textures(scene.materials).items():
        if name in pictures:
            painted[id(texture)] = Picture(pictures[name], texture.tile_m)

    def with_pictures(material: Material) -> Material:
        textures = {part: getattr(material, part) for part in TEXTURE_FIELDS}
        replaced = {part: painted.get(id(texture), texture) for part, texture in textures.items()}
        return replace(material, **replaced)

    materials = {name: with_pictures(material) for name, material in scene.materials.items()}
    return replace(scene, materials=materials)


def _with_panoramas(scene: Scene, folder: Path) -> Scene:
    """The scene with the panoramas that were painted for its skies, which need not be painted once more."""
    lights = list[Light]()
    for index, light in enumerate(scene.lights):
        if isinstance(light, Sky) and light.panorama is not None:
            stored = _load(folder / f"panorama.{index}.npz")
            lights.append(replace(light, panorama=PanoramaMap(stored["daylight"], stored["lamps"])))
        else:
            lights.append(light)
    return replace(scene, lights=tuple(lights))


def load_baked(folder: Path, scene: Scene) -> BakedScene:
    """The light that `save_baked` wrote, for the same scene. Raises RenderError where it is damaged."""
    try:
        settings = BakeSettings(**json.loads((folder / SETTINGS_FILE).read_text()))
        light_noise = float(json.loads((folder / NOISE_FILE).read_text())["light_noise"])
        pictured = _with_panoramas(_with_pictures(scene, _load(folder / TEXTURES)), folder)
        light = np.load(folder / LIGHT)
        arrays = _load(folder / PLACES)
        tracks = []
        for sun in moving_suns(scene):
            track = _load(folder / f"sun.{sun}.npz")
            tracks.append(SunTrack(sun, tuple(track["times_ns"].tolist()), track["bounced"]))
        atlas = Atlas(arrays["light_px"], arrays["chart"], *light.shape[1:])
        patches = Patches(*(arrays[field.name] for field in fields(Patches)))
        texel_count = atlas.height * atlas.width
        spread_arrays = tuple(arrays[f"spread_{name}"] for name in SPREAD_ARRAYS)
        spread = scipy.sparse.csr_matrix(spread_arrays, (texel_count, len(patches.area_m2)))
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, SettingError) as error:
        raise RenderError(f"the scene's light cannot be read ({error}); delete this folder: {folder}") from error
    parts = FaceParts(arrays["parent"], arrays["weights"])
    return BakedScene(
        pictured,
        parts,
        parts.of(triangles(scene)),
        atlas,
        light,
        arrays["bounced"],
        spread,
        patches,
        settings,
        tuple(tracks),
        light_noise,
    )


def _load(path: Path) -> dict[str, Any]:
    with path.open("rb") as file, np.load(file) as stored:  # np.load leaves a torn file open
        return dict(stored)
