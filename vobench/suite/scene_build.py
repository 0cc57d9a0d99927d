"""Builds the scene that a scene file describes: its room, boxes, furniture, models, lights and movers."""

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
from vobench.asset.room import FINISHES, OUTWARD, Instance, Opening, Piece, piece_rng, shell, things
from vobench.asset.shape import at, block, card
from vobench.errors import SuiteError, VobenchError, error_sentence
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.scene import scene as scripted
from vobench.scene.generated_place import GeneratedPlace
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import LUMINANCE, WHITE, Material, emitted_cd_m2
from vobench.scene.mesh import face_corners, moved
from vobench.scene.paint import painted
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing
from vobench.suite.floor_finish import FLOOR, with_floor
from vobench.suite.scene_check import materials_used
from vobench.suite.scene_entry import described_scene
from vobench.suite.scene_file import scene_content
from vobench.suite.scene_lighting import SKY, SUN, Lighting, with_lighting
from vobench.suite.scene_spec import ModelSpec, MoverSpec, PanoramaSpec, SceneFile, SunSpec, unit_luminance_colour


def build(spec: SceneFile, lighting: Lighting) -> Scene:
    """The scene under a lighting. Raises SuiteError if the lighting names a light that the scene does not have."""
    scene = _cached_scene(spec)
    return replace(scene, lights=with_lighting(scene.lights, lighting))


def build_once(spec: SceneFile, lighting: Lighting) -> Scene:
    """The same as `build`, but the scene is not kept for later calls, which saves memory where many are built.

    Raises SuiteError if the lighting names a light that the scene does not have.
    """
    scene = _scene(spec)
    return replace(scene, lights=with_lighting(scene.lights, lighting))


CACHED_SCENES = 16
CACHED_PIECES = 512
_scenes: OrderedDict[str, Scene] = OrderedDict()
_pieces: OrderedDict[str, Instance] = OrderedDict()
Built = TypeVar("Built")


def _cached(cache: OrderedDict[str, Built], size: int, key: str, make: Callable[[], Built]) -> Built:
    """The entry of a cache for a key, made if it is missing. The cache keeps the `size` entries used last."""
    if key not in cache:
        cache[key] = make()
    cache.move_to_end(key)
    while len(cache) > size:
        cache.popitem(last=False)
    return cache[key]


def _cached_scene(spec: SceneFile) -> Scene:
    """The scene in the light of its file, from the cache because some scenes take seconds to build."""
    return _cached(_scenes, CACHED_SCENES, json.dumps(scene_content(spec)), lambda: _scene(spec))


@dataclass(frozen=True, slots=True)
class Contents:
    """A part of a scene: things, materials by name, lights and movers."""

    things: tuple[Thing, ...] = ()
    materials: Mapping[str, Material] = field(default_factory=dict)
    lights: tuple[Light, ...] = ()
    movers: tuple[scripted.Mover, ...] = ()


def _scene(spec: SceneFile) -> Scene:
    """The scene in the light of its file. Things with an emissive material become lights."""
    whole = _joined([_generated(spec), *_props(spec)]) if spec.generated else _described(spec)
    whole = _finished(whole, spec)

    emissive = {name for name, material in whole.materials.items() if emitted_cd_m2(material).max() > 0}
    luminous_things = [thing for thing in whole.things if thing.material in emissive]
    scene = Scene(
        spec.place_name,
        tuple(thing for thing in whole.things if thing.material not in emissive),
        dict(whole.materials),
        (*whole.lights, *_area_lights(luminous_things, whole.materials)),
        whole.movers,
        spec.fog,
        spec.rain,
        spec.wind,
    )
    if scene.fog and scene.fog.airlight == "sky" and not any(isinstance(light, Sky) for light in scene.lights):
        raise SuiteError(f"{scene.name}: fog with airlight 'sky' requires a sky, and the scene has none; use 'light'")
    if scene.rain and not any(isinstance(light, Sky) for light in scene.lights):
        raise SuiteError(f"{scene.name}: rain falls from a sky, and the scene has none")
    return scene if spec.scale == 1 else scripted.sized(scene, spec.scale)


def _finished(whole: Contents, spec: SceneFile) -> Contents:
    """The contents with the floor of the spec, and under its paint. Raises SuiteError if a floor is missing."""
    if spec.floor:
        whole = replace(
            whole, things=with_floor(whole.things), materials={**whole.materials, FLOOR: spec.floor.build()}
        )
    if spec.paint:
        materials = {name: painted(material, spec.paint) for name, material in whole.materials.items()}
        whole = replace(whole, materials=materials)
    return whole


def _described(spec: SceneFile) -> Contents:
    """What the scene file lists, and what its maker returns. Raises SuiteError if it lists nothing visible."""
    described_scene(spec)
    parts = [_room_and_furniture(spec), *_from_maker(spec), *map(_model, spec.meshes)]
    parts.append(Contents(lights=tuple(listed_lights(spec))))
    parts += [_mover(mover, spec) for mover in spec.movers]
    return _joined(parts)


