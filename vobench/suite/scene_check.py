"""Checks the names, materials, positions and lights in a scene's YAML."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from vobench.asset import FINISHES
from vobench.errors import SuiteError, unknown_name_sentence
from vobench.setting import Triple
from vobench.suite.scene_lighting import SKY, SUN
from vobench.suite.scene_spec import LuminousSpec, MoverSpec, RoomSpec, SceneFile, WindowSpec
from vobench.suite.yaml_source import Keys, Mistakes, YamlFile

WALLS = ("north", "east", "south", "west")
TOUCHING_M = 1e-6  # windows may share a border
# Sections whose entries have names, and the prefix of the names of entries without one.
NAMED_SECTIONS = {"lamps": "", "boxes": "box", "boards": "board", "furniture": "", "movers": ""}


def check_scene(spec: SceneFile, mistakes: Mistakes) -> None:
    """Find the mistakes in a scene, whose sections and entries may be incomplete, and add them to `mistakes`."""
    is_complete = not mistakes.recorded
    _check_materials(spec, mistakes)
    if is_complete:
        with mistakes.at():
            _require_light(spec)
    if spec.room:
        _check_positions(spec, spec.room, mistakes)
        _check_windows(spec.room, mistakes)
    _check_names(spec, mistakes)


def _check_materials(spec: SceneFile, mistakes: Mistakes) -> None:
    written = mistakes.source.parsed.get("materials", {})
    if not isinstance(written, dict):
        return
    known = [*{**written, **dict.fromkeys(FINISHES)}]
    for keys, name in materials_used(spec):
        with mistakes.at(*keys):
            if name not in known:
                raise SuiteError(unknown_name_sentence("material", name, known))
            material = getattr(spec, "materials", {}).get(name)
            if keys[0] == "movers" and isinstance(material, LuminousSpec):
                raise SuiteError(f"'{name}' is luminous, but movers cannot emit light; use another kind of material")


def materials_used(spec: SceneFile) -> Iterator[tuple[Keys, str]]:
    """The place and the name of every material that a scene uses."""
    if spec.room:
        yield from _room_materials(spec.room)
    for section in ("boxes", "boards", "movers"):
        for index, thing in enumerate(getattr(spec, section)):
            if thing.material is not None:
                yield (section, index, "material"), thing.material


def _room_materials(room: RoomSpec) -> Iterator[tuple[Keys, str]]:
    for part in ("floor", "wall", "ceiling"):
        yield ("room", part), getattr(room, part)
    for wall, name in room.walls.items():
        yield ("room", "walls", wall), name
    for index, window in enumerate(room.windows):
        yield ("room", "windows", index, "pane"), window.pane
        yield ("room", "windows", index, "reveal"), window.reveal


def _require_light(spec: SceneFile) -> None:
    """Raise SuiteError if nothing in a scene can emit light. Makers, models and furniture may add lights."""
    is_from_generator = bool(spec.generated) or not spec.is_described
    may_bring_lights = bool(spec.maker or spec.meshes or spec.furniture)
    has_luminous_material = any(isinstance(material, LuminousSpec) for material in spec.materials.values())
    if is_from_generator or may_bring_lights or has_luminous_material:
        return
    strengths = [lamp.power_lm for lamp in spec.lamps]
    strengths += [source.illuminance_lx for source in (spec.sun, spec.sky) if source]
    if any(strengths):
        return
    zero = "; all lights that it has are 0" if strengths else ""
    raise SuiteError(f"a scene needs a light: lamps, a sun, a sky or a luminous material{zero}")


def _check_positions(spec: SceneFile, room: RoomSpec, mistakes: Mistakes) -> None:
    for keys, position_m in _positions(spec):
        with mistakes.at(*keys):
            if not room.holds(position_m):
                raise SuiteError(f"should be inside the room, {room.extent} (got {list(position_m)})")


def _positions(spec: SceneFile) -> Iterator[tuple[Keys, Triple]]:
    """The position of everything that should be inside of the room, with its place in the file."""
    for section in ("lamps", "boxes", "boards"):
        for index, thing in enumerate(getattr(spec, section)):
            yield (section, index, "center_m"), thing.center_m
    for index, mover in enumerate(spec.movers):
        for key_index, position_m in enumerate(_mover_positions(mover)):
            yield ("movers", index, "path", key_index), position_m


def _mover_positions(mover: MoverSpec) -> Iterator[Triple]:
    """The positions of a mover. The position of a box is its centre; furniture and models may be on the floor."""
    for key in mover.path:
        x_m, y_m, z_m = key.position_m
        is_box = mover.size_m is not None
        yield x_m, y_m, z_m if is_box else z_m or TOUCHING_M


def _check_windows(room: RoomSpec, mistakes: Mistakes) -> None:
    for index, window in enumerate(room.windows):
        with mistakes.at("room", "windows", index):
            _require_within_wall(window, room)
            for earlier_index, earlier in enumerate(room.windows[:index]):
                _require_apart(window, earlier, earlier_index)


def _require_within_wall(window: WindowSpec, room: RoomSpec) -> None:
    """Raise SuiteError if a window reaches beyond its wall."""
    x_m, y_m, height_m = room.size_m
    length_m = y_m if window.wall in ("east", "west") else x_m
    along_m, up_m = window.center_m
    width_m, window_height_m = window.size_m
    fits_along = abs(along_m) + width_m / 2 < length_m / 2
    fits_up = up_m - window_height_m / 2 > 0 and up_m + window_height_m / 2 < height_m
    if not (fits_along and fits_up):
        raise SuiteError(
            f"the window reaches beyond its wall, which is {length_m:g} m long around 0 and {height_m:g} m high: "
            f"center_m {list(window.center_m)}, size_m {list(window.size_m)}"
        )


def _require_apart(window: WindowSpec, earlier: WindowSpec, earlier_index: int) -> None:
    """Raise SuiteError if two windows of one wall overlap."""
    if window.wall != earlier.wall:
        return
    distance_m = np.abs(np.subtract(window.center_m, earlier.center_m))
    needed_m = np.add(window.size_m, earlier.size_m) / 2
    if (distance_m < needed_m - TOUCHING_M).all():
        raise SuiteError(
            f"the window overlaps window {earlier_index} of the {window.wall} wall, which has "
            f"center_m {list(earlier.center_m)}, size_m {list(earlier.size_m)}; move one or make it smaller"
        )


def _check_names(spec: SceneFile, mistakes: Mistakes) -> None:
    """Find names that occur twice, including generated names.

    Names must be unique because lightings refer to lights by name, and the ground truth to things.
    """
    taken_names = {SUN, SKY, *_room_names(spec.room)}
    for section, prefix in NAMED_SECTIONS.items():
        for index, thing in enumerate(getattr(spec, section)):
            name = thing.name or _generated_name(prefix, section, index, mistakes.source)
            with mistakes.at(section, index):
                if name in taken_names:
                    raise SuiteError(f"two things are called '{name}'; rename one of them")
            taken_names.add(name)


def _room_names(room: RoomSpec | None) -> Iterator[str]:
    """The generated names of the parts of a room."""
    if room is None:
        return
    yield "floor"
    yield "ceiling"
    for wall in WALLS:
        yield f"wall_{wall}"
    for number in range(len(room.windows)):
        yield f"window_{number}"


def _generated_name(prefix: str, section: str, index: int, source: YamlFile) -> str:
    number: Any = source.original_keys((section, index))[1]  # as in the file
    return f"{prefix}_{number}"
