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
from vobench.rendering.array_types import Floats, Indices, Mask
from vobench.rendering.atlas import Atlas
from vobench.rendering.direct_light import direct_light, mirror_images
from vobench.rendering.emitter import emitters
from vobench.rendering.geometry import FAR_M, RayCaster, face_materials, offset_from_surface
from vobench.rendering.indirect_light import FinalGather, Gatherer, albedo, blend, bounced, response, surfels
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.rendering.visibility import Visibility
from vobench.scene.light import NS_PER_S, AreaLight, Light, Sky, Sun
from vobench.scene.material import Material, Picture, Texture
from vobench.scene.mesh import Triangles, areas_m2, distinct
from vobench.scene.scene import Scene, triangles
from vobench.setting import Positive, settings

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

Report = Callable[[float], object]
MOVER_COARSER = 2
SUNLIT_FINER = 2  # the half shadow of the sun is 1 cm wide for each metre to what casts it
CELL_TEXELS = 2.5  # along a surfel's side at least, where samples are far apart
PROBES_M = 0.25  # between places that ask whether the sun reaches a face
# the shares of a bake that are done after each, about
PLACED_DONE = 0.1
GATHER_DONE = 0.4
SMALL_M2 = 10.0  # of a thing that is sunlit as a whole
SKY_RAYS = 64  # at least from a surfel to tell whether it sees the sky
BLIND = 0.02  # of a surfel's rays: one that sees less is inside something
TEXTURE_FIELDS = ("texture", "emission_texture")
SAMPLES = 4_000_000  # of light, by default: what a bake of minutes takes
UNSEEN = 1e-3  # hits, of a texel that no ray has found
SUN_STEP_RAD = np.deg2rad(3)  # between the suns whose indirect light is baked


