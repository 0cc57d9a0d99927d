"""Reads a scene's YAML, checks the names in it, and builds the scene it describes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vobench.errors import SuiteError, unknown
from vobench.geometry import se3
from vobench.scene import scene as scripted
from vobench.scene.light import AreaLight, Light, Sky, Sun, scaled
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface, Window, box, rectangle, room, with_windows
from vobench.setting import Triple
from vobench.suite import yaml_file
from vobench.suite.scene_spec import (
    LightOverride,
    Luminous,
    MoverSpec,
    SceneFile,
    SunSpec,
    WindowSpec,
)
from vobench.suite.yaml_file import Keys, Mistakes, YamlFile

Lighting = dict[str, LightOverride]
# Names of the lights that there is one of.
SUN, SKY = "sun", "sky"
# How names begin that we give to what has none.
GIVEN_NAMES = ("box_", "board_", "window_", "wall_", "floor", "ceiling")
TOUCHING_M = 1e-6  # windows may share a border


def read_scene(path: Path) -> SceneFile:
    """The scene in a file. Raises SuiteError with all that is wrong, each with its place."""
    spec, wrong = survey(path)
    wrong.require_none()
    return spec


def survey(path: Path) -> tuple[SceneFile, Mistakes]:
    """The scene in a file and all that is wrong with it; where anything is, the scene lacks sections and entries."""
    reading = yaml_file.read_all(path, SceneFile)
    spec, source = reading.model, reading.source
    wrong = Mistakes(source, list(reading.mistakes))
    materials = source.marked.get("materials")
    for keys, name in _materials_used(spec) if isinstance(materials, dict) else ():
        with wrong.at(*keys):
            if name not in materials:
                raise SuiteError(unknown("material", name, list(materials)))
            if keys[0] == "movers" and isinstance(getattr(spec, "materials", {}).get(name), Luminous):
                raise SuiteError(f"'{name}' shines, and what moves cannot; choose a material of another kind")
    if not reading.mistakes:
        with wrong.at():
            _check_light(spec)
    if hasattr(spec, "room"):
        _check_room(spec, wrong)
    _check_names(spec, source, wrong)
    return spec, wrong


def build(spec: SceneFile, lighting: Lighting) -> Scene:
    """The scene under a lighting. Raises SuiteError where the lighting names a light that is not there."""
    surfaces, luminous = _surfaces(spec), _luminous(spec)
    return Scene(
        name=spec.name,
        surfaces=tuple(surface for surface in surfaces if surface.material not in luminous),
        materials={name: m for name, m in spec.materials.items() if not isinstance(m, Luminous)},
        lights=lit(tuple(_lights(spec, surfaces)), lighting),
        movers=movers(spec),
    )


def lights(spec: SceneFile) -> tuple[Light, ...]:
    """The lights as the scene has them."""
    return tuple(_lights(spec, _surfaces(spec)))


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
    for value in tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ():
        if isinstance(value, dict) and isinstance(value.get("name"), str):
            yield str(value["name"])
        yield from _names_in(value)


def movers(spec: SceneFile) -> tuple[scripted.Mover, ...]:
    """What moves."""
    return tuple(_mover(mover) for mover in spec.movers)


def _luminous(spec: SceneFile) -> dict[str, float]:
    return {name: m.luminance_cd_m2 for name, m in spec.materials.items() if isinstance(m, Luminous)}


def _surfaces(spec: SceneFile) -> list[Surface]:
    return [*_room(spec), *_furniture(spec)]


def _check_light(spec: SceneFile) -> None:
    strengths = [lamp.power_lm for lamp in spec.lamps] + [sky.illuminance_lx for sky in (spec.sun, spec.sky) if sky]
    if not (any(strengths) or _luminous(spec)):
        zero = "; all that it has are 0" if strengths else ""
        raise SuiteError(f"a scene needs a light: lamps, a sun, a sky or a luminous material{zero}")


def _check_room(spec: SceneFile, wrong: Mistakes) -> None:
    for keys, place_m in _places(spec):
        with wrong.at(*keys):
            if not spec.room.holds(place_m):
                raise SuiteError(f"should be inside the room, {spec.room.extent} (got {list(place_m)})")
    for index in range(len(spec.room.windows)):
        with wrong.at("room", "windows", index):
            _check_window(index, spec)


def _materials_used(spec: SceneFile) -> Iterator[tuple[Keys, str]]:
    if hasattr(spec, "room"):
        for part in ("floor", "wall", "ceiling"):
            yield ("room", part), getattr(spec.room, part)
        for index, window in enumerate(spec.room.windows):
            yield ("room", "windows", index, "pane"), window.pane
            yield ("room", "windows", index, "reveal"), window.reveal
    for kind in ("boxes", "boards", "movers"):
        for index, thing in enumerate(getattr(spec, kind)):
            yield (kind, index, "material"), thing.material


def _places(spec: SceneFile) -> Iterator[tuple[Keys, Triple]]:
    for kind in ("lamps", "boxes", "boards"):
        yield from (((kind, index, "center_m"), thing.center_m) for index, thing in enumerate(getattr(spec, kind)))
    for index, mover in enumerate(spec.movers):
        yield from ((("movers", index, "path", nth), key.position_m) for nth, key in enumerate(mover.path))


def _check_names(spec: SceneFile, source: YamlFile, wrong: Mistakes) -> None:
    """Lights are named by lightings, and things by ground truth: no name twice, a name given by us included."""
    has_room = hasattr(spec, "room")
    seen = {SUN, SKY, *(surface.instance for surface in (_room(spec) if has_room else ()))}
    for kind, unnamed in (("lamps", ""), ("boxes", "box"), ("boards", "board"), ("movers", "")):
        for index, thing in enumerate(getattr(spec, kind)):
            name = thing.name or f"{unnamed}_{source.written((kind, index))[1]}"
            with wrong.at(kind, index):
                if name in seen:
                    raise SuiteError(f"two things are called '{name}'; give one another name")
            seen.add(name)


def _check_window(index: int, spec: SceneFile) -> None:
    window, (x, y, height) = spec.room.windows[index], spec.room.size_m
    length = y if window.wall in ("east", "west") else x
    (along, up), (width, high) = window.center_m, window.size_m
    if abs(along) + width / 2 >= length / 2 or up - high / 2 <= 0 or up + high / 2 >= height:
        raise SuiteError(
            f"the window reaches beyond its wall, which is {length:g} m long around 0 and {height:g} m high: "
            f"center_m {list(window.center_m)}, size_m {list(window.size_m)}"
        )
    for earlier, other in enumerate(spec.room.windows[:index]):
        apart = np.abs(np.subtract(window.center_m, other.center_m))
        if window.wall == other.wall and (apart < np.add(window.size_m, other.size_m) / 2 - TOUCHING_M).all():
            raise SuiteError(
                f"the window overlaps window {earlier} of the {window.wall} wall, which has "
                f"center_m {list(other.center_m)}, size_m {list(other.size_m)}; move one or make it smaller"
            )


def _room(spec: SceneFile) -> Iterator[Surface]:
    parts = room(spec.room.size_m, floor=spec.room.floor, wall=spec.room.wall, ceiling=spec.room.ceiling)
    for part in parts:
        windows = [
            _window(window, part, f"window_{index}")
            for index, window in enumerate(spec.room.windows)
            if part.instance == f"wall_{window.wall}"
        ]
        yield from with_windows(part, windows) if windows else [part]


def _window(window: WindowSpec, wall: Surface, name: str) -> Window:
    """The window in its wall's own directions, of which one is up and the other along x or y."""
    axis_u, axis_v = (edge / np.linalg.norm(edge) for edge in (wall.edge_u_m, wall.edge_v_m))
    along, up = window.center_m
    center = np.array([along, along, up]) - wall.corner_m
    upright_u = abs(axis_u[2]) > 0.5
    size = window.size_m[::-1] if upright_u else window.size_m
    at = (float(center @ np.abs(axis_u)), float(center @ np.abs(axis_v)))
    return Window(at, size, window.depth_m, window.pane, window.reveal, name)


