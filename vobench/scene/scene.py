"""A scene is rectangles with materials, lights, and things that move; metres, world frame, z up."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import Material
from vobench.scene.mover import Mover
from vobench.scene.surface import Surface, rectangle


@dataclass(frozen=True, slots=True)
class Scene:
    """Surfaces that stand still, their materials by name, the lights that shine on them, and movers."""

    name: str
    surfaces: tuple[Surface, ...]
    materials: dict[str, Material]
    lights: tuple[Light, ...]
    movers: tuple[Mover, ...] = ()

    @property
    def panels(self) -> tuple[AreaLight, ...]:
        """The lights that can be seen."""
        return tuple(light for light in self.lights if isinstance(light, AreaLight))


def ceiling_light(name: str, center_m: Array, size_m: tuple[float, float], *, power_lm: float) -> AreaLight:
    """A panel that hangs level and shines down."""
    x, y = np.array([size_m[0], 0, 0]), np.array([0, size_m[1], 0])
    return AreaLight(name, rectangle(np.asarray(center_m, float), y, x, name, name), power_lm)
