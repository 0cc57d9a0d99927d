"""Baked light: what each light alone gives every surface; on disk, and read back."""

import json
import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import scipy
from annotated_types import Ge
from numpy.typing import NDArray

from vobench import stop
from vobench.errors import RenderError, SettingError
from vobench.geometry.se3 import Array
from vobench.render.direct_light import SKY_SMOOTHING, direct_light, in_front, mirror_images, sees_open_sky
from vobench.render.emitter import Emitter, emitters
from vobench.render.geometry import Floats, SurfaceList, Visibility, inventory
from vobench.render.indirect_light import bounced, final_gather, surface_responses
from vobench.render.lightmap import Atlas, Chart, Holes, Scales, Texels, holes, outside, pack_atlas, texels
from vobench.scene.light import NS_PER_S, AreaLight, Light, Sky, Sun
from vobench.scene.material import Map, Polished, reflectance, texture_of, under_coat
from vobench.scene.scene import Scene
from vobench.setting import Positive, settings

Report = Callable[[float], object]
MOVER_COARSER = 2
SUNLIT_FINER = 2  # the half shadow of the sun is 1 cm wide for each metre to what casts it
TEXTURES_DONE, GATHER_DONE = 0.05, 0.5  # the shares of a bake that are done after each, about
SUN_STEP_RAD = np.deg2rad(3)  # between the suns whose indirect light is baked


@settings(kw_only=False)
class BakeSettings:
    """How finely light is sampled; rays per sample are squares so that they can be stratified."""

    spacing_m: Positive = 0.025
    light_rays: Annotated[int, Ge(1)] = 16
    indirect_spacing_m: Positive = 0.1
    indirect_rays: Annotated[int, Ge(0)] = 256
    bounces: Annotated[int, Ge(0)] = 12
    seed: Annotated[int, Ge(0)] = 0


@dataclass(frozen=True, slots=True)
class SunTrack:
    """Indirect light (K, h, w) of the moving sun among the lights, at times_ns (K,) increasing."""

    light: int
    times_ns: tuple[float, ...]
    bounced: Floats


@dataclass(frozen=True, slots=True)
class BakedScene:
    """A scene with its light: all that drawing a picture needs, laid out by `atlas` over its inventory.

    light (L, H, W): what each light alone gives at level 1, bounces included: illuminance in lux, under a coat
    the share that enters it; a panel holds pi times its luminance. albedo: a tile per material with a body,
    under a coat already `under_coat`. A moving sun's layer is that of its first instant; see `tracks` for more.
    """

    scene: Scene
    atlas: Atlas
    light: Floats
    albedo: dict[str, Map]
    settings: BakeSettings = field(default_factory=BakeSettings)
    tracks: tuple[SunTrack, ...] = ()


@dataclass(frozen=True, slots=True)
class StaticScene:
    """What does not move of a scene, as rays and as points."""

    things: SurfaceList
    visibility: Visibility
    atlas: Atlas
    points: Texels
    holes: Holes


def placed(scene: Scene, *, spacing_m: float, sunlit: NDArray[np.bool_] | None = None) -> Atlas:
    """A map of a scene's inventory, finer where it is sunlit (S,).

    Movers' samples are coarser, as their light is found anew for each picture.
    """
    things = inventory(scene)
    share = np.where(things.mover < 0, 1.0, MOVER_COARSER)
    if sunlit is not None:
        share = np.where(sunlit, 1 / SUNLIT_FINER, share)
    return pack_atlas(things.surfaces, spacing_m=share * spacing_m)


def static_scene(scene: Scene, atlas: Atlas, *, seed: int) -> StaticScene:
    """A scene without its movers."""
    things = inventory(scene)
    static = tuple(np.flatnonzero(things.mover < 0).tolist())
    visibility = Visibility(things.surfaces, scene.materials, static)
    points = texels(things.surfaces, scene.materials, atlas, among=static, seed=seed)
    points = outside(points, atlas, visibility, things.panel >= 0)
    return StaticScene(things, visibility, atlas, points, holes(atlas, points.index))


