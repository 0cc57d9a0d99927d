"""Reads a scene's YAML, and checks the names and places in it."""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from vobench.asset import FINISHES, MODEL_SUFFIXES
from vobench.errors import SuiteError, unknown
from vobench.scene.light import Light, Sky, Sun, scaled
from vobench.scene.material import LUMINANCE, emitted_cd_m2, reflectance
from vobench.scene.mesh import areas_m2, corners
from vobench.scene.scene import Scene
from vobench.setting import Triple
from vobench.suite import yaml_file
from vobench.suite.scene_spec import (
    LightOverride,
    Luminous,
    ModelSpec,
    PointLamp,
    RoomSpec,
    SceneFile,
    SkySpec,
    SunSpec,
)
from vobench.suite.yaml_file import Keys, Mistakes, YamlFile

Lighting = dict[str, LightOverride]
# Names of the lights that there is one of.
SUN = "sun"
SKY = "sky"
# How names begin that we give to what has none.
GIVEN_NAMES = ("box_", "board_", "window_", "wall_", "floor", "ceiling")
WALLS = ("north", "east", "south", "west")
TOUCHING_M = 1e-6  # windows may share a border


def read_scene(path: Path) -> SceneFile:
    """The scene in a file. Raises SuiteError with all that is wrong, each with its place."""
    spec, wrong = survey(path)
    wrong.require_none()
    return spec


def survey(path: Path, changes: Mapping[str, Any] = MappingProxyType({})) -> tuple[SceneFile, Mistakes]:
    """The scene in a file and all that is wrong with it; where anything is, the scene lacks sections and entries.

    `changes` are values in place of the file's, by keys with dots between.
    """
    if changes and path.suffix.lower() in MODEL_SUFFIXES:
        raise SuiteError(f"scene_changes are of a scene in YAML, and this is a model: {path}")
    if path.suffix.lower() in MODEL_SUFFIXES:
        return _bare(path), Mistakes(YamlFile(path, {}))
    changes_in_yaml = {key: json.dumps(value) for key, value in changes.items()}
    reading = yaml_file.read_all(path, SceneFile, changes_in_yaml, kind="scene")
    spec = reading.model
    source = reading.source
    wrong = Mistakes(source, list(reading.mistakes))
    materials = source.marked.get("materials", {})
    for keys, name in materials_used(spec) if isinstance(materials, dict) else ():
        with wrong.at(*keys):
            if name not in materials and name not in FINISHES:
                raise SuiteError(unknown("material", name, [*{**materials, **dict.fromkeys(FINISHES)}]))
            if keys[0] == "movers" and isinstance(getattr(spec, "materials", {}).get(name), Luminous):
                raise SuiteError(f"'{name}' shines, and what moves cannot; choose a material of another kind")
    if not reading.mistakes:
        with wrong.at():
            _check_light(spec)
    if spec.room:
        _check_room(spec, spec.room, wrong)
    _check_names(spec, source, wrong)
    return (spec if reading.mistakes else _located(spec, path.parent, wrong)), wrong


def _located(spec: SceneFile, folder: Path, wrong: Mistakes) -> SceneFile:
    """The scene with its files named from anywhere."""

    def found(name: str, *keys: int | str) -> str:
        with wrong.at(*keys):
            if not (folder / name).is_file():
                raise SuiteError(f"there is no such file beside the scene: {folder / name}")
        return str((folder / name).resolve())

    return replace(
        spec,
        meshes=tuple(replace(m, file=found(m.file, "meshes", i, "file")) for i, m in enumerate(spec.meshes)),
        movers=tuple(replace(m, file=m.file and found(m.file, "movers", i, "file")) for i, m in enumerate(spec.movers)),
        maker=spec.maker and found(spec.maker, "maker"),
    )


