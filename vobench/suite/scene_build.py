"""Builds the scene that a scene's YAML describes: shapes, furniture, models, what its maker makes, and lights."""

import json
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import TypeVar

import numpy as np

from vobench.asset.furniture import Part
from vobench.asset.outdoors import walker
from vobench.asset.panorama import Surroundings
from vobench.asset.room import FINISHES, OUTWARD, Instance, Opening, Piece, shell, things
from vobench.asset.shape import at, block, card
from vobench.errors import SuiteError, VobenchError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene import scene as scripted
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import LUMINANCE, WHITE, Material, emitted_cd_m2
from vobench.scene.mesh import Thing, areas_m2, corners, moved
from vobench.scene.scene import Scene
from vobench.suite.maker_message import MakerScene
from vobench.suite.scene_check import materials_used
from vobench.suite.scene_file import scene_content
from vobench.suite.scene_lighting import SKY, SUN, Lighting, with_lighting
from vobench.suite.scene_spec import ModelSpec, MoverSpec, PanoramaSpec, SceneFile, SunSpec, unit_luminance_colour


def build(spec: SceneFile, lighting: Lighting) -> Scene:
    """The scene under a lighting. Raises SuiteError where the lighting names a light that is not there."""
    made = _made(spec)
    return replace(made, lights=with_lighting(made.lights, lighting))


KEPT_SCENES = 16
KEPT_PIECES = 512
_scenes: OrderedDict[str, Scene] = OrderedDict()
_pieces: OrderedDict[str, Instance] = OrderedDict()
Made = TypeVar("Made")


def _kept(last: OrderedDict[str, Made], most: int, key: str, make: Callable[[], Made]) -> Made:
    """What was made of that key, or is now; the `most` that were asked for last are kept."""
    if key not in last:
        last[key] = make()
    last.move_to_end(key)
    while len(last) > most:
        last.popitem(last=False)
    return last[key]


def _made(spec: SceneFile) -> Scene:
    """The scene in its own light; some take seconds to make."""
    return _kept(_scenes, KEPT_SCENES, json.dumps(scene_content(spec)), lambda: _make(spec))


@dataclass(frozen=True, slots=True)
class Contents:
    """Some of what a scene holds: things, their materials by name, lights and movers."""

    things: tuple[Thing, ...] = ()
    materials: Mapping[str, Material] = field(default_factory=dict)
    lights: tuple[Light, ...] = ()
    movers: tuple[scripted.Mover, ...] = ()


def _make(spec: SceneFile) -> Scene:
    parts = [_built(spec), *_from_maker(spec), *map(_model, spec.meshes), Contents(lights=tuple(listed_lights(spec)))]
    parts += [_mover(mover, spec) for mover in spec.movers]
    materials = {name: material for part in parts for name, material in part.materials.items()}
    found = [thing for part in parts for thing in part.things]
    glowing = {name for name, material in materials.items() if emitted_cd_m2(material).max() > 0}
    own = [light for part in parts for light in part.lights]
    made = Scene(
        spec.name,
        tuple(thing for thing in found if thing.material not in glowing),
        materials,
        (*own, *_glow([thing for thing in found if thing.material in glowing], materials)),
        tuple(mover for part in parts for mover in part.movers),
    )
    return made if spec.scale == 1 else scripted.sized(made, spec.scale)


def _material(name: str, spec: SceneFile) -> Material:
    """What the scene calls so, or a finish that every scene has."""
    return spec.materials[name].build() if name in spec.materials else _finish(name)


@cache
def _finish(name: str) -> Material:
    return FINISHES[name]()


def _built(spec: SceneFile) -> Contents:
    """The room, boxes, boards and furniture."""
    of = cache(partial(_material, spec=spec))
    instances = [*_room(spec, of), *_boxes(spec, of)]
    for piece in spec.furniture:
        with _sentence(f"furniture '{piece.name}'"):
            made = Piece(piece.kind, piece.name, piece.at_m, piece.yaw_deg, piece.pitch_deg, piece.size)
            key = json.dumps([asdict(made), spec.seed])  # scenes with other walls share it
            instances.append(_kept(_pieces, KEPT_PIECES, key, partial(made.build, spec.seed)))
    used = {*spec.materials, *(name for _, name in materials_used(spec))}
    return Contents(*things(instances, {name: of(name) for name in sorted(used)}))


