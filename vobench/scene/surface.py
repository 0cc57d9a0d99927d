"""Rectangles, rooms and boxes made of them, and windows in their walls."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

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


# A wall with holes reaches this far behind its neighbours, so that no daylight shows through a joint.
LAP_M = 0.005


@dataclass(frozen=True, slots=True)
class Window:
    """A hole around (u, v) metres from a wall's corner, with a pane depth_m behind the wall's face.

    `pane` and `reveal` name the materials of the glass and of the sides of the hole.
    """

    center_m: tuple[float, float]
    size_m: tuple[float, float]
    depth_m: float
    pane: str
    reveal: str
    instance: str

    @property
    def edges_m(self) -> tuple[float, float, float, float]:
        """First and last u, first and last v."""
        (u, v), (width, height) = self.center_m, self.size_m
        return u - width / 2, u + width / 2, v - height / 2, v + height / 2


def with_windows(wall: Surface, windows: Sequence[Window]) -> list[Surface]:
    """The wall as a grid of rectangles that leaves the windows out, then each window's reveals and pane.

    The grid's lines run through the whole wall: its parts share their corners, so no joint opens in a picture.
    """
    width, height = wall.size_m
    cuts_u = np.unique([-LAP_M, 0.0, width, width + LAP_M, *(u for w in windows for u in w.edges_m[:2])])
    cuts_v = np.unique([-LAP_M, 0.0, height, height + LAP_M, *(v for w in windows for v in w.edges_m[2:])])
    parts = [
        _part(wall, u0, u1, v0, v1)
        for u0, u1 in pairwise(cuts_u)
        for v0, v1 in pairwise(cuts_v)
        if not any(_inside(window, (u0 + u1) / 2, (v0 + v1) / 2) for window in windows)
    ]
    return parts + [surface for window in windows for surface in _fittings(wall, window)]


def _inside(window: Window, u_m: float, v_m: float) -> bool:
    u0, u1, v0, v1 = window.edges_m
    return u0 < u_m < u1 and v0 < v_m < v1


def _part(wall: Surface, u0: float, u1: float, v0: float, v1: float) -> Surface:
    axis_u, axis_v = _axes(wall)
    corner = wall.corner_m + u0 * axis_u + v0 * axis_v
    edge_u, edge_v = (u1 - u0) * axis_u, (v1 - v0) * axis_v
    return replace(wall, corner_m=corner, edge_u_m=edge_u, edge_v_m=edge_v, texture_corner_m=(float(u0), float(v0)))


def _axes(wall: Surface) -> tuple[Array, Array]:
    width, height = wall.size_m
    return wall.edge_u_m / width, wall.edge_v_m / height


def _fittings(wall: Surface, window: Window) -> list[Surface]:
    axis_u, axis_v = _axes(wall)
    u0, u1, v0, v1 = window.edges_m
    near = wall.corner_m + u0 * axis_u + v0 * axis_v
    across, along, deep = (u1 - u0) * axis_u, (v1 - v0) * axis_v, -window.depth_m * wall.normal
    pane = Surface(near + deep, across, along, window.pane, window.instance)
    sides = [(near, deep, along), (near + across, along, deep), (near, across, deep), (near + along, deep, across)]
    return [*(Surface(c, u, v, window.reveal, window.instance) for c, u, v in sides), pane]