def _bare(path: Path) -> SceneFile:
    """A model as a scene: its own lights, or such as it needs; and an exposure for a white wall in their mean light.

    In a closed room of area A and mean reflectance r lamps of a power P come to P / (A (1 - r)), bounces included.
    """
    from vobench.asset.model import read_model

    model = read_model(path)
    corners_m = np.concatenate([thing.mesh.vertices for thing in model.everything])
    scale = CENTIMETRE if float(np.ptp(corners_m, axis=0).max()) > LARGEST_M else 1.0
    if scale != 1:
        model = read_model(path, scale=scale)
    own = {
        name: (emitted_cd_m2(m) @ LUMINANCE, min(reflectance(m).mean(), WHITEST) if m.kind == "body" else 0.5)
        for name, m in model.materials.items()
    }
    area_m2 = np.array([areas_m2(corners(thing.mesh)).sum() for thing in model.everything])
    glow_cd_m2, kept = np.array([own[thing.material] for thing in model.everything]).T
    swallows_m2 = float(area_m2 @ (1 - kept))
    lamps_lm = sum(light.power_lm for light in model.lights if not isinstance(light, Sun | Sky))
    sun_lx = sum(light.illuminance_lx for light in model.lights if isinstance(light, Sun | Sky))
    lux = sun_lx + float(lamps_lm + np.pi * area_m2 @ glow_cd_m2) / swallows_m2
    name = re.sub(r"[^a-z0-9_]+", "_", path.stem.lower()).strip("_") or "model"
    whole = ModelSpec(file=str(path.resolve()), scale=scale)
    spec = SceneFile(name=name, white_cd_m2=max(float(lux / np.pi), 1.0), meshes=(whole,))
    return spec if lux else _lit_from_outside(spec, Scene(name, tuple(model.everything), {}, ()), swallows_m2)


DAYLIGHT = SunSpec(illuminance_lx=30_000, azimuth_deg=30, elevation_deg=50), SkySpec(illuminance_lx=8_000, kind="clear")
ROOM_LX = 400.0
LEAST_OPEN = 0.1
WHITEST = 0.9
# a larger model was written in centimetres
LARGEST_M = 300.0
CENTIMETRE = 0.01


def _lit_from_outside(spec: SceneFile, shape: Scene, swallows_m2: float) -> SceneFile:
    """A model without a light, by day where its floor sees the sky, else with lamps under its ceiling."""
    from vobench.suite.free_way import ceiling_above

    open_share, places_m = ceiling_above(shape)
    if open_share >= LEAST_OPEN:
        sun, sky = DAYLIGHT
        lux = sun.illuminance_lx * np.sin(np.deg2rad(sun.elevation_deg or 90)) + sky.illuminance_lx
        return replace(spec, sun=sun, sky=sky, white_cd_m2=float(lux / np.pi))
    power_lm = ROOM_LX * swallows_m2 / len(places_m)
    lamps = [PointLamp(name=f"lamp_{n}", center_m=at_m, power_lm=power_lm) for n, at_m in enumerate(places_m, 1)]
    return replace(spec, lamps=tuple(lamps), white_cd_m2=float(ROOM_LX / np.pi))


def content(spec: SceneFile, *, exclude: Any = None) -> dict[str, Any]:
    """The scene as JSON can hold it; its files count by what is in them, not by where they lie."""
    said: dict[str, Any] = yaml_file.plain(spec, exclude=exclude)
    for part in (*said.get("meshes", ()), *said.get("movers", ())):
        if part.get("file"):
            part["file"] = _digest(Path(part["file"]))
    if said.get("maker"):
        said["maker"] = _digest(Path(said["maker"]))
    return said


def _digest(path: Path) -> str:
    return f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}"


def lit(lights: Sequence[Light], lighting: Lighting) -> tuple[Light, ...]:
    """The lights under a lighting. Raises SuiteError where it names one that is not there, or asks what cannot be."""
    names = {light.name: None for light in lights}
    for name in lighting:
        if name not in names:
            raise SuiteError(f"lighting: {unknown('light', name, list(names))}")
    return tuple(_lit(light, lighting[light.name]) if light.name in lighting else light for light in lights)


def require_possible(name: str, source: YamlFile) -> None:
    """Raise SuiteError where no light can be called so, in a scene that is read only in part."""
    named = [*_names_in(source.marked), *(sky for sky in (SUN, SKY) if sky in source.marked)]
    if name.partition(".")[0] not in named and not name.startswith(GIVEN_NAMES):
        raise SuiteError(f"lighting: {unknown('light', name, named)}")


def _names_in(tree: Any) -> Iterator[str]:
    values: Iterable[Any] = ()
    if isinstance(tree, dict):
        values = tree.values()
    elif isinstance(tree, list):
        values = tree
    for value in values:
        if isinstance(value, dict) and isinstance(value.get("name"), str):
            yield str(value["name"])
        yield from _names_in(value)


def _check_light(spec: SceneFile) -> None:
    strengths = [lamp.power_lm for lamp in spec.lamps] + [sky.illuminance_lx for sky in (spec.sun, spec.sky) if sky]
    shining = any(isinstance(material, Luminous) for material in spec.materials.values())
    if not (any(strengths) or shining or spec.maker or spec.meshes or spec.furniture):
        zero = "; all that it has are 0" if strengths else ""
        raise SuiteError(f"a scene needs a light: lamps, a sun, a sky or a luminous material{zero}")