def _room(spec: SceneFile, of: Callable[[str], Material]) -> Iterator[Instance]:
    room = spec.room
    if room is None:
        return
    openings = [Opening(w.wall, w.center_m, w.size_m, w.depth_m) for w in room.windows]
    walls = {side: of(room.walls.get(side, room.wall)) for side in OUTWARD}
    for name, parts in shell(room.size_m, openings, floor=of(room.floor), ceiling=of(room.ceiling), walls=walls):
        if name.startswith("window_"):
            window = room.windows[int(name.removeprefix("window_"))]
            looks = of(window.reveal), of(window.pane)
            yield name, [replace(part, material=look) for part, look in zip(parts, looks, strict=True)]
        else:
            yield name, parts


def _boxes(spec: SceneFile, of: Callable[[str], Material]) -> Iterator[Instance]:
    for index, box in enumerate(spec.boxes):
        mesh = block(box.size_m, bevel_m=0, transform=at(*box.center_m, yaw=box.yaw_deg))
        yield box.name or f"box_{index}", [Part(mesh, of(box.material))]
    for index, board in enumerate(spec.boards):
        material = of(board.material)
        whole_tile = (0.0, material.tile_m, 0.0, material.tile_m)
        mesh = moved(card(board.size_m, cell=whole_tile), at(*board.center_m, yaw=board.yaw_deg))
        yield board.name or f"board_{index}", [Part(mesh, material)]


def _from_maker(spec: SceneFile) -> Iterator[Contents]:
    """What the scene's maker returns."""
    if spec.maker is not None:
        # By its name, so that a change of the sandbox does not change the keys of scenes.
        maker = import_module("vobench.suite.maker")
        made: MakerScene = maker.made_by(Path(spec.maker), seed=spec.seed, scene=spec.name)
        yield Contents(made.things, made.materials, made.lights)


@contextmanager
def _sentence(where: str) -> Iterator[None]:
    """Whatever a maker raises as a SuiteError that names it."""
    try:
        yield
    except VobenchError:
        raise
    except Exception as error:  # the user's code may raise anything
        raise SuiteError(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}") from error


def _model(spec: ModelSpec) -> Contents:
    """A model where it stands; with a name of its own, the names in it begin with that."""
    from vobench.asset.model import read_model

    model = read_model(spec.file, scale=spec.scale, up=spec.up, roles=spec.roles)
    T = at(*spec.at_m, yaw=spec.yaw_deg)
    before = f"{spec.name}." if spec.name else ""
    placed = tuple(
        replace(thing, name=before + thing.name, mesh=moved(thing.mesh, T), material=before + thing.material)
        for thing in model.everything
    )
    lights = tuple(_moved(replace(light, name=before + light.name), T) for light in model.lights)
    return Contents(placed, {before + name: material for name, material in model.materials.items()}, lights)


def _moved(light: Light, T_world_model: Array) -> Light:
    if isinstance(light, Sun):
        turn = float(np.rad2deg(np.arctan2(T_world_model[1, 0], T_world_model[0, 0])))
        return replace(light, azimuth_deg=tuple(azimuth + turn for azimuth in light.azimuth_deg))
    if not isinstance(light, PointLight | SpotLight):
        return light
    placed = replace(light, position_m=se3.apply(T_world_model, light.position_m[None])[0])
    if isinstance(placed, SpotLight):
        placed = replace(placed, direction=T_world_model[:3, :3] @ placed.direction)
    return placed


def listed_lights(spec: SceneFile) -> Iterator[Light]:
    """The lights that a scene's file lists as such: lamps, sun and sky."""
    yield from (lamp.build() for lamp in spec.lamps)
    if spec.sun:
        yield _sun(spec.sun)
    if spec.sky:
        # A clear sky is brightest around where the sun stands at first, or overhead without a sun.
        toward = _sun(spec.sun).direction(0) if spec.sun else np.array([0.0, 0.0, 1.0])
        yield Sky(
            SKY,
            spec.sky.illuminance_lx,
            spec.sky.kind,
            toward,
            level=spec.sky.level.build(),
            colour=unit_luminance_colour(spec.sky.colour),
            panorama=_panorama(spec.sky.panorama, spec.sun),
        )


