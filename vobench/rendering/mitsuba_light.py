"""Lights as plugins of Mitsuba: their strength at level 1, and the emitters of lights without a surface."""

from typing import Any

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.mitsuba_material import Plugin, rgb
from vobench.rendering.mitsuba_sun import PLUGIN as SUN_PLUGIN
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import Map

# The rows and columns of the picture of a sky. A row spans about a third of a degree. The number of rows is even, so
# that no row is on the horizon.
SKY_PX = (512, 1024)
PANORAMA_PX = (1024, 2048)

# The parameter of each kind of emitter that is proportional to the level of the light.
STRENGTH_PARAMETERS = {
    AreaLight: "emitter.radiance.value",
    PointLight: "intensity.value",
    SpotLight: "intensity.value",
    Sun: "irradiance",
    Sky: "scale",
}


def light_key(index: int) -> str:
    """The name of a light in the scene of Mitsuba."""
    return f"light_{index}"


def nominal_strength(light: Light) -> Array:
    """The strength (3,) of a light at level 1 in red, green and blue.

    Quantity and unit depend on the class of the light:

    AreaLight: the luminance in cd/m².
    PointLight: the luminous intensity in cd.
    SpotLight: the luminous intensity in cd along the axis.
    Sun: the illuminance in lx.
    Sky: 1, without a unit, because the picture of the sky contains the luminance.
    """
    match light:
        case AreaLight():
            strength = light.luminance_cd_m2
        case PointLight():
            strength = light.power_lm / (4 * np.pi)
        case SpotLight():
            strength = light.peak_cd
        case Sun():
            strength = light.illuminance_lx
        case Sky():
            return np.ones(3)
    return strength * np.array(light.colour)


def emitter_plugin(mi: Any, light: Light) -> Plugin:
    """The emitter of a light without a surface, at level 1 and at time 0.

    Raises ValueError for an area light, whose emitter is a part of its mesh.
    """
    match light:
        case PointLight():
            return {
                "type": "point",
                "position": list(light.position_m),
                "intensity": rgb(nominal_strength(light)),
            }
        case SpotLight():
            return _spot(mi, light)
        case Sun():
            return {
                "type": SUN_PLUGIN,
                "irradiance": mi.ScalarColor3f(nominal_strength(light).tolist()),
                "direction": list(light.direction(0)),
            }
        case Sky():
            return _environment_map(mi, light)
        case AreaLight():
            raise ValueError(f"the lamp '{light.name}' has no faces")


def _spot(mi: Any, light: SpotLight) -> Plugin:
    """The emitter of a spot light."""
    target_m = light.position_m + light.direction
    up = np.eye(3)[np.argmin(np.abs(light.direction))]  # the axis that is the least parallel to the direction
    to_world = mi.ScalarTransform4f().look_at(origin=list(light.position_m), target=list(target_m), up=list(up))
    return {
        "type": "spot",
        "to_world": to_world,
        "cutoff_angle": light.outer_deg,
        "beam_width": min(light.inner_deg, light.outer_deg - 1e-3),  # Mitsuba requires it to be smaller
        "intensity": rgb(nominal_strength(light)),
    }


def _environment_map(mi: Any, sky: Sky) -> Plugin:
    """The emitter of a sky. Mitsuba's environment maps have y up, so it is rotated until z is up."""
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(_sky_picture(sky)),
        "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90),
    }


def _sky_picture(sky: Sky) -> Map:
    """The luminance (rows, columns, 3) float32 of a sky in cd/m². The first row is the zenith, the last the nadir."""
    rows, columns = SKY_PX if sky.panorama is None else PANORAMA_PX
    theta = np.pi * np.arange(rows)[:, None] / (rows - 1)  # the angle from the zenith in rad, (rows, 1)
    phi = 2 * np.pi * (np.arange(columns) + 0.5) / columns  # the azimuth in rad, (columns,)
    # The directions of the pixels in the environment map, whose y axis points upwards.
    map_x = np.sin(theta) * np.sin(phi)
    map_y = np.cos(theta)
    map_z = -np.sin(theta) * np.cos(phi)
    # The emitter is rotated: (x, y, z) in the environment map is (x, -z, y) in the world.
    directions = np.stack(np.broadcast_arrays(map_x, -map_z, map_y), -1)
    return np.asarray(sky.seen_cd_m2(directions), np.float32)
