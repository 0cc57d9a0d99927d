"""Planar mirrors: where a plane is, the world as it shows it, and which part of a picture it can fill."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array

Box = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Plane:
    """All points x with normal · x + offset_m = 0; the normal is a unit vector (3,)."""

    normal: Array
    offset_m: float

    def distance_m(self, point_m: Array) -> float:
        """Signed distance of a point (3,): positive on the side of the normal."""
        return float(self.normal @ point_m + self.offset_m)

    def flipped(self) -> "Plane":
        """The same plane, seen from its other side."""
        return Plane(-self.normal, -self.offset_m)

    def moved(self, T_world_mover: Array) -> "Plane":
        """The plane of a mover's frame where the mover is."""
        normal = T_world_mover[:3, :3] @ self.normal
        return Plane(normal, self.offset_m - float(normal @ T_world_mover[:3, 3]))

    @property
    def reflection(self) -> Array:
        """Matrix (4, 4) that takes each point to its image behind the plane (Householder, 1958)."""
        reflection = np.eye(4)
        reflection[:3, :3] -= 2 * np.outer(self.normal, self.normal)
        reflection[:3, 3] = -2 * self.offset_m * self.normal
        return reflection

    @property
    def key(self) -> tuple[float, ...]:
        """Equal for planes that coincide to 10 µm."""
        return tuple(float(x) + 0.0 for x in np.round([*self.normal, self.offset_m], 5))


def visible_box(camera: Pinhole, quads_camera_m: Array, within: Box, *, near_m: float) -> Box | None:
    """Columns and rows (first, end, first, end) that quads (K, 4, 3) can touch, None for none.

    Edges are cut at the near plane, behind which a projection has no meaning.
    """
    here, there = quads_camera_m.reshape(-1, 3), np.roll(quads_camera_m, -1, axis=1).reshape(-1, 3)
    z0, z1 = here[:, 2] - near_m, there[:, 2] - near_m
    crossing = (z0 < 0) != (z1 < 0)
    share = (z0[crossing] / (z0[crossing] - z1[crossing]))[:, None]
    cut = here[crossing] + share * (there[crossing] - here[crossing])
    points = np.concatenate([here[z0 >= 0], cut])
    if len(points) == 0:
        return None
    u = points[:, 0] / points[:, 2] * camera.fx_px + camera.cx_px
    v = points[:, 1] / points[:, 2] * camera.fy_px + camera.cy_px
    return overlap(within, _whole_pixels(u, v))


def _whole_pixels(u: Array, v: Array) -> Box:
    limits = np.array([u.min() - 1, u.max() + 2, v.min() - 1, v.max() + 2])
    first_u, end_u, first_v, end_v = np.floor(np.clip(limits, -1e6, 1e6)).astype(int).tolist()
    return first_u, end_u, first_v, end_v


def overlap(a: Box, b: Box) -> Box | None:
    """The pixels in both boxes, None for none."""
    u0, u1, v0, v1 = max(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), min(a[3], b[3])
    return (u0, u1, v0, v1) if u0 < u1 and v0 < v1 else None
