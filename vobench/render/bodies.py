"""What rays see among things that stand and things that move: the front sides of all that is not glass.

A body is a set of surfaces that move as one; body 0 is the world, the others are the movers in order.
Rays are taken into each body's own frame, so nothing is built anew when a mover moves, and every ray
may belong to an instant of its own. A transform is (4, 4), or (R, 4, 4) with one for each ray.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.render.geometry import RAY_OFFSET_M, Indices, Mask, RayCaster, corners, inventory
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface

# A ray passes this many back sides before it counts as lost between surfaces that touch.
MOST_BACK_SIDES = 64


@dataclass(frozen=True, slots=True)
class Seen:
    """Where sight ends: surface (R,) by its place in the inventory, -1 for none; distance_m (R,), NaN for none."""

    surface: Indices
    distance_m: Array


@dataclass(frozen=True, slots=True)
class Body:
    """A body's opaque surfaces, its panes (None without any), and a sphere around both."""

    solid: RayCaster
    panes: RayCaster | None
    center_m: Array
    radius_m: float

    def near(self, origins_m: Array, directions: Array, reach_m: Array | float = np.inf) -> Mask:
        """Which rays (R, 3) of unit length pass the sphere within `reach_m` of their origins (R, 3)."""
        away = self.center_m - origins_m
        beside = _dot(away, directions)
        along = np.clip(beside, 0, reach_m)
        return np.asarray(_dot(away, away) - along * (2 * beside - along) <= self.radius_m**2)


class Bodies:
    """The surfaces of a scene in the inventory's order, each in its body's frame, and rays against them."""

    def __init__(self, scene: Scene) -> None:
        stock = inventory(scene)
        moving = [surface for mover in scene.movers for surface in mover.surfaces]
        self.surfaces = (*scene.surfaces, *(panel.surface for panel in scene.panels), *moving)
        self.of_surface = stock.mover + 1
        # The last entry is that of the surface -1: nothing.
        self.normals = np.array([*(s.normal for s in self.surfaces), np.full(3, np.nan)])
        self.corners_m = np.array([corners(s) for s in self.surfaces]).reshape(-1, 4, 3)
        self.opaque = ~stock.pane
        self._offsets_m = np.array([*(s.normal @ s.corner_m for s in self.surfaces), np.nan])
        members = [self.of_surface == index for index in range(len(scene.movers) + 1)]
        self._bodies = [_body(self.surfaces, member, stock.pane) for member in members]
        self._paths = [mover.path for mover in scene.movers]

    def T_world_bodies(self, t_ns: NDArray[np.int64]) -> list[Array]:
        """Where the bodies are at an instant () or at some (H,): (4, 4) each, or (H, 4, 4) for what moves."""
        poses = [np.array([path.pose(t) for t in np.ravel(t_ns).tolist()]) for path in self._paths]
        return [np.eye(4), *(T if np.ndim(t_ns) else T[0] for T in poses)]

    def look(self, directions: Array, T_bodies_camera: Sequence[Array]) -> Seen:
        """What a camera sees along unit directions (R, 3) in its own frame; nothing along NaN."""
        world, *movers = self._bodies
        seen = self._meet(world, *into(T_bodies_camera[0], directions))
        for body, T_body_camera in zip(movers, T_bodies_camera[1:], strict=True):
            origins, turned = into(T_body_camera, directions)
            near = np.flatnonzero(body.near(origins, turned))
            met = self._meet(body, origins[near], turned[near])
            nearer = met.distance_m < np.nan_to_num(seen.distance_m[near], nan=np.inf)
            seen.surface[near[nearer]], seen.distance_m[near[nearer]] = met.surface[nearer], met.distance_m[nearer]
        return seen

    def behind_panes(self, directions: Array, T_bodies_camera: Sequence[Array], distance_m: Array) -> Mask:
        """Whether glass stands before what is seen at some distance (R,), or before nothing where that is NaN."""
        behind = np.zeros(len(directions), bool)
        limit_m = np.nan_to_num(distance_m, nan=np.inf)
        for body, T_body_camera in zip(self._bodies, T_bodies_camera, strict=True):
            if body.panes is not None:
                origins, turned = into(T_body_camera, directions)
                pane = body.panes.nearest(origins, turned)
                behind |= (pane >= 0) & (self._distance_m(pane, origins, turned)[0] < limit_m)
        return behind

    def blocked(self, starts_m: Array, targets_m: Array, T_bodies_world: Sequence[Array]) -> Mask:
        """Whether anything but glass stands between starts (R, 3) and targets (R, 3), both in the world."""
        world, *movers = self._bodies
        hidden = world.solid.occluded(starts_m, targets_m)
        for body, T_body_world in zip(movers, T_bodies_world[1:], strict=True):
            start, target = moved(T_body_world, starts_m), moved(T_body_world, targets_m)
            way = target - start
            reach_m = np.linalg.norm(way, axis=1)
            near = np.flatnonzero(body.near(start, way / reach_m[:, None], reach_m))
            hidden[near] |= body.solid.occluded(start[near], target[near])
        return hidden

    def _meet(self, body: Body, origins_m: Array, directions: Array) -> Seen:
        """The first front side of a body along rays (R, 3) in its frame."""
        surface = body.solid.nearest(origins_m, directions)
        distance_m, cosine = self._distance_m(surface, origins_m, directions)
        for _ in range(MOST_BACK_SIDES):
            backs = np.flatnonzero((surface >= 0) & (cosine >= 0))
            if not len(backs):
                break
            passed_m, onward = distance_m[backs] + RAY_OFFSET_M, directions[backs]
            start = origins_m[backs] + passed_m[:, None] * onward
            surface[backs] = body.solid.nearest(start, onward)
            farther_m, cosine[backs] = self._distance_m(surface[backs], start, onward)
            distance_m[backs] = passed_m + farther_m
        return Seen(surface, distance_m)

    def _distance_m(self, surface: Indices, origins_m: Array, directions: Array) -> tuple[Array, Array]:
        """How far the surfaces' planes are along rays (R, 3), and the cosines to their normals; NaN for none.

        Embree works in float32: it says which surface a ray meets, the plane's equation where.
        """
        normals = self.normals[surface]
        cosine = _dot(normals, directions)
        return (self._offsets_m[surface] - _dot(normals, origins_m)) / cosine, cosine