def _joined(parts: Sequence[Contents]) -> Contents:
    """The contents of all parts, in their order."""
    things: list[Thing] = []
    materials: dict[str, Material] = {}
    lights: list[Light] = []
    movers: list[scripted.Mover] = []
    for part in parts:
        things += part.things
        materials.update(part.materials)
        lights += part.lights
        movers += part.movers
    return Contents(tuple(things), materials, tuple(lights), tuple(movers))


def _material(name: str, spec: SceneFile) -> Material:
    """The material that the scene file defines under a name, or the finish with that name."""
    return spec.materials[name].build() if name in spec.materials else _finish(name)


@cache
def _finish(name: str) -> Material:
    return FINISHES[name]()


def _room_and_furniture(spec: SceneFile) -> Contents:
    """The room, boxes, boards and furniture."""
    material = cache(partial(_material, spec=spec))
    instances = [*_room(spec, material), *_boxes(spec, material)]
    for entry in spec.furniture:
        with _located(f"furniture '{entry.name}'"):
            piece = Piece(entry.kind, entry.name, entry.at_m, entry.yaw_deg, entry.pitch_deg, entry.size)
            key = json.dumps([asdict(piece), spec.seed])  # variants of a scene share their furniture
            instances.append(_cached(_pieces, CACHED_PIECES, key, partial(piece.build, spec.seed)))
    used_names = {*spec.materials, *(name for _, name in materials_used(spec))}
    return Contents(*things(instances, {name: material(name) for name in sorted(used_names)}))


def _room(spec: SceneFile, material: Callable[[str], Material]) -> Iterator[Instance]:
    """The walls, floor, ceiling and windows of the scene's room, if it has one."""
    room = spec.room
    if room is None:
        return
    openings = [Opening(window.wall, window.center_m, window.size_m, window.depth_m) for window in room.windows]
    walls = {side: material(room.walls.get(side, room.wall)) for side in OUTWARD}
    floor = material(room.floor)
    ceiling = material(room.ceiling)
    for name, parts in shell(room.size_m, openings, floor=floor, ceiling=ceiling, walls=walls):
        if not name.startswith("window_"):
            yield name, parts
            continue
        window = room.windows[int(name.removeprefix("window_"))]
        window_materials = (material(window.reveal), material(window.pane))
        yield name, [replace(part, material=own) for part, own in zip(parts, window_materials, strict=True)]


def _boxes(spec: SceneFile, material: Callable[[str], Material]) -> Iterator[Instance]:
    """The boxes and boards that the scene file lists."""
    for index, box in enumerate(spec.boxes):
        mesh = block(box.size_m, bevel_m=0, transform=at(*box.center_m, yaw=box.yaw_deg))
        yield box.name or f"box_{index}", [Part(mesh, material(box.material))]
    for index, board in enumerate(spec.boards):
        board_material = material(board.material)
        whole_tile = (0.0, board_material.tile_m, 0.0, board_material.tile_m)
        mesh = moved(card(board.size_m, cell=whole_tile), at(*board.center_m, yaw=board.yaw_deg))
        yield board.name or f"board_{index}", [Part(mesh, board_material)]


# Cache keys follow imports, but not this one. A change of the sandbox therefore does not change scenes' keys.
MAKER_MODULE = "vobench.suite.maker"


def _from_maker(spec: SceneFile) -> Iterator[Contents]:
    """The contents that the scene's maker returns, if the scene has a maker."""
    if spec.maker is not None:
        maker = import_module(MAKER_MODULE)
        place: GeneratedPlace = maker.create_scene(Path(spec.maker), seed=spec.seed, scene_name=spec.name)
        yield Contents(tuple(place.things), place.materials, tuple(place.lights))


def _generated(spec: SceneFile) -> Contents:
    """The contents that the scene's generator returns for the seed and the lighting of the spec."""
    if spec.generated is None or spec.generator is None:
        raise SuiteError(f"'{spec.name}' is no place of a generator; give it a generator and a seed")
    maker = import_module(MAKER_MODULE)
    place: GeneratedPlace = maker.generate_place(
        Path(spec.generator), seed=spec.generated.seed, lighting=spec.generated.lighting, scene_name=spec.name
    )
    return Contents(tuple(place.things), place.materials, tuple(place.lights))


PROP = "prop."  # before the names of materials of props, since a generator may use any other name


def _props(spec: SceneFile) -> Iterator[Contents]:
    """The boards and movers that a scenario puts into a place of a generator."""
    boards = _room_and_furniture(spec)
    things = tuple(replace(thing, material=PROP + thing.material) for thing in boards.things)
    yield Contents(things, {PROP + name: material for name, material in boards.materials.items()})
    for mover in spec.movers:
        yield _mover(mover, spec)


@contextmanager
def _located(where: str) -> Iterator[None]:
    """Turn an unexpected exception into a SuiteError that says where it occurred."""
    try:
        yield
    except VobenchError:
        raise
    except Exception as error:  # the user's code may raise anything
        raise SuiteError(f"{where}: {error_sentence(error)}") from error