@settings(kw_only=False)
class BakeSettings:
    """How finely light is sampled; rays per sample are squares so that they can be stratified.

    bounces: at most; they end where they add no more.
    """

    spacing_m: Positive = 0.025
    light_rays: Annotated[int, Ge(1)] = 16
    indirect_spacing_m: Positive = 0.1
    indirect_rays: Annotated[int, Ge(0)] = 100
    bounces: Annotated[int, Ge(0)] = 64
    seed: Annotated[int, Ge(0)] = 0


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

    direct (L, H, W): what each light alone gives straight at level 1 if it is white: illuminance in lux, under a coat
    the share that enters it; on a lamp pi times its luminance. bounced (L, S, 3): what it gives surfels by bounces;
    spread (H·W, S) lays that on the map. A moving sun's layers are those of its first instant; see `tracks` for more.
    """

    scene: Scene
    faces: Triangles
    atlas: Atlas
    direct: Floats
    bounced: Floats
    spread: "csr_matrix"
    patches: Patches
    settings: BakeSettings = field(default_factory=BakeSettings)
    tracks: tuple[SunTrack, ...] = ()

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
    own = face_materials(faces, scene.materials)
    return np.array([material is not None and material.kind == "body" for material in own], bool)[faces.thing]


def spacings_m(scene: Scene, faces: Triangles, settings: BakeSettings) -> Array:
    """Between samples on each face (F,): what its thing asks for, finer where it is sunlit, coarser on movers.

    On what asks for nothing it grows with the scene, so that SAMPLES do.
    """
    asked = np.array([thing.spacing_m or 0.0 for thing in faces.things])[faces.thing]
    share = np.where(_sunlit(scene, faces), 1 / SUNLIT_FINER, 1.0)
    spacing_m = np.where(asked, asked, settings.spacing_m) * np.where(faces.mover < 0, share, MOVER_COARSER)
    own = bodies(scene, faces) & (asked == 0)
    samples = (areas_m2(faces.corners_m[own]) / spacing_m[own] ** 2).sum()
    return np.asarray(spacing_m * np.where(own, max(1.0, float(np.sqrt(samples / SAMPLES))), 1.0))


def _sunlit(scene: Scene, faces: Triangles) -> Mask:
    """The faces (F,) of planes and small things that the sun reaches, at any of the instants it is baked for."""
    lit = np.zeros(len(faces), bool)
    suns = [light for light in scene.lights if isinstance(light, Sun)]
    static = np.flatnonzero(bodies(scene, faces) & (faces.mover < 0))
    if not suns or not len(static):
        return lit
    area_m2 = areas_m2(faces.corners_m)
    which = np.repeat(static, 1 + (area_m2[static] / PROBES_M**2).astype(int))
    a, b = np.random.default_rng(0).random((2, len(which), 1))
    first, second, third = faces.corners_m[which].swapaxes(0, 1)
    points = offset_from_surface(first + np.sqrt(a) * (second - first + b * (third - second)), faces.plane[which])
    caster = RayCaster(faces, np.flatnonzero((faces.mover < 0) & ~_panes(scene, faces)))
    for way in [sun.direction(t_ns) for sun in suns for t_ns in key_times_ns(sun)]:
        faced = np.flatnonzero(faces.plane[which] @ way > 0)
        shaded = caster.stops(points[faced], np.broadcast_to(FAR_M * way, (len(faced), 3)))
        lit[which[faced[~shaded]]] = True
    # All of a plane and of a small thing, so that no map changes its spacing amid either.
    small = np.bincount(faces.thing, area_m2)[faces.thing] < SMALL_M2
    offset = np.rint(np.einsum("ij,ij->i", faces.plane, faces.corners_m[:, 0]) * 1e3)
    keys = np.column_stack([faces.thing, *(np.where(small, 0, x) for x in (*np.rint(faces.plane * 1e3).T, offset))])
    group = distinct(keys)[1]
    return np.asarray((np.bincount(group, lit) > 0)[group])


def _panes(scene: Scene, faces: Triangles) -> Mask:
    return np.array([m is not None and m.kind == "pane" for m in face_materials(faces, scene.materials)])[faces.thing]


def static_points(scene: Scene, faces: Triangles, atlas: Atlas, seed: int) -> tuple[Visibility, Texels, TexelLayout]:
    """A scene without its movers, as rays and as points, and these on the map."""
    static = faces.mover < 0
    visibility = Visibility(faces, scene.materials, np.flatnonzero(static))
    on_map = owners(atlas)
    own = texels(faces, scene.materials, atlas, on_map, among=static, seed=seed, visibility=visibility)
    return visibility, *own


def static_scene(baked: BakedScene) -> StaticScene:
    """What does not move of a baked scene, once more."""
    visibility, points, layout = static_points(baked.scene, baked.faces, baked.atlas, baked.settings.seed)
    cells = baked.patches.surfel_of[points.index]
    every = np.ones(len(points), bool)
    return StaticScene(baked.faces, visibility, baked.atlas, points, layout, cells, every)


def bake(scene: Scene, settings: BakeSettings, report: Report = lambda _: None) -> BakedScene:
    """Compute the light of a scene; the same bytes for the same arguments.

    `report` is called now and then with the share of the work that is done, about.
    """
    faces = triangles(scene)
    spacing_m = spacings_m(scene, faces, settings)
    atlas = unwrap(faces, spacing_m, bodies(scene, faces))
    visibility, points, layout = static_points(scene, faces, atlas, settings.seed)
    thing = faces.thing[points.face]
    step_m = np.maximum(settings.indirect_spacing_m, CELL_TEXELS * spacing_m[points.face]).astype(np.float32)
    groups = surfels(points, thing, step_m, visibility)
    surfel_of = np.append(groups.of, np.int32(-1))[layout.source]
    report(PLACED_DONE)
    skies = [light for light in scene.lights if isinstance(light, Sky)]
    gatherer = Gatherer(
        atlas,
        visibility,
        response(faces, scene.materials, visibility),
        skies,
        surfel_of,
        len(groups),
        len(scene.lights),
    )
    rays = max(settings.indirect_rays, SKY_RAYS if skies else 0)
    gathered = gatherer.gather(
        points.take(groups.middle),
        rays=rays,
        done=lambda share: report(PLACED_DONE + (GATHER_DONE - PLACED_DONE) * share),
    )
    usable = np.asarray(gathered.table.sum(1)).ravel() + gathered.escaped > BLIND
    spread = blend(points, groups, layout, visibility, usable)
    open_sky = (spread @ gathered.escaped)[points.index] > 0
    still = StaticScene(faces, visibility, atlas, points, layout, groups.of, open_sky)
    # What rays have found of a surfel stands for it, not what hides under a rug.
    weights = np.bincount(layout.source, gathered.hits, len(points) + 1)[: len(points)] + UNSEEN
    scatters = albedo(faces, scene.materials, points)
    instants = [(index, t_ns) for index, light in enumerate(scene.lights) for t_ns in key_times_ns(light)]
    direct = np.zeros((len(scene.lights), atlas.height, atlas.width), np.float32)
    received = np.zeros((len(instants), len(groups), 3), np.float32)
    # Backwards, so that a moving sun's layer ends as that of its first instant.
    for row, (index, t_ns) in reversed(list(enumerate(instants))):
        light = direct_points(scene, index, still, settings, t_ns=t_ns)
        received[row] = groups.mean(scatters * light[:, None], weights)
        direct[index] = direct_layer(scene, index, still, light)
        report(1 - (1 - GATHER_DONE) * row / len(instants))
    reflectance = groups.mean(scatters, weights)
    del still, points, layout  # bounces take memory of their own
    by_mirrors = _by_mirrors(scene, [index for index, _ in instants], gathered, len(groups))
    around = bounced(received, reflectance, gathered, by_mirrors, bounces=settings.bounces)
    first = [instants.index((index, key_times_ns(one)[0])) for index, one in enumerate(scene.lights)]
    areas = _point_areas_m2(faces, thing)
    patches = Patches(
        surfel_of,
        reflectance,
        np.bincount(groups.of, areas, len(groups)),
        received[first] + reflectance * around[first],
    )
    return BakedScene(
        scene, faces, atlas, direct, around[first], spread, patches, settings, _tracks(instants, around, scene)
    )


def _point_areas_m2(faces: Triangles, thing: Indices) -> Array:
    """The area (P,) that each point stands for among all of its thing's, whose index (P,) is given."""
    of_thing = np.bincount(faces.thing, areas_m2(faces.corners_m))
    return np.asarray(of_thing[thing] / np.bincount(thing, minlength=len(of_thing))[thing])


