"""Which lights are hidden from a place, each light by its centre: what ground truth calls shadow."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.render.bodies import Bodies
from vobench.render.geometry import RAY_OFFSET_M, Mask
from vobench.render.source import FARTHEST_M
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface

# From there the sun's rays would fall this far beside where they do, within 30 m around the origin.
BEACON_M, BEACON_SLACK_M = 3e4, 0.03


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light that is on, and its middle (3,)."""

    light: Light
    center_m: Array

    @property
    def beacon(self) -> tuple[Array, float]:
        """A point (3,) not too far for float32, and how much farther than from it light may strike, in metres."""
        if isinstance(self.light, Sun):
            return self.center_m * (BEACON_M / FARTHEST_M), BEACON_SLACK_M
        return self.center_m, 0.0

    @property
    def panel(self) -> Surface | None:
        """The rectangle that shines, which does not stand in its own light."""
        return self.light.surface if isinstance(self.light, AreaLight) else None

    def shines(self, points_m: Array, normals: Array) -> Mask:
        """Whether places (R, 3) lie before the light, within its cone, and turn their normals (R, 3) to it."""
        return self.reaches(points_m, np.zeros(len(points_m)), normals)[1]

    def reaches(self, centers_m: Array, radii_m: Array, normals: Array) -> tuple[Mask, Mask]:
        """Flat things in balls (R, 3), (R,) that it surely does not shine on, and that it surely shines on all of."""
        way = centers_m - self.center_m
        facing = np.asarray(np.einsum("ri,ri->r", way, normals) < 0)
        if isinstance(self.light, AreaLight):
            before_m = way @ self.light.surface.normal
            return ~facing | (before_m <= -radii_m), facing & (before_m > radii_m)
        if isinstance(self.light, SpotLight):
            reach_m = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
            aside_rad = np.arccos(np.clip(way @ self.light.direction / reach_m, -1, 1))
            half_rad = np.arcsin(np.clip(radii_m / reach_m, 0, 1))
            outer_rad = np.deg2rad(self.light.outer_deg)
            return ~facing | (aside_rad - half_rad >= outer_rad), facing & (aside_rad + half_rad < outer_rad)
        return ~facing, facing

    def hidden(self, bodies: Bodies, points_m: Array, normals: Array, T_bodies_world: Sequence[Array]) -> Mask:
        """Whether something stands between the light and places (R, 3) that it would shine on."""
        hidden = self.shines(points_m, normals)
        lit = np.flatnonzero(hidden)
        starts = points_m[lit] + RAY_OFFSET_M * normals[lit]
        to_bodies = [T if T.ndim == 2 else T[lit] for T in T_bodies_world]
        hidden[lit] = bodies.blocked(starts, np.broadcast_to(self.center_m, starts.shape), to_bodies)
        return hidden


def lamps(scene: Scene, t_ns: int) -> Iterator[Lamp]:
    """The lights that are on at an instant, but for the sky, which has no middle."""
    for light in scene.lights:
        if not isinstance(light, Sky) and light.level.mean(t_ns, t_ns) > 0:
            yield Lamp(light, _center(light, t_ns))


def _center(light: AreaLight | PointLight | SpotLight | Sun, t_ns: int) -> Array:
    if isinstance(light, Sun):
        return FARTHEST_M * light.direction(t_ns)
    if isinstance(light, AreaLight):
        return light.surface.at(np.array(0.5), np.array(0.5))
    return light.position_m
