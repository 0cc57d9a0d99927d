"""Glints: the reflections of lamps that are too small to be seen in the room probe, in glossy surfaces."""

from collections.abc import Sequence

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.uniform_block import MOST_GLINTS
from vobench.scene.light import Light, PointLight, SpotLight, Sun

EVERYWHERE_RAD = 10.0  # more than any angle to an axis
NO_AXIS = (0.0, 0.0, 0.0, 1.0)


def glints(
    lights: Sequence[Light],
    eye_m: Array,
    start_ns: int,
    end_ns: int,
) -> Array:
    """The glints (G, 3, 4) of point lights, spotlights and suns: those with the highest illuminance at an eye (3,).

    Rows of each: the position and 1, or the direction and 0; the intensity or illuminance of three channels at the mean
    level over an interval, and the angle in rad at which a spot ends; the direction of the spot, and 1 / the angle over
    which it fades.
    """
    bulbs = [light for light in lights if isinstance(light, PointLight | SpotLight | Sun)]
    rows = [_glint(light, start_ns, end_ns) for light in bulbs]
    if len(rows) > MOST_GLINTS:
        rows.sort(key=lambda glint: -_illuminance(glint, eye_m))
    return np.array(rows[:MOST_GLINTS]).reshape(-1, 3, 4)


def _illuminance(glint: Array, eye_m: Array) -> float:
    """The illuminance at an eye (3,) by a glint (3, 4), as the sum of its channels."""
    place, power, _ = glint
    has_position = place[3]  # 1 or 0
    squared_m2 = np.sum((place[:3] - has_position * eye_m) ** 2)  # 1 for a direction
    return float(power[:3].sum() / squared_m2)


def _glint(
    light: PointLight | SpotLight | Sun,
    start_ns: int,
    end_ns: int,
) -> Array:
    """The three rows (3, 4) of a lamp in `glints`."""
    level = light.level.mean(start_ns, end_ns) * np.array(light.colour)
    if isinstance(light, Sun):
        direction = light.direction((start_ns + end_ns) / 2)
        return np.array([[*direction, 0], [*light.illuminance_lx * level, EVERYWHERE_RAD], NO_AXIS])
    place = [*light.position_m, 1]
    if isinstance(light, PointLight):
        intensity_cd = light.power_lm / (4 * np.pi)
        return np.array([place, [*intensity_cd * level, EVERYWHERE_RAD], NO_AXIS])
    inner_rad, outer_rad = np.deg2rad([light.inner_deg, light.outer_deg])
    fade = 1 / max(outer_rad - inner_rad, 1e-9)
    return np.array([place, [*light.peak_cd * level, outer_rad], [*light.direction, fade]])
