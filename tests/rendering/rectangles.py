"""Rectangles, rooms and boxes of them: things whose places a test can work out by hand."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.scene.mesh import moved, quad
from vobench.scene.triangles import Thing


@dataclass(frozen=True, slots=True, eq=False)
class Rectangle(Thing):
    """A corner and two edges (3,) in metres, seen from the side of edge_u × edge_v."""

    @property
    def corner_m(self) -> Array:
        return self.mesh.vertices[0]

    @property
    def edge_u_m(self) -> Array:
        return self.mesh.vertices[1] - self.corner_m

    @property
    def edge_v_m(self) -> Array:
        return self.mesh.vertices[3] - self.corner_m

    @property
    def size_m(self) -> tuple[float, float]:
        return float(np.linalg.norm(self.edge_u_m)), float(np.linalg.norm(self.edge_v_m))

    @property
    def normal(self) -> Array:
        return unit(np.cross(self.edge_u_m, self.edge_v_m))

    def at(self, u: Array, v: Array) -> Array:
        """Points (..., 3) at fractions u and v (...) along the edges."""
        return self.corner_m + u[..., None] * self.edge_u_m + v[..., None] * self.edge_v_m

    def moved(self, T_world_mover: Array) -> "Rectangle":
        return replace(self, mesh=moved(self.mesh, T_world_mover))


def sheet(corner_m: Array, edge_u_m: Array, edge_v_m: Array, material: str, name: str = "") -> Rectangle:
    return Rectangle(name, quad(corner_m, edge_u_m, edge_v_m), material)


def rectangle(center_m: Array, edge_u_m: Array, edge_v_m: Array, material: str, name: str = "") -> Rectangle:
    return sheet(center_m - (edge_u_m + edge_v_m) / 2, edge_u_m, edge_v_m, material, name)


def room(size_m: tuple[float, float, float], *, floor: str, wall: str, ceiling: str) -> list[Rectangle]:
    """The six inner sides of a box whose floor is z = 0 around the origin."""
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
    center_m: Array, size_m: tuple[float, float, float], *, yaw_deg: float, material: str, name: str = ""
) -> list[Rectangle]:
    """The six sides of a box, seen from outside: top, underside, then those around it."""
    x, y, z = np.diag(np.asarray(size_m, float)) @ se3.rotation_z(np.deg2rad(yaw_deg)).T
    c = np.asarray(center_m, float)
    ways = [(z, x, y), (-z, y, x), (x, y, z), (-x, z, y), (y, z, x), (-y, x, z)]
    return [rectangle(c + out / 2, u, v, material, name) for out, u, v in ways]
