"""Emitters with hard shadows: point lights, spotlights, and the sun."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats
from vobench.rendering.cosine_sampling import disc
from vobench.rendering.emitter import Aim, Emitter
from vobench.rendering.geometry import FAR_M, BoundingSphere, tangents
from vobench.rendering.texel import Texels
from vobench.scene.light import SUN_RADIUS_RAD, PointLight, SpotLight, Sun


@dataclass(frozen=True, slots=True, eq=False)
class Bulb(Emitter):
    """A point light or a spotlight: inverse square, hard shadows."""

    light: PointLight | SpotLight
    ball: BoundingSphere

    @property
    def is_hard(self) -> bool:
        """Always."""
        return True

    def towards(self, texels: Texels) -> Aim:
        """The position of the lamp, whatever the random numbers."""
        vectors_m = (self.light.position_m - texels.points_m).astype(np.float32)
        squared_m2 = np.einsum("ij,ij->i", vectors_m, vectors_m)
        from_lamp = -vectors_m / np.sqrt(squared_m2)[:, None]
        strength = (self.light.intensity_cd(from_lamp) / squared_m2).astype(np.float32)
        return lambda _a, _b: (vectors_m, strength)

    def width_rad(self, points_m: Floats) -> Floats:
        """Zero: its shadows are hard."""
        return np.zeros(len(points_m), np.float32)


def bulb_emitter(light: PointLight | SpotLight) -> Bulb:
    """The emitter of a point light or a spotlight."""
    return Bulb(light, BoundingSphere(light.position_m, 0.0))


SUN_M = 1e7  # the distance of the sun: its rays are parallel within a scene to a tenth of a millimetre


@dataclass(frozen=True, slots=True, eq=False)
class SunDisc(Emitter):
    """The disc of the sun around a direction (3,), so narrow that most points need one ray."""

    light: Sun
    direction: Array
    ball: BoundingSphere

    @property
    def is_hard(self) -> bool:
        """Always."""
        return True

    def towards(self, texels: Texels) -> Aim:
        """Places uniform over its disc."""
        u_axis, v_axis = tangents(self.direction[None])
        arriving_lx = self.light.illuminance_lx * np.maximum(texels.normals @ self.direction, 0)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            x, y = disc(a, b)
            x_offset = np.tan(SUN_RADIUS_RAD) * x
            y_offset = np.tan(SUN_RADIUS_RAD) * y
            towards_disc = self.direction + x_offset[:, None] * u_axis + y_offset[:, None] * v_axis
            direction = towards_disc.astype(np.float32)
            # One ray alone must not tell where on the disc it went.
            cosine = np.maximum(texels.cosine(direction), SUN_RADIUS_RAD)
            return FAR_M * direction, arriving_lx / cosine

        return aim

    def width_rad(self, points_m: Floats) -> Floats:
        """Zero: its shadows are hard."""
        return np.zeros(len(points_m), np.float32)


def sun_emitter(light: Sun, t_ns: float) -> SunDisc:
    """The sun at one instant."""
    direction = light.direction(t_ns)
    return SunDisc(light, direction, BoundingSphere(SUN_M * direction, SUN_M * SUN_RADIUS_RAD))
