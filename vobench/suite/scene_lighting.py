"""Lightings, which replace the power or the level of lights in a scene."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from vobench.errors import SuiteError, unknown_name_sentence
from vobench.scene.light import Light, Sky, Sun, scaled
from vobench.suite.scene_spec import LightOverride
from vobench.suite.yaml_source import YamlFile

Lighting = dict[str, LightOverride]  # by the name of the light

# The names of the lights of which a scene has at most one.
SUN = "sun"
SKY = "sky"
# The prefixes of generated names, for things that have no name in the file.
GENERATED_NAMES = ("box_", "board_", "window_", "wall_", "floor", "ceiling")


def with_lighting(lights: Sequence[Light], lighting: Lighting) -> tuple[Light, ...]:
    """The lights under a lighting. Raises SuiteError for an unknown light, or a value that a light cannot have."""
    names = list(dict.fromkeys(light.name for light in lights))
    for name in lighting:
        if name not in names:
            raise SuiteError(f"lighting: {unknown_name_sentence('light', name, names)}")
    overridden = list[Light]()
    for light in lights:
        override = lighting.get(light.name)
        overridden.append(light if override is None else _override_light(light, override))
    return tuple(overridden)


def _override_light(light: Light, override: LightOverride) -> Light:
    """The light with another level. Another power is converted to a level, so that its light is computed only once."""
    if isinstance(light, Sun | Sky):
        _require_unset("power_lm", override, light)
        nominal = light.illuminance_lx
        target = override.illuminance_lx
    else:
        _require_unset("illuminance_lx", override, light)
        nominal = light.power_lm
        target = override.power_lm
    level = override.level.build() if override.level else light.level
    if target is None:
        return replace(light, level=level)
    return replace(light, level=scaled(level, _factor(light, nominal, target)))


def _require_unset(key: str, override: LightOverride, light: Light) -> None:
    """Raise SuiteError if an override has a key that belongs to other kinds of lights."""
    if getattr(override, key) is not None:
        raise SuiteError(f"lighting: {key} does not belong to '{light.name}'")


def _factor(light: Light, nominal: float, target: float) -> float:
    """The factor from the strength of a light in the scene to another one. Raises SuiteError if there is none."""
    if nominal == 0 and target > 0:
        raise SuiteError(
            f"lighting: '{light.name}' is 0 in the scene, so it cannot be set to {target:g}; increase it in the scene"
        )
    return target / nominal if nominal else 0.0


def require_possible(name: str, scene: YamlFile) -> None:
    """Raise SuiteError if no light of a scene, which was read only in part, can have this name."""
    written_names = [*_written_names(scene.parsed)]
    daylight_names = [light for light in (SUN, SKY) if light in scene.parsed]
    known_names = [*written_names, *daylight_names]
    thing_name = name.partition(".")[0]
    if thing_name not in known_names and not name.startswith(GENERATED_NAMES):
        raise SuiteError(f"lighting: {unknown_name_sentence('light', name, known_names)}")


def _written_names(tree: Any) -> Iterator[str]:
    """The value of every key `name` in a tree."""
    values: Iterable[Any] = ()
    if isinstance(tree, dict):
        values = tree.values()
    elif isinstance(tree, list):
        values = tree
    for value in values:
        if isinstance(value, dict) and isinstance(value.get("name"), str):
            yield str(value["name"])
        yield from _written_names(value)
