"""Lightings: replacements for the power or the level of the lights of a scene."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from vobench.errors import SuiteError, unknown_name_sentence
from vobench.scene.light import Light, Sky, Steady, Sun, scaled
from vobench.suite.scene_spec import LightOverride
from vobench.suite.yaml_source import YamlFile

Lighting = dict[str, LightOverride]  # the keys are the names of lights, or LAMPS

# The names of the lights of which a scene has at most one.
SUN = "sun"
SKY = "sky"
LAMPS = "lamps"  # stands for all lights of a scene except for sun and sky
# The prefixes of the names that are generated for things without a name in the file.
GENERATED_NAMES = ("box_", "board_", "window_", "wall_", "floor", "ceiling")


def with_lighting(lights: Sequence[Light], lighting: Lighting) -> tuple[Light, ...]:
    """The lights of a scene under a lighting.

    The level of `lamps` multiplies that of every lamp. Changes of a single light are made after it.

    Raises SuiteError if the lighting names an unknown light, or gives a light a value that it cannot have.
    """
    _require_known(lighting, lights)
    names = {light.name for light in lights}
    of_lamps = None if LAMPS in names else lighting.get(LAMPS)
    overridden = list[Light]()
    for light in lights:
        changed = light
        if of_lamps is not None and _is_lamp(light):
            changed = _with_common_level(light, of_lamps)
        override = lighting.get(light.name)
        overridden.append(changed if override is None else _override_light(changed, override))
    return tuple(overridden)


def _require_known(lighting: Lighting, lights: Sequence[Light]) -> None:
    """Raise SuiteError if the lighting names a light that is not there, or lamps where there are none."""
    known_names = list(dict.fromkeys(light.name for light in lights))
    if any(_is_lamp(light) for light in lights):
        known_names.append(LAMPS)
    for name in lighting:
        if name in known_names:
            continue
        if name == LAMPS:
            raise SuiteError("lighting: there are no lamps in this scene")
        raise SuiteError(f"lighting: {unknown_name_sentence('light', name, known_names)}")


def _is_lamp(light: Light) -> bool:
    """Whether a light is neither sun nor sky."""
    return not isinstance(light, Sun | Sky)


def _with_common_level(lamp: Light, override: LightOverride) -> Light:
    """A lamp whose level is multiplied by that which a lighting gives all lamps.

    Raises SuiteError if the lighting gives all lamps more than a level, or if both levels change over time.
    """
    if override.level is None or override.power_lm is not None or override.illuminance_lx is not None:
        raise SuiteError("lighting: lamps have only a level in common; name a lamp to change its power")
    common_level = override.level.build()
    if isinstance(lamp.level, Steady):
        return replace(lamp, level=scaled(common_level, lamp.level.level))
    if isinstance(common_level, Steady):
        return replace(lamp, level=scaled(lamp.level, common_level.level))
    raise SuiteError(f"lighting: '{lamp.name}' changes over time already, so lamps cannot; name the lamps that should")


def _override_light(light: Light, override: LightOverride) -> Light:
    """The light with another level.

    Another power is converted to a level, so that the light need not be baked again.
    """
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
    factor = _factor(light, nominal, target)
    return replace(light, level=scaled(level, factor))


def _require_unset(key: str, override: LightOverride, light: Light) -> None:
    """Raise SuiteError if an override has a key that belongs to other kinds of lights."""
    if getattr(override, key) is not None:
        raise SuiteError(f"lighting: {key} does not belong to '{light.name}'")


def _factor(light: Light, nominal: float, target: float) -> float:
    """The ratio target / nominal of two strengths of a light.

    `nominal` is the strength in the scene.
    `target` is the strength in the lighting.

    Raises SuiteError if the nominal strength is 0 and the target is not.
    """
    if nominal == 0 and target > 0:
        raise SuiteError(
            f"lighting: '{light.name}' is 0 in the scene, so it cannot be set to {target:g}; increase it in the scene"
        )
    if nominal == 0:
        return 0.0
    return target / nominal


def require_possible(name: str, scene: YamlFile) -> None:
    """Raise SuiteError if no light of a scene can have this name. The scene was parsed, but not built."""
    written_names = list(_written_names(scene.parsed))
    daylight_names = [light for light in (SUN, SKY) if light in scene.parsed]
    known_names = [*written_names, *daylight_names]
    # A lamp of a thing has the name thing.lamp, and the scene contains only the name of the thing.
    thing_name, _, _ = name.partition(".")
    is_known = thing_name in known_names
    has_generated_name = name.startswith(GENERATED_NAMES)
    if not is_known and not has_generated_name:
        raise SuiteError(f"lighting: {unknown_name_sentence('light', name, known_names)}")


def _written_names(tree: Any) -> Iterator[str]:
    """The value of every key `name` in a tree of dictionaries and lists."""
    values: Iterable[Any] = ()
    if isinstance(tree, dict):
        values = tree.values()
    elif isinstance(tree, list):
        values = tree
    for value in values:
        if isinstance(value, dict) and isinstance(value.get("name"), str):
            yield str(value["name"])
        yield from _written_names(value)
