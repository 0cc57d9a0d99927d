"""A scene is rectangles with materials, and area lights; everything in metres, world frame, z up."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.texture import Texture


@dataclass(frozen=True, slots=True)
class Surface:
    """A rectangle: corner, two edges (3,) in metres, seen from the side of edge_u × edge_v."""

    corner_m: Array
    edge_u_m: Array
    edge_v_m: Array
    material: str

    @property
    def size_m(self) -> tuple[float, float]:
        """Lengths of the two edges."""
        return float(np.linalg.norm(self.edge_u_m)), float(np.linalg.norm(self.edge_v_m))

    @property
    def normal(self) -> Array:
        """Unit vector (3,) on the visible side."""
        n = np.cross(self.edge_u_m, self.edge_v_m)
        return n / np.linalg.norm(n)

    def at(self, u: Array, v: Array) -> Array:
        """Points (..., 3) at fractions u and v (...) along the edges."""
        return self.corner_m + u[..., None] * self.edge_u_m + v[..., None] * self.edge_v_m


@dataclass(frozen=True, slots=True)
class AreaLight:
    """A rectangle that emits `power_lm` evenly and to all sides of its front (Lambert)."""

    name: str
    surface: Surface
    power_lm: float

    @property
    def luminance_cd_m2(self) -> float:
        """Luminance of the panel: power / (π area)."""
        width, height = self.surface.size_m
        return self.power_lm / (np.pi * width * height)


@dataclass(frozen=True, slots=True)
class Scene:
    """Surfaces, the textures of their materials by name, and the lights that shine on them."""

    name: str
    surfaces: tuple[Surface, ...]
    textures: dict[str, Texture]
    lights: tuple[AreaLight, ...]


def rectangle(center_m: Array, edge_u_m: Array, edge_v_m: Array, material: str) -> Surface:
    """The surface around a centre."""
    return Surface(center_m - (edge_u_m + edge_v_m) / 2, edge_u_m, edge_v_m, material)


def room(size_m: tuple[float, float, float], *, floor: str, wall: str, ceiling: str) -> list[Surface]:
    """The six inner sides of a box that stands on z = 0 around the origin."""
    x, y, z = np.diag(np.asarray(size_m, float))
    middle = z / 2
    return [
        rectangle(0 * z, x, y, floor),
        rectangle(z, y, x, ceiling),
        rectangle(middle + x / 2, z, y, wall),
        rectangle(middle - x / 2, y, z, wall),
        rectangle(middle + y / 2, x, z, wall),
        rectangle(middle - y / 2, z, x, wall),
    ]


def box(center_m: Array, size_m: tuple[float, float, float], *, yaw_deg: float, material: str) -> list[Surface]:
    """The five sides and the underside of a box, seen from outside."""
    x, y, z = np.diag(np.asarray(size_m, float)) @ se3.rotation_z(np.deg2rad(yaw_deg)).T
    c = np.asarray(center_m, float)
    return [
        rectangle(c + z / 2, x, y, material),
        rectangle(c - z / 2, y, x, material),
        rectangle(c + x / 2, y, z, material),
        rectangle(c - x / 2, z, y, material),
        rectangle(c + y / 2, z, x, material),
        rectangle(c - y / 2, x, z, material),
    ]


def ceiling_light(name: str, center_m: Array, size_m: tuple[float, float], *, power_lm: float) -> AreaLight:
    """A panel that hangs level and shines down."""
    x, y = np.array([size_m[0], 0, 0]), np.array([0, size_m[1], 0])
    return AreaLight(name, rectangle(np.asarray(center_m, float), y, x, name), power_lm)
