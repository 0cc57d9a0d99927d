"""The one shape there is: a rectangle, and rooms and boxes made of it."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class Surface:
    """A rectangle: corner, two edges (3,) in metres, seen from the side of edge_u × edge_v.

    `instance` names the thing it belongs to, as ground truth tells things apart. Glass is seen from both sides.
    `texture_corner_m` is where its corner lies on its texture, so that the parts of a wall continue one another.
    """

    corner_m: Array
    edge_u_m: Array
    edge_v_m: Array
    material: str
    instance: str = ""
    texture_corner_m: tuple[float, float] = (0.0, 0.0)

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

    def on_texture_m(self, u: Array, v: Array) -> Array:
        """Places (..., 2) in metres on the texture of points at fractions u and v (...) along the edges."""
        width, height = self.size_m
        return np.stack([self.texture_corner_m[0] + u * width, self.texture_corner_m[1] + v * height], -1)

    def moved(self, T_world_mover: Array) -> "Surface":
        """The rectangle of a mover's frame where the mover is."""
        R = T_world_mover[:3, :3]
        corner = se3.apply(T_world_mover, self.corner_m[None])[0]
        return replace(self, corner_m=corner, edge_u_m=R @ self.edge_u_m, edge_v_m=R @ self.edge_v_m)


def rectangle(center_m: Array, edge_u_m: Array, edge_v_m: Array, material: str, instance: str = "") -> Surface:
    """The surface around a centre."""
    return Surface(center_m - (edge_u_m + edge_v_m) / 2, edge_u_m, edge_v_m, material, instance)


def room(size_m: tuple[float, float, float], *, floor: str, wall: str, ceiling: str) -> list[Surface]:
    """The six inner sides of a box that stands on z = 0 around the origin."""
    x, y, z = np.diag(np.asarray(size_m, float))
    middle = z / 2
    return [
        rectangle(0 * z, x, y, floor, "floor"),
        rectangle(z, y, x, ceiling, "ceiling"),
        rectangle(middle + x / 2, z, y, wall, "wall_east"),
        rectangle(middle - x / 2, y, z, wall, "wall_west"),
        rectangle(middle + y / 2, x, z, wall, "wall_north"),
        rectangle(middle - y / 2, z, x, wall, "wall_south"),
    ]


def box(
    center_m: Array, size_m: tuple[float, float, float], *, yaw_deg: float, material: str, instance: str = ""
) -> list[Surface]:
    """The five sides and the underside of a box, seen from outside."""
    x, y, z = np.diag(np.asarray(size_m, float)) @ se3.rotation_z(np.deg2rad(yaw_deg)).T
    c = np.asarray(center_m, float)
    return [
        rectangle(c + z / 2, x, y, material, instance),
        rectangle(c - z / 2, y, x, material, instance),
        rectangle(c + x / 2, y, z, material, instance),
        rectangle(c - x / 2, z, y, material, instance),
        rectangle(c + y / 2, z, x, material, instance),
        rectangle(c - y / 2, x, z, material, instance),
    ]
