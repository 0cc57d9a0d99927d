"""Baked light: what each light alone gives every surface; on disk, and read back."""

import json
import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench import stop
from vobench.errors import RenderError
from vobench.geometry.se3 import Array
from vobench.render.direct_light import SKY_SMOOTHING, direct_light, in_front, mirror_images, sees_open_sky
from vobench.render.emitter import Emitter, OpenSky, emitters
from vobench.render.geometry import Floats, SurfaceList, Visibility, inventory
from vobench.render.indirect_light import FinalGather, bounced, final_gather, surface_responses
from vobench.render.lightmap import Atlas, Chart, Holes, Scales, Texels, holes, outside, pack_atlas, texels
from vobench.scene.light import NS_PER_S, AreaLight, Light, Sky, Sun
from vobench.scene.material import Map, Polished, reflectance, texture_of, under_coat
from vobench.scene.scene import Scene

Tell = Callable[[float], object]
MOVER_COARSER = 2
SUNLIT_FINER = 2  # the half shadow of the sun is 1 cm wide for each metre to what casts it
# What work costs in rays sent straight to a light: a gathered ray meets surfaces, a pixel of a tile is drawn.
GATHERED_RAY, TILE_PIXEL = 2.0, 0.4
SUN_STEP_RAD = np.deg2rad(3)  # between the suns whose indirect light is baked


@dataclass(frozen=True, slots=True)
class BakeSettings:
    """How finely light is sampled; rays per sample are squares so that they can be stratified."""

    spacing_m: float = 0.025
    light_rays: int = 16
    indirect_spacing_m: float = 0.1
    indirect_rays: int = 256
    bounces: int = 12
    seed: int = 0


@dataclass(frozen=True, slots=True)
class SunTrack:
    """Indirect light (K, h, w) of the moving sun among the lights, at times_ns (K,) increasing."""

    light: int
    times_ns: tuple[float, ...]
    bounced: Floats


@dataclass(frozen=True, slots=True)
class BakedScene:
    """A scene with its light: all that drawing a picture needs, laid out by `layout` over its inventory.

    light (L, H, W): what each light alone gives at level 1, bounces included: illuminance in lux, under a coat
    the share that enters it; a panel holds pi times its luminance. albedo: a tile per material with a body,
    under a coat already `under_coat`. A moving sun's layer is that of its first instant; see `tracks` for more.
    """

    scene: Scene
    layout: Atlas
    light: Floats
    albedo: dict[str, Map]
    settings: BakeSettings = BakeSettings()
    tracks: tuple[SunTrack, ...] = ()


@dataclass(frozen=True, slots=True)
class StaticScene:
    """What still stands of a scene, as rays and as points."""

    things: SurfaceList
    static: tuple[int, ...]
    sight: Visibility
    where: Atlas
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


def static_scene(scene: Scene, where: Atlas, *, seed: int) -> StaticScene:
    """A scene without its movers."""
    things = inventory(scene)
    static = tuple(np.flatnonzero(things.mover < 0).tolist())
    sight = Visibility(things.surfaces, scene.materials, static)
    points = texels(things.surfaces, scene.materials, where, among=static, seed=seed)
    points = outside(points, where, sight, things.panel >= 0)
    return StaticScene(things, static, sight, where, points, holes(where, points.index))


class _Work:
    """How much of the work of a bake is done, in rays, and whom to tell."""

    def __init__(self, scene: Scene, coarse: StaticScene, where: Atlas, settings: BakeSettings, tell: Tell) -> None:
        self._done, self._tell = 0.0, tell
        self.tile = TILE_PIXEL
        self.gathered = GATHERED_RAY * settings.indirect_rays
        self.lit = float(settings.light_rays * sum(patch.rows * patch.columns for patch in where.patches))
        pixels = sum(texture.resolution_px**2 for texture in map(texture_of, scene.materials.values()) if texture)
        shone = sum(len(_shining(scene.lights[i], coarse, t_ns=t_ns)) for i, t_ns in _instants(scene))
        self._all = self.tile * pixels + self.gathered * len(coarse.points) + self.lit * shone

    def did(self, rays: float) -> None:
        """Look whether to stop, and tell of the share that is done now."""
        stop.check()
        self._done += rays
        self._tell(min(self._done / self._all, 1.0))