def _furniture(spec: SceneFile) -> Iterator[Surface]:
    for index, b in enumerate(spec.boxes):
        name = b.name or f"box_{index}"
        yield from box(np.asarray(b.center_m), b.size_m, yaw_deg=b.yaw_deg, material=b.material, instance=name)
    for index, board in enumerate(spec.boards):
        across = se3.rotation_z(np.deg2rad(board.yaw_deg + 90))[:, 0] * board.size_m[0]
        up = np.array([0.0, 0.0, board.size_m[1]])
        yield rectangle(np.asarray(board.center_m), across, up, board.material, board.name or f"board_{index}")


def _lights(spec: SceneFile, surfaces: list[Surface]) -> Iterator[Light]:
    yield from (lamp.build() for lamp in spec.lamps)
    if spec.sun:
        yield _sun(spec.sun)
    if spec.sky:
        # A clear sky is brightest around where the sun stands at first, or overhead without a sun.
        toward = _sun(spec.sun).direction(0) if spec.sun else np.array([0.0, 0.0, 1.0])
        yield Sky(SKY, spec.sky.illuminance_lx, spec.sky.kind, toward, level=spec.sky.level.build())
    yield from _glowing(surfaces, _luminous(spec))


def _sun(sun: SunSpec) -> Sun:
    path = [(key.t_s, key.azimuth_deg, key.elevation_deg) for key in sun.path]
    if sun.azimuth_deg is not None and sun.elevation_deg is not None:
        path = [(0.0, sun.azimuth_deg, sun.elevation_deg)]
    times_s, azimuth_deg, elevation_deg = zip(*path, strict=True)
    return Sun(SUN, sun.illuminance_lx, times_s, azimuth_deg, elevation_deg, sun.level.build())


def _glowing(surfaces: list[Surface], luminous: dict[str, float]) -> Iterator[AreaLight]:
    """Every surface of a luminous material as a light; those of one thing are numbered."""
    count: dict[str, int] = {}
    for surface in surfaces:
        if surface.material in luminous:
            nth = count[surface.instance] = count.get(surface.instance, -1) + 1
            width, height = surface.size_m
            power_lm = luminous[surface.material] * np.pi * width * height
            yield AreaLight(f"{surface.instance}.{nth}" if nth else surface.instance, surface, float(power_lm))


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


def _mover(spec: MoverSpec) -> scripted.Mover:
    surfaces = box(np.zeros(3), spec.size_m, yaw_deg=0.0, material=spec.material, instance=spec.name)
    columns = zip(*((key.t_s, key.position_m, key.yaw_deg) for key in spec.path), strict=True)
    times_s, positions_m, yaw_deg = (np.array(column, float) for column in columns)
    path = scripted.Path(times_s, positions_m, yaw_deg, spec.repeats)
    return scripted.Mover(spec.name, tuple(surfaces), path)