def _panorama(panorama: PanoramaSpec | None, sun: SunSpec | None) -> Surroundings | None:
    """What surrounds a scene, in the light of its sun."""
    if panorama is None:
        return None
    sun_lx = sun.illuminance_lx if sun else 0.0
    sun_colour = unit_luminance_colour(sun.colour) if sun else WHITE
    return Surroundings(
        kind=panorama.kind,
        seed=panorama.seed,
        height_m=panorama.height_m,
        distance_m=panorama.distance_m,
        sun_lx=sun_lx,
        sun_colour=sun_colour,
    )


def _sun(sun: SunSpec) -> Sun:
    path = [(key.t_s, key.azimuth_deg, key.elevation_deg) for key in sun.path]
    if sun.azimuth_deg is not None and sun.elevation_deg is not None:
        path = [(0.0, sun.azimuth_deg, sun.elevation_deg)]
    times_s, azimuth_deg, elevation_deg = zip(*path, strict=True)
    return Sun(
        SUN,
        sun.illuminance_lx,
        times_s,
        azimuth_deg,
        elevation_deg,
        sun.level.build(),
        unit_luminance_colour(sun.colour),
    )


def _glow(things: Sequence[Thing], materials: Mapping[str, Material]) -> Iterator[AreaLight]:
    """Every thing that shines as a light; those of one name are numbered."""
    count = Counter[str]()
    for thing in things:
        emission = emitted_cd_m2(materials[thing.material])
        luminance = float(emission @ np.array(LUMINANCE))
        nth = count[thing.name]
        count[thing.name] = count[thing.name] + 1
        red, green, blue = (emission / luminance).tolist()
        name = f"{thing.name}.{nth}" if nth else thing.name
        power_lm = luminance * np.pi * areas_m2(corners(thing.mesh)).sum()
        colour = (red, green, blue)
        yield AreaLight(name, thing.mesh, power_lm, colour=colour, material=thing.material)


def _mover(mover: MoverSpec, spec: SceneFile) -> Contents:
    columns = zip(*((key.t_s, key.position_m, key.yaw_deg) for key in mover.path), strict=True)
    times_s, positions_m, yaw_deg = (np.array(column, float) for column in columns)
    path = scripted.WaypointMotion(times_s, positions_m, yaw_deg, mover.repeats)
    if mover.kind == "person":
        return _walker(mover.name, path, spec.seed)
    if mover.file:
        own = _model(ModelSpec(file=mover.file, name=mover.name))
    elif mover.kind:
        with _sentence(f"mover '{mover.name}'"):
            own = Contents(*things([Piece(mover.kind, mover.name, (0.0, 0.0, 0.0)).build(spec.seed)]))
    else:
        mesh = block(mover.size_m or (), bevel_m=0)
        look = mover.material or ""
        own = Contents((Thing(mover.name, mesh, look),), {look: _material(look, spec)})
    moving = tuple(replace(thing, name=mover.name) for thing in own.things)
    return Contents(materials=own.materials, movers=(scripted.Mover(mover.name, moving, path),))


def _walker(name: str, path: scripted.WaypointMotion, seed: int) -> Contents:
    """Somebody who walks a path: a mover for each of their limbs, all of one name."""
    who = walker(Piece("person", name, (0.0, 0.0, 0.0)).rng(seed))
    made, materials = things([(f"{name}.{nth}", limb.parts) for nth, limb in enumerate(who.limbs)])
    movers = []
    for nth, limb in enumerate(who.limbs):
        own = tuple(replace(thing, name=name) for thing in made if thing.name == f"{name}.{nth}")
        gait = scripted.LimbMotion(path, who.cycle_m, limb.joints_m, limb.pitch_rad, who.rise_m)
        movers.append(scripted.Mover(name, own, gait))
    return Contents(materials=materials, movers=tuple(movers))