def _model(spec: ModelSpec) -> Contents:
    """The contents of a model file at the pose in the scene file. All names begin with the model's name, if given."""
    from vobench.asset.model import read_model

    model = read_model(spec.file, scale=spec.scale, up=spec.up, roles=spec.roles)
    T_world_model = at(*spec.at_m, yaw=spec.yaw_deg)
    prefix = f"{spec.name}." if spec.name else ""
    placed_things = []
    for thing in model.all_things:
        mesh = moved(thing.mesh, T_world_model)
        placed = replace(thing, name=prefix + thing.name, mesh=mesh, material=prefix + thing.material)
        placed_things.append(placed)
    materials = {prefix + name: material for name, material in model.materials.items()}
    lights = tuple(_moved(replace(light, name=prefix + light.name), T_world_model) for light in model.lights)
    return Contents(tuple(placed_things), materials, lights)


def _moved(light: Light, T_world_model: Array) -> Light:
    """A light of a model at the model's pose in the world. Of a sun, only the azimuth changes."""
    if isinstance(light, Sun):
        yaw_deg = float(np.rad2deg(np.arctan2(T_world_model[1, 0], T_world_model[0, 0])))
        return replace(light, azimuth_deg=tuple(azimuth + yaw_deg for azimuth in light.azimuth_deg))
    if not isinstance(light, PointLight | SpotLight):
        return light
    position_m = se3.apply(T_world_model, light.position_m[None])[0]
    placed = replace(light, position_m=position_m)
    if isinstance(placed, SpotLight):
        placed = replace(placed, direction=T_world_model[:3, :3] @ placed.direction)
    return placed


def listed_lights(spec: SceneFile) -> Iterator[Light]:
    """The lights that a scene file lists: lamps, sun and sky."""
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
    """The sun of a scene file, with one position or several at given times."""
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


def _area_lights(things: Sequence[Thing], materials: Mapping[str, Material]) -> Iterator[AreaLight]:
    """An area light for each luminous thing. Lights of things with the same name are numbered."""
    counts = Counter[str]()
    for thing in things:
        emission = emitted_cd_m2(materials[thing.material])
        luminance = float(emission @ np.array(LUMINANCE))
        number = counts[thing.name]
        counts[thing.name] += 1
        name = f"{thing.name}.{number}" if number else thing.name
        power_lm = luminance * np.pi * areas_m2(face_corners(thing.mesh)).sum()
        red, green, blue = (emission / luminance).tolist()
        yield AreaLight(name, thing.mesh, power_lm, colour=(red, green, blue), material=thing.material)


def _mover(mover: MoverSpec, spec: SceneFile) -> Contents:
    """A mover of the scene file, or the movers of a person's limbs, and their materials."""
    motion = _waypoint_motion(mover)
    if mover.kind == "person":
        return _walker(mover.name, motion, spec.seed)
    contents = _mover_contents(mover, spec)
    moving = tuple(replace(thing, name=mover.name) for thing in contents.things)
    return Contents(materials=contents.materials, movers=(scripted.Mover(mover.name, moving, motion),))


def _waypoint_motion(mover: MoverSpec) -> scripted.WaypointMotion:
    """The motion of a mover through the waypoints of its path."""
    times_s = np.array([key.t_s for key in mover.path], float)
    positions_m = np.array([key.position_m for key in mover.path], float)
    yaw_deg = np.array([key.yaw_deg for key in mover.path], float)
    return scripted.WaypointMotion(times_s, positions_m, yaw_deg, mover.repeats)


def _mover_contents(mover: MoverSpec, spec: SceneFile) -> Contents:
    """The things and materials of a mover: a model, a piece of furniture, or a box."""
    if mover.file:
        return _model(ModelSpec(file=mover.file, name=mover.name))
    if mover.kind:
        with _located(f"mover '{mover.name}'"):
            piece = Piece(mover.kind, mover.name, (0.0, 0.0, 0.0))
            return Contents(*things([piece.build(spec.seed)]))
    mesh = block(mover.size_m or (), bevel_m=0)
    material_name = mover.material or ""
    return Contents((Thing(mover.name, mesh, material_name),), {material_name: _material(material_name, spec)})


def _walker(name: str, motion: scripted.WaypointMotion, seed: int) -> Contents:
    """A person who walks along a path: one mover per limb, all with the same name."""
    person = walker(piece_rng(name, seed))
    limb_names = [f"{name}.{index}" for index in range(len(person.limbs))]
    limb_parts = [(limb_name, limb.parts) for limb_name, limb in zip(limb_names, person.limbs, strict=True)]
    all_things, materials = things(limb_parts)
    movers = []
    for limb_name, limb in zip(limb_names, person.limbs, strict=True):
        limb_things = tuple(replace(thing, name=name) for thing in all_things if thing.name == limb_name)
        limb_motion = scripted.LimbMotion(motion, person.cycle_m, limb.joints_m, limb.pitch_rad, person.rise_m)
        movers.append(scripted.Mover(name, limb_things, limb_motion))
    return Contents(materials=materials, movers=tuple(movers))