def bake(scene: Scene, settings: BakeSettings, tell: Tell = lambda _: None) -> BakedScene:
    """Make the textures and compute the light of a scene; the same bytes for the same arguments.

    `tell` hears now and then which share of the work is done, about.
    """
    coarse = static_scene(scene, placed(scene, spacing_m=settings.indirect_spacing_m), seed=settings.seed)
    where = placed(scene, spacing_m=settings.spacing_m, sunlit=_sunlit(scene, coarse, settings))
    work = _Work(scene, coarse, where, settings, tell)
    albedo = tiles(scene, done=lambda pixels: work.did(work.tile * pixels))
    fine = static_scene(scene, where, seed=settings.seed)
    scales = Scales(fine.where, coarse.where)
    gathered = _gathered(scene, coarse, albedo, settings, done=lambda points: work.did(work.gathered * points))
    instants = _instants(scene)
    light = np.zeros((len(scene.lights), fine.where.height, fine.where.width), np.float32)
    straight = np.zeros((len(instants), coarse.where.height, coarse.where.width), np.float32)
    # Backwards, so that a moving sun's layer ends as that of its first instant.
    for row, (index, t_ns) in reversed(list(enumerate(instants))):
        light[index] = direct_layer(scene, index, fine, settings, t_ns=t_ns, done=lambda: work.did(work.lit))
        straight[row] = scales.coarsened(light[index, None])[0]
    own_sky = _own_sky(scene, instants)
    around = bounced(straight, gathered, own_sky, coarse.holes, bounces=settings.bounces)
    first = [instants.index((index, key_times_ns(one)[0])) for index, one in enumerate(scene.lights)]
    light += scales.refined(around[first])
    return BakedScene(scene, fine.where, light, albedo, settings, _tracks(scene, instants, around))


def _instants(scene: Scene) -> list[tuple[int, float]]:
    """Every light, by its index, at every time in ns that it is baked for."""
    return [(index, t_ns) for index, light in enumerate(scene.lights) for t_ns in key_times_ns(light)]


def tiles(scene: Scene, done: Callable[[int], object]) -> dict[str, Map]:
    """Every body's tile: reflectance, or what a coat makes of it; `done` is told of how many pixels."""
    made: dict[str, Map] = {}
    for name, material in sorted(scene.materials.items()):
        texture = texture_of(material)
        if texture is not None:
            tile = reflectance(texture)
            if isinstance(material, Polished):
                tile = under_coat(tile.astype(float), material.eta).astype(np.float32)
            made[name] = tile
            done(tile.size)
    return made


def _gathered(
    scene: Scene, coarse: StaticScene, albedo: dict[str, Map], settings: BakeSettings, *, done: Callable[[int], object]
) -> FinalGather:
    answer = surface_responses(coarse.things.surfaces, scene.materials, albedo, coarse.things.panel)
    skies = [light for light in scene.lights if isinstance(light, Sky)]
    rays = settings.indirect_rays
    return final_gather(coarse.points, coarse.where, coarse.sight, answer, skies, rays=rays, done=done)


def _sunlit(scene: Scene, coarse: StaticScene, settings: BakeSettings) -> NDArray[np.bool_]:
    """The surfaces (S,) on which the sun throws shadows, at any of the instants it is baked for."""
    lit = np.zeros(len(coarse.things.surfaces), bool)
    for index, light in enumerate(scene.lights):
        for t_ns in key_times_ns(light) if isinstance(light, Sun) else ():
            layer = direct_layer(scene, index, coarse, settings, t_ns=t_ns)
            lit |= [bool(layer[patch.window].any()) for patch in coarse.where.patches]
    return lit


def _own_sky(scene: Scene, instants: list[tuple[int, float]]) -> dict[int, int]:
    """Which of the skies' rows belongs to which layer."""
    skies = [row for row, (index, _) in enumerate(instants) if isinstance(scene.lights[index], Sky)]
    return {row: sky for sky, row in enumerate(skies)}


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