def _check_room(spec: SceneFile, room: RoomSpec, wrong: Mistakes) -> None:
    for keys, place_m in _places(spec):
        with wrong.at(*keys):
            if not room.holds(place_m):
                raise SuiteError(f"should be inside the room, {room.extent} (got {list(place_m)})")
    for index in range(len(room.windows)):
        with wrong.at("room", "windows", index):
            _check_window(index, room)


def materials_used(spec: SceneFile) -> Iterator[tuple[Keys, str]]:
    """Every material that a scene names, and where."""
    if room := spec.room:
        for part in ("floor", "wall", "ceiling"):
            yield ("room", part), getattr(room, part)
        yield from ((("room", "walls", wall), name) for wall, name in room.walls.items())
        for index, window in enumerate(room.windows):
            yield ("room", "windows", index, "pane"), window.pane
            yield ("room", "windows", index, "reveal"), window.reveal
    for kind in ("boxes", "boards", "movers"):
        for index, thing in enumerate(getattr(spec, kind)):
            if thing.material is not None:
                yield (kind, index, "material"), thing.material


def _places(spec: SceneFile) -> Iterator[tuple[Keys, Triple]]:
    for kind in ("lamps", "boxes", "boards"):
        yield from (((kind, index, "center_m"), thing.center_m) for index, thing in enumerate(getattr(spec, kind)))
    for index, mover in enumerate(spec.movers):
        for nth, key in enumerate(mover.path):
            x, y, z = key.position_m
            # Furniture and models may stand on the floor; of a box it is the middle.
            yield ("movers", index, "path", nth), (x, y, z if mover.size_m else z or TOUCHING_M)


def _check_names(spec: SceneFile, source: YamlFile, wrong: Mistakes) -> None:
    """Lights are named by lightings, and things by ground truth: no name twice, a name given by us included."""
    seen = {SUN, SKY}
    if room := spec.room:
        seen |= {
            "floor",
            "ceiling",
            *(f"wall_{side}" for side in WALLS),
            *(f"window_{n}" for n in range(len(room.windows))),
        }
    kinds = (("lamps", ""), ("boxes", "box"), ("boards", "board"), ("furniture", ""), ("movers", ""))
    for kind, unnamed in kinds:
        for index, thing in enumerate(getattr(spec, kind)):
            name = thing.name or f"{unnamed}_{source.written((kind, index))[1]}"
            with wrong.at(kind, index):
                if name in seen:
                    raise SuiteError(f"two things are called '{name}'; give one another name")
            seen.add(name)


def _check_window(index: int, room: RoomSpec) -> None:
    window = room.windows[index]
    (x, y, height) = room.size_m
    length = y if window.wall in ("east", "west") else x
    (along, up) = window.center_m
    (width, high) = window.size_m
    if abs(along) + width / 2 >= length / 2 or up - high / 2 <= 0 or up + high / 2 >= height:
        raise SuiteError(
            f"the window reaches beyond its wall, which is {length:g} m long around 0 and {height:g} m high: "
            f"center_m {list(window.center_m)}, size_m {list(window.size_m)}"
        )
    for earlier, other in enumerate(room.windows[:index]):
        apart = np.abs(np.subtract(window.center_m, other.center_m))
        if window.wall == other.wall and (apart < np.add(window.size_m, other.size_m) / 2 - TOUCHING_M).all():
            raise SuiteError(
                f"the window overlaps window {earlier} of the {window.wall} wall, which has "
                f"center_m {list(other.center_m)}, size_m {list(other.size_m)}; move one or make it smaller"
            )


def _lit(light: Light, override: LightOverride) -> Light:
    """The light with another level; another power counts as a level, so that its light is computed but once."""
    level = override.level.build() if override.level else light.level
    of_lamp = not isinstance(light, Sun | Sky)
    wrong, asked = ("illuminance_lx", override.power_lm) if of_lamp else ("power_lm", override.illuminance_lx)
    if getattr(override, wrong) is not None:
        raise SuiteError(f"lighting: {wrong} does not belong to '{light.name}'")
    if asked is None:
        return replace(light, level=level)
    nominal = light.illuminance_lx if isinstance(light, Sun | Sky) else light.power_lm
    if nominal == 0 and asked > 0:
        raise SuiteError(f"lighting: '{light.name}' is 0 in the scene, so it cannot be {asked:g}; give it more there")
    return replace(light, level=scaled(level, asked / nominal if nominal else 0.0))
