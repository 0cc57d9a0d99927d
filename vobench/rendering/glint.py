"""Glints: the reflections of lamps in glossy surfaces, from bulbs and, in rough surfaces, from area lights.

The reflection of an area light is that of a bulb in its middle, in a surface that is rougher by the size of the light.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.lamp import Lamp, lamp_of
from vobench.rendering.uniform_block import GLINT_ROWS, MOST_GLINTS
from vobench.scene.light import AreaLight, Light, PointLight, SpotLight, Sun
from vobench.scene.mesh import face_corners

EVERYWHERE_RAD = 10.0  # more than any angle to an axis
NO_AXIS = (0.0, 0.0, 0.0, 1.0)
COSINE = -1.0  # stands in the place of the fading of a spot for a flat light, whose intensity has a cosine
BULB = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class LampPart:
    """A connected part of an area light.

    `light` is the index of the light, and `luminance_cd_m2` its luminance at level 1.
    `lamp` has the middle of the part and its normal.
    `is_flat` is whether it shines only before its plane.
    `shown_m2` is the area that it shows: before its plane, or on average from all sides.
    """

    light: int
    luminance_cd_m2: float
    lamp: Lamp
    is_flat: bool
    shown_m2: float

    @property
    def radius_m(self) -> float:
        """The radius of a disc of the area that it shows."""
        return float(np.sqrt(self.shown_m2 / np.pi))


def lamp_parts(lights: Sequence[Light]) -> tuple[LampPart, ...]:
    """The parts of area lights that have glints: those of all lights in order, as long as there is place for them."""
    place = MOST_GLINTS - sum(isinstance(light, PointLight | SpotLight | Sun) for light in lights)
    parts: list[LampPart] = []
    for index, light in enumerate(lights):
        if not isinstance(light, AreaLight):
            continue
        of_light = _parts_of(index, light)
        if len(parts) + len(of_light) <= place:
            parts.extend(of_light)
    return tuple(parts)


def _parts_of(index: int, light: AreaLight) -> list[LampPart]:
    welded = light.mesh.copy()
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    parts = []
    for mesh in welded.split(only_watertight=False):
        corners_m = face_corners(mesh)
        lamp = lamp_of(corners_m)
        is_flat = lamp.min_cosine == 0
        area_m2 = float(areas_m2(corners_m).sum())
        # A convex body shows a quarter of its area to all sides.
        shown_m2 = area_m2 if is_flat else area_m2 / 4
        parts.append(LampPart(index, light.luminance_cd_m2, lamp, is_flat, shown_m2))
    return parts


def glints(
    lights: Sequence[Light],
    parts: Sequence[LampPart],
    eye_m: Array,
    start_ns: int,
    end_ns: int,
) -> Array:
    """The glints (G, 4, 4) of bulbs, suns and parts of area lights: those with the highest illuminance at an eye (3,).

    Rows of each: the position and 1, or the direction and 0; the intensity or illuminance of three channels at the mean
    level over an interval, and the angle in rad at which a spot ends; the direction of the spot or of a flat light, and
    1 / the angle over which the spot fades, or COSINE; the radius and 1 for an area light.
    """
    bulbs = [light for light in lights if isinstance(light, PointLight | SpotLight | Sun)]
    rows = [_bulb_glint(light, start_ns, end_ns) for light in bulbs]
    rows += [_area_glint(part, lights[part.light], start_ns, end_ns) for part in parts]
    if len(rows) > MOST_GLINTS:
        rows.sort(key=lambda glint: -_illuminance(glint, eye_m))
    return np.array(rows[:MOST_GLINTS]).reshape(-1, GLINT_ROWS, 4)


def _illuminance(glint: Array, eye_m: Array) -> float:
    """The illuminance at an eye (3,) by a glint (4, 4), as the sum of its channels."""
    place, power, *_ = glint
    has_position = place[3]  # 1 or 0
    squared_m2 = np.sum((place[:3] - has_position * eye_m) ** 2)  # 1 for a direction
    return float(power[:3].sum() / squared_m2)


def _area_glint(part: LampPart, light: Light, start_ns: int, end_ns: int) -> Array:
    """The rows (4, 4) of a part of an area light in `glints`."""
    luminance_cd_m2 = part.luminance_cd_m2 * light.level.mean(start_ns, end_ns) * np.array(light.colour)
    assert part.lamp.center_m is not None
    place = [*part.lamp.center_m, 1]
    power = [*part.shown_m2 * luminance_cd_m2, EVERYWHERE_RAD]
    axis = [*part.lamp.axis, COSINE] if part.is_flat else NO_AXIS
    return np.array([place, power, axis, [part.radius_m, 1, 0, 0]])


def _bulb_glint(
    light: PointLight | SpotLight | Sun,
    start_ns: int,
    end_ns: int,
) -> Array:
    """The rows (4, 4) of a bulb or a sun in `glints`."""
    level = light.level.mean(start_ns, end_ns) * np.array(light.colour)
    if isinstance(light, Sun):
        direction = light.direction((start_ns + end_ns) / 2)
        return np.array([[*direction, 0], [*light.illuminance_lx * level, EVERYWHERE_RAD], NO_AXIS, BULB])
    place = [*light.position_m, 1]
    if isinstance(light, PointLight):
        intensity_cd = light.power_lm / (4 * np.pi)
        return np.array([place, [*intensity_cd * level, EVERYWHERE_RAD], NO_AXIS, BULB])
    inner_rad, outer_rad = np.deg2rad([light.inner_deg, light.outer_deg])
    fade = 1 / max(outer_rad - inner_rad, 1e-9)
    return np.array([place, [*light.peak_cd * level, outer_rad], [*light.direction, fade], BULB])