def _body(surfaces: Sequence[Surface], member: Mask, pane: Mask) -> Body:
    points = np.array([corners(surfaces[i]) for i in np.flatnonzero(member).tolist()]).reshape(-1, 3)
    center_m = (points.min(0) + points.max(0)) / 2 if len(points) else np.zeros(3)
    panes = np.flatnonzero(member & pane)
    return Body(
        RayCaster(surfaces, np.flatnonzero(member & ~pane)),
        RayCaster(surfaces, panes) if len(panes) else None,
        center_m,
        float(np.linalg.norm(points - center_m, axis=1).max(initial=0.0)) + RAY_OFFSET_M,
    )


def into(T_body_camera: Array, directions: Array) -> tuple[Array, Array]:
    """Rays from a camera's centre along unit directions (R, 3): origins (R, 3) and directions in a body's frame."""
    turned = turn(T_body_camera, directions)
    return np.broadcast_to(T_body_camera[..., :3, 3], turned.shape), turned


def turn(T_a_b: Array, vectors: Array) -> Array:
    """Directions (R, 3) in b as directions in a."""
    R = T_a_b[..., :3, :3]
    # Not by BLAS: its threads spin on products as narrow as these.
    turned: Array = np.einsum("ij,rj->ri" if R.ndim == 2 else "rij,rj->ri", R, vectors)
    return turned


def moved(T_a_b: Array, points: Array) -> Array:
    """Points (R, 3) in b as points in a."""
    return turn(T_a_b, points) + T_a_b[..., :3, 3]


def _dot(a: Array, b: Array) -> Array:
    """Products (R,) of vectors (R, 3)."""
    product: Array = np.einsum("ri,ri->r", a, b)
    return product