def _by_mirrors(scene: Scene, rows: list[int], gathered: FinalGather, surfels: int) -> Floats:
    """Illuminance (K, S) of surfels by lamps and the sky that rays found by way of mirrors, of lights `rows` (K,)."""
    result = np.zeros((len(rows), surfels), np.float32)
    skies = [i for i, x in enumerate(scene.lights) if isinstance(x, Sky)]
    for row, index in enumerate(rows):
        light = scene.lights[index]
        if isinstance(light, AreaLight):
            shown = gathered.table[:, surfels + index].toarray().ravel()
            result[row] = np.pi * light.luminance_cd_m2 * shown
        elif isinstance(light, Sky):
            result[row] = gathered.sky[skies.index(index)]
    return result


def _tracks(instants: list[tuple[int, float]], around: Floats, scene: Scene) -> tuple[SunTrack, ...]:
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
    azimuth = np.deg2rad(sun.azimuth_deg)
    elevation = np.abs(np.deg2rad(sun.elevation_deg))
    across = np.diff(azimuth) * np.cos(np.minimum(elevation[1:], elevation[:-1]))
    return np.concatenate([[0.0], np.cumsum(np.hypot(across, np.diff(np.deg2rad(sun.elevation_deg))))])


def direct_points(scene: Scene, index: int, still: StaticScene, settings: BakeSettings, *, t_ns: float) -> Floats:
    """What one light gives the points straight (P,)."""
    light = scene.lights[index]
    total = np.zeros(len(still.points), np.float32)
    side = round(np.sqrt(settings.light_rays))
    shown = mirror_images(light, still.visibility, t_ns=t_ns)
    for emitter in [*emitters(light, still.visibility, t_ns=t_ns), *shown]:
        stop.check()
        among = still.open_sky if emitter.sky == "open" else np.ones(len(still.points), bool)
        total += direct_light(
            emitter, still.points, still.layout, still.cells, still.visibility, side=side, among=among
        )
    return total