def bake(scene: Scene, settings: BakeSettings, report: Report = lambda _: None) -> BakedScene:
    """Make the textures and compute the light of a scene; the same bytes for the same arguments.

    `report` is called now and then with the share of the work that is done, about.
    """
    coarse = static_scene(scene, placed(scene, spacing_m=settings.indirect_spacing_m), seed=settings.seed)
    atlas = placed(scene, spacing_m=settings.spacing_m, sunlit=_sunlit(scene, coarse, settings))
    albedo = tiles(scene)
    report(TEXTURES_DONE)
    fine = static_scene(scene, atlas, seed=settings.seed)
    scales = Scales(fine.atlas, coarse.atlas)
    gathered = final_gather(
        coarse.points,
        coarse.atlas,
        coarse.visibility,
        surface_responses(coarse.things.surfaces, scene.materials, albedo, coarse.things.panel),
        [light for light in scene.lights if isinstance(light, Sky)],
        rays=settings.indirect_rays,
        done=lambda share: report(TEXTURES_DONE + (GATHER_DONE - TEXTURES_DONE) * share),
    )
    instants = [(index, t_ns) for index, light in enumerate(scene.lights) for t_ns in key_times_ns(light)]
    light = np.zeros((len(scene.lights), fine.atlas.height, fine.atlas.width), np.float32)
    straight = np.zeros((len(instants), coarse.atlas.height, coarse.atlas.width), np.float32)
    # Backwards, so that a moving sun's layer ends as that of its first instant.
    for row, (index, t_ns) in reversed(list(enumerate(instants))):
        light[index] = direct_layer(scene, index, fine, settings, t_ns=t_ns)
        straight[row] = scales.coarsened(light[index, None])[0]
        report(1 - (1 - GATHER_DONE) * row / len(instants))
    skies = [row for row, (index, _) in enumerate(instants) if isinstance(scene.lights[index], Sky)]
    around = bounced(straight, gathered, skies, coarse.holes, bounces=settings.bounces)
    first = [instants.index((index, key_times_ns(one)[0])) for index, one in enumerate(scene.lights)]
    light += scales.refined(around[first])
    return BakedScene(scene, fine.atlas, light, albedo, settings, _tracks(scene, instants, around))


def tiles(scene: Scene) -> dict[str, Map]:
    """Every body's tile: reflectance, or what a coat makes of it."""
    made: dict[str, Map] = {}
    for name, material in sorted(scene.materials.items()):
        stop.check()
        texture = texture_of(material)
        if texture is not None:
            made[name] = reflectance(texture)
        if isinstance(material, Polished):
            made[name] = under_coat(made[name].astype(float), material.eta).astype(np.float32)
    return made


def _sunlit(scene: Scene, coarse: StaticScene, settings: BakeSettings) -> NDArray[np.bool_]:
    """The surfaces (S,) on which the sun casts shadows, at any of the instants it is baked for."""
    lit = np.zeros(len(coarse.things.surfaces), bool)
    for index, light in enumerate(scene.lights):
        for t_ns in key_times_ns(light) if isinstance(light, Sun) else ():
            layer = direct_layer(scene, index, coarse, settings, t_ns=t_ns)
            lit |= [bool(layer[chart.window].any()) for chart in coarse.atlas.charts]
    return lit


def _tracks(scene: Scene, instants: list[tuple[int, float]], around: Floats) -> tuple[SunTrack, ...]:
    rows = {sun: [row for row, (index, _) in enumerate(instants) if index == sun] for sun in moving_suns(scene)}
    return tuple(SunTrack(sun, tuple(instants[row][1] for row in own), around[own]) for sun, own in rows.items())


def moving_suns(scene: Scene) -> tuple[int, ...]:
    """Which lights are suns that move."""
    return tuple(i for i, light in enumerate(scene.lights) if isinstance(light, Sun) and light.moves)


def key_times_ns(light: Light) -> tuple[float, ...]:
    """When a light's place is baked: once, or so often that a moving sun wanders SUN_STEP_RAD between."""
    if not isinstance(light, Sun) or not light.moves:
        return (light.times_s[0] * NS_PER_S if isinstance(light, Sun) else 0.0,)
    times = np.array(light.times_s) * NS_PER_S
    steps = np.maximum(np.ceil(np.diff(wandered_rad(light)) / SUN_STEP_RAD), 1).astype(int)
    inner = [np.linspace(*span, count, endpoint=False) for span, count in zip(pairwise(times), steps, strict=True)]
    return (*np.concatenate(inner).tolist(), float(times[-1]))