def direct_layer(
    scene: Scene,
    index: int,
    fine: StaticScene,
    settings: BakeSettings,
    *,
    t_ns: float,
    done: Callable[[], object] = lambda: None,
) -> Floats:
    """What one light gives straight (H, W), its panel's glow included; `done` is told of each source that it has."""
    light, total = scene.lights[index], np.zeros(len(fine.points), np.float32)
    for source in _shining(light, fine, t_ns=t_ns):
        some = np.flatnonzero(reached(source, fine))
        side = round(np.sqrt(settings.light_rays))
        total[some] += direct_light(source, fine.points.take(some), fine.where, fine.sight, side=side)
        done()
    layer = fine.holes.filled(total).reshape(fine.where.height, fine.where.width)
    if isinstance(light, Sky):
        return _smoothed(layer, fine.where)
    if isinstance(light, AreaLight):
        panel = int(np.flatnonzero(fine.things.panel == scene.panels.index(light))[0])
        layer[fine.where.patches[panel].window] = np.pi * light.luminance_cd_m2
    return layer


def _shining(light: Light, on: StaticScene, *, t_ns: float) -> list[Emitter]:
    """What of a light shines on a scene: itself, its panes, its images in mirrors."""
    return [*emitters(light, on.sight, t_ns=t_ns), *mirror_images(light, on.sight, t_ns=t_ns)]


def reached(source: Emitter, fine: StaticScene) -> NDArray[np.bool_]:
    """The points (P,) a source may light."""
    ahead = in_front(source.ball(), fine.points.points_m, fine.points.normals)
    return ahead & sees_open_sky(source, fine.points, fine.sight) if isinstance(source, OpenSky) else ahead


def _smoothed(layer: Floats, where: Atlas) -> Floats:
    """The sky's shadows are so soft that averaging neighbours takes noise away, and nothing else."""
    smooth = layer.copy()
    for patch in where.patches:
        smooth[patch.window] = scipy.ndimage.gaussian_filter(layer[patch.window], SKY_SMOOTHING, mode="nearest")
    return smooth


LIGHT, PATCHES, SETTINGS = "light.npy", "patches.npy", "settings.json"


def save_baked(folder: Path, baked: BakedScene) -> None:
    """Write the maps of a baked scene into a folder."""
    (folder / SETTINGS).write_text(json.dumps(asdict(baked.settings)))
    np.save(folder / LIGHT, baked.light)
    patches = [(p.row, p.column, p.rows, p.columns) for p in baked.layout.patches]
    np.save(folder / PATCHES, np.array(patches, np.int32))
    for name, tile in baked.albedo.items():
        np.save(folder / f"albedo.{name}.npy", tile)
    for track in baked.tracks:
        np.savez(folder / f"sun.{track.light}.npz", times_ns=track.times_ns, bounced=track.bounced)


def load_baked(folder: Path, scene: Scene) -> BakedScene:
    """The maps that `save_baked` wrote, for the same scene. Raises RenderError where they are damaged."""
    try:
        settings = BakeSettings(**json.loads((folder / SETTINGS).read_text()))
        light = np.load(folder / LIGHT)
        patches = tuple(Chart(*row) for row in np.load(folder / PATCHES).tolist())
        bodies = [name for name, material in sorted(scene.materials.items()) if texture_of(material)]
        albedo = {name: np.load(folder / f"albedo.{name}.npy") for name in bodies}
        tracks = tuple(_track(folder / f"sun.{sun}.npz", sun) for sun in moving_suns(scene))
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        raise RenderError(f"the scene's light cannot be read ({error}); delete this folder: {folder}") from error
    return BakedScene(scene, Atlas(patches, *light.shape[1:]), light, albedo, settings, tracks)


def _track(path: Path, sun: int) -> SunTrack:
    with path.open("rb") as file, np.load(file) as stored:  # np.load leaves a torn file open
        return SunTrack(sun, tuple(stored["times_ns"].tolist()), stored["bounced"])