def direct_layer(scene: Scene, index: int, still: StaticScene, light: Floats) -> Floats:
    """The map (H, W) of what one light gives the points straight (P,), its own glow included."""
    layer = still.layout.filled(light)
    lamp = scene.lights[index]
    if isinstance(lamp, AreaLight):
        layer[still.atlas.block(int(np.flatnonzero(still.faces.lamp == index)[0]))] = np.pi * lamp.luminance_cd_m2
    return layer


LIGHT = "light.npy"
PLACES = "surfels.npz"
TEXTURES = "textures.npz"
SETTINGS_FILE = "settings.json"


def save_baked(folder: Path, baked: BakedScene) -> None:
    """Write the light of a baked scene into a folder, and its textures as they were painted for it."""
    (folder / SETTINGS_FILE).write_text(json.dumps(asdict(baked.settings)))
    np.save(folder / LIGHT, baked.direct)
    atlas = baked.atlas
    patches = baked.patches
    spread = baked.spread
    np.savez(
        folder / PLACES,
        light_px=atlas.light_px,
        chart=atlas.chart,
        bounced=baked.bounced,
        **{f"spread_{name}": getattr(spread, name) for name in ("data", "indices", "indptr")},
        **{field.name: getattr(patches, field.name) for field in fields(Patches)},
    )
    for track in baked.tracks:
        np.savez(folder / f"sun.{track.light}.npz", times_ns=track.times_ns, bounced=track.bounced)
    materials = baked.scene.materials
    seen = {thing.material for thing in baked.faces.things} & materials.keys()
    shown = {id(getattr(materials[name], part)) for name in seen for part in TEXTURE_FIELDS}
    painted: dict[str, Any] = {name: t.pixels() for name, t in _textures(materials).items() if id(t) in shown}
    np.savez(folder / TEXTURES, **painted)


def _textures(materials: Mapping[str, Material]) -> dict[str, Texture]:
    """The textures that are no pictures yet, each by the first material and the field that have it."""
    found = {
        id(texture): (f"{name}.{part}", texture)
        for name, material in reversed(list(materials.items()))
        for part in TEXTURE_FIELDS
        if (texture := getattr(material, part)) is not None and not isinstance(texture, Picture)
    }
    return dict(found.values())


def _with_pictures(scene: Scene, pictures: Mapping[str, Any]) -> Scene:
    """The scene with pictures, by the names of `_textures`, in place of textures that would be painted once more."""
    own = {id(t): Picture(pictures[n], t.tile_m) for n, t in _textures(scene.materials).items() if n in pictures}

    def ready(material: Material) -> Material:
        return replace(material, **{p: own.get(id(t := getattr(material, p)), t) for p in TEXTURE_FIELDS})

    return replace(scene, materials={name: ready(material) for name, material in scene.materials.items()})


def load_baked(folder: Path, scene: Scene) -> BakedScene:
    """The light that `save_baked` wrote, for the same scene. Raises RenderError where it is damaged."""
    try:
        settings = BakeSettings(**json.loads((folder / SETTINGS_FILE).read_text()))
        shown = _with_pictures(scene, _load(folder / TEXTURES))
        light = np.load(folder / LIGHT)
        kept = _load(folder / PLACES)
        suns = {sun: _load(folder / f"sun.{sun}.npz") for sun in moving_suns(scene)}
        tracks = tuple(SunTrack(sun, tuple(own["times_ns"].tolist()), own["bounced"]) for sun, own in suns.items())
        atlas = Atlas(kept["light_px"], kept["chart"], *light.shape[1:])
        patches = Patches(*(kept[field.name] for field in fields(Patches)))
        shape = (light[0].size if len(light) else atlas.height * atlas.width, len(patches.area_m2))
        spread = scipy.sparse.csr_matrix(tuple(kept[f"spread_{name}"] for name in ("data", "indices", "indptr")), shape)
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, SettingError) as error:
        raise RenderError(f"the scene's light cannot be read ({error}); delete this folder: {folder}") from error
    return BakedScene(shown, triangles(scene), atlas, light, kept["bounced"], spread, patches, settings, tracks)


def _load(path: Path) -> dict[str, Any]:
    with path.open("rb") as file, np.load(file) as stored:  # np.load leaves a torn file open
        return dict(stored)