def wandered_rad(sun: Sun) -> Array:
    """How far (K,) a sun has gone along its way, at most, at each of its times: not how far it is from the start."""
    azimuth, elevation = np.deg2rad(sun.azimuth_deg), np.abs(np.deg2rad(sun.elevation_deg))
    across = np.diff(azimuth) * np.cos(np.minimum(elevation[1:], elevation[:-1]))
    return np.concatenate([[0.0], np.cumsum(np.hypot(across, np.diff(np.deg2rad(sun.elevation_deg))))])


def direct_layer(scene: Scene, index: int, fine: StaticScene, settings: BakeSettings, *, t_ns: float) -> Floats:
    """What one light gives straight (H, W), its panel's glow included."""
    light, total = scene.lights[index], np.zeros(len(fine.points), np.float32)
    shown = mirror_images(light, fine.visibility, t_ns=t_ns)
    for emitter in [*emitters(light, fine.visibility, t_ns=t_ns), *shown]:
        stop.check()
        some = np.flatnonzero(reached(emitter, fine))
        side = round(np.sqrt(settings.light_rays))
        total[some] += direct_light(emitter, fine.points.take(some), fine.atlas, fine.visibility, side=side)
    layer = fine.holes.filled(total).reshape(fine.atlas.height, fine.atlas.width)
    for chart in fine.atlas.charts if isinstance(light, Sky) else ():
        layer[chart.window] = scipy.ndimage.gaussian_filter(layer[chart.window], SKY_SMOOTHING, mode="nearest")
    if isinstance(light, AreaLight):
        panel = int(np.flatnonzero(fine.things.panel == scene.panels.index(light))[0])
        layer[fine.atlas.charts[panel].window] = np.pi * light.luminance_cd_m2
    return layer


def reached(emitter: Emitter, fine: StaticScene) -> NDArray[np.bool_]:
    """The points (P,) that an emitter may light."""
    ahead = in_front(emitter.ball, fine.points.points_m, fine.points.normals)
    return ahead & sees_open_sky(emitter, fine.points, fine.visibility) if emitter.sky == "open" else ahead


LIGHT, CHARTS, SETTINGS_FILE = "light.npy", "charts.npy", "settings.json"


def save_baked(folder: Path, baked: BakedScene) -> None:
    """Write the maps of a baked scene into a folder."""
    (folder / SETTINGS_FILE).write_text(json.dumps(asdict(baked.settings)))
    np.save(folder / LIGHT, baked.light)
    charts = [(p.row, p.column, p.rows, p.columns) for p in baked.atlas.charts]
    np.save(folder / CHARTS, np.array(charts, np.int32))
    for name, tile in baked.albedo.items():
        np.save(folder / f"albedo.{name}.npy", tile)
    for track in baked.tracks:
        np.savez(folder / f"sun.{track.light}.npz", times_ns=track.times_ns, bounced=track.bounced)


def load_baked(folder: Path, scene: Scene) -> BakedScene:
    """The maps that `save_baked` wrote, for the same scene. Raises RenderError where they are damaged."""
    try:
        settings = BakeSettings(**json.loads((folder / SETTINGS_FILE).read_text()))
        light = np.load(folder / LIGHT)
        charts = tuple(Chart(*row) for row in np.load(folder / CHARTS).tolist())
        bodies = [name for name, material in sorted(scene.materials.items()) if texture_of(material)]
        albedo = {name: np.load(folder / f"albedo.{name}.npy") for name in bodies}
        tracks = tuple(_track(folder / f"sun.{sun}.npz", sun) for sun in moving_suns(scene))
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, SettingError) as error:
        raise RenderError(f"the scene's light cannot be read ({error}); delete this folder: {folder}") from error
    return BakedScene(scene, Atlas(charts, *light.shape[1:]), light, albedo, settings, tracks)


def _track(path: Path, sun: int) -> SunTrack:
    with path.open("rb") as file, np.load(file) as stored:  # np.load leaves a torn file open
        return SunTrack(sun, tuple(stored["times_ns"].tolist()), stored["bounced"])
