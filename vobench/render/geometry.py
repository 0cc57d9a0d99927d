"""What rays hit: triangles of a scene that stands, bodies that move, and cameras among them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.material import Glass
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface

Floats = NDArray[Any]  # float32 where there are many, float64 inside formulas
Indices = NDArray[np.int32]
Mask = NDArray[np.bool_]

# Rays start this far off their surface; float32 resolves 1e-6 m at 10 m.
RAY_OFFSET_M = 1e-4


@dataclass(frozen=True, slots=True)
class SurfaceList:
    """Every rectangle of a scene in one order: what stands still, the lights' panels, what moves.

    surfaces are where they are at one instant; mover (S,) is the index of the mover a surface belongs to, -1 for
    none; panel (S,) the index among scene.panels, -1 for none; pane (S,) whether it is glass.
    """

    surfaces: tuple[Surface, ...]
    mover: Indices
    panel: Indices
    pane: Mask


def inventory(scene: Scene, *, t_ns: float = 0) -> SurfaceList:
    """All rectangles of a scene, the movers' where they are at t_ns; the order never changes."""
    surfaces, mover, panel = list(scene.surfaces), [-1] * len(scene.surfaces), [-1] * len(scene.surfaces)
    for index, light in enumerate(scene.panels):
        surfaces, mover, panel = [*surfaces, light.surface], [*mover, -1], [*panel, index]
    for index, thing in enumerate(scene.movers):
        T_world_mover = thing.path.pose(t_ns)
        surfaces += [surface.moved(T_world_mover) for surface in thing.surfaces]
        mover += [index] * len(thing.surfaces)
        panel += [-1] * len(thing.surfaces)
    pane = [isinstance(scene.materials.get(s.material), Glass) for s in surfaces]
    return SurfaceList(tuple(surfaces), np.array(mover, np.int32), np.array(panel, np.int32), np.array(pane, bool))


def corners(surface: Surface) -> Array:
    """The four corners (4, 3), counter-clockwise from the visible side."""
    o, u, v = surface.corner_m, surface.edge_u_m, surface.edge_v_m
    return np.stack([o, o + u, o + u + v, o + v])


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere around something: centre (..., 3) and radius (...)."""

    centre_m: Array
    radius_m: Any

    def take(self, which: NDArray[np.int64]) -> "Ball":
        """Some of many."""
        return Ball(self.centre_m[which], self.radius_m[which])


def ball(surfaces: Sequence[Surface]) -> Ball:
    """Around the corners of them all."""
    points = np.concatenate([corners(s) for s in surfaces])
    centre = (points.min(0) + points.max(0)) / 2
    return Ball(centre, float(np.linalg.norm(points - centre, axis=1).max()))


@dataclass(frozen=True, slots=True)
class Hits:
    """Where rays end: surface (R,) int32, -1 for none; u, v (R,) fractions of its edges.

    distance (R,) is in lengths of the ray's direction, NaN for none.
    """

    surface: Indices
    u: Floats
    v: Floats
    distance: Floats


class RayCaster:
    """Rays against some of the surfaces of a list, with Embree; two triangles a rectangle.

    `among` (K,) says which; hits name surfaces by their place in the whole list.
    """

    def __init__(self, surfaces: Sequence[Surface], among: ArrayLike) -> None:
        self._among = np.asarray(among, np.int32)
        quads = [corners(surfaces[i]) for i in self._among]
        # A scene without triangles would make Embree fail; one beyond everything is never hit.
        quads = quads or [np.full((4, 3), 1e7)]
        triangles = np.stack(quads).astype(np.float32)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
        from embreex import mesh_construction, rtcore_scene

        self._scene = rtcore_scene.EmbreeScene()
        self._mesh = mesh_construction.TriangleMesh(self._scene, np.ascontiguousarray(triangles))

    def occluded(self, origins_m: ArrayLike, targets_m: ArrayLike) -> Mask:
        """Whether anything stands between each of (R, 3) origins and its target (R, 3)."""
        return self.stops(origins_m, np.asarray(targets_m) - np.asarray(origins_m))

    def stops(self, origins_m: ArrayLike, way: ArrayLike) -> Mask:
        """Whether anything stands between origins and origins + way (R, 3)."""
        blocked = np.asarray(self._scene.run(*_rays(origins_m, way, reach=1 - 1e-3), query="OCCLUDED"))
        is_blocked: Mask = blocked >= 0
        return is_blocked

    def nearest(self, origins_m: ArrayLike, directions: ArrayLike) -> Indices:
        """Which surface each ray (R, 3) meets first, -1 for none: `hits` for those who work out the rest."""
        triangle: Indices = self._scene.run(*_rays(origins_m, directions, reach=1e8), query="INTERSECT")
        if not len(self._among):
            return np.full(len(triangle), -1, np.int32)
        # The triangle -1 halves to -1, the added last place.
        surface: Indices = np.append(self._among, np.int32(-1))[triangle >> 1]
        return surface

    def hits(self, origins_m: ArrayLike, directions: ArrayLike) -> Hits:
        """The nearest surface along each ray (R, 3)."""
        rays = _rays(origins_m, directions, reach=1e8)
        hit: dict[str, NDArray[np.float32]] = self._scene.run(*rays, query="INTERSECT", output=1)
        missed, second = hit["primID"] < 0, hit["primID"] % 2 == 1
        # Embree's (u, v) weigh a triangle's second and third corner; ours run along the edges.
        a, b = hit["u"], hit["v"]
        u, v = np.where(second, a, a + b), np.where(second, a + b, b)
        surface = np.full(len(a), -1, np.int32)
        surface[~missed] = self._among[hit["primID"][~missed].astype(np.int32) // 2]
        distance = np.where(missed, np.nan, hit["tfar"])
        return Hits(surface, u.astype(np.float32), v.astype(np.float32), distance.astype(np.float32))


def _rays(origins_m: ArrayLike, directions: ArrayLike, *, reach: float) -> tuple[Floats, Floats, Floats]:
    """Contiguous float32 arrays, as Embree wants them; `reach` in lengths of the direction."""
    origins = np.ascontiguousarray(origins_m, np.float32)
    return origins, np.ascontiguousarray(directions, np.float32), np.full(len(origins), reach, np.float32)


# A ray passes this many back sides before it counts as lost between surfaces that touch.
MOST_BACK_SIDES = 64


@dataclass(frozen=True, slots=True)
class VisibleSurfaces:
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

    def look(self, directions: Array, T_bodies_camera: Sequence[Array]) -> VisibleSurfaces:
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

    def _meet(self, body: Body, origins_m: Array, directions: Array) -> VisibleSurfaces:
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
        return VisibleSurfaces(surface, distance_m)

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


@dataclass(frozen=True, slots=True)
class Shot:
    """Where a camera stands and when it takes a picture: a pose (4, 4) and an instant, or (H, 4, 4) and (H,) by row."""

    T_world_camera: Array
    t_ns: NDArray[np.int64] | int


@dataclass(frozen=True, slots=True)
class ShotSurfaces:
    """All surfaces from a camera at one instant: corners (S, 4, 3) in its frame, planes (S + 1, 3), what it faces (S,).

    A plane's product with a unit ray is one over the distance along that ray.
    """

    corners_m: Array
    planes: Array
    facing: Mask


@dataclass(frozen=True, slots=True)
class ShotTransforms:
    """A shot as transforms, there and back: each body's (4, 4), or (H, 4, 4) by row.

    `snapshot` is None where the camera or a body moves meanwhile.
    """

    T_world_bodies: list[Array]
    T_bodies_world: list[Array]
    T_bodies_camera: list[Array]
    T_camera_bodies: list[Array]
    snapshot: ShotSurfaces | None


def shot_transforms(bodies: Bodies, shot: Shot) -> ShotTransforms:
    """The transforms of a shot."""
    T_world_bodies = bodies.T_world_bodies(np.asarray(shot.t_ns, np.int64))
    T_bodies_world = [se3.inverse(T) for T in T_world_bodies]
    T_bodies_camera = [T @ shot.T_world_camera for T in T_bodies_world]
    T_camera_bodies = [se3.inverse(T) for T in T_bodies_camera]
    rolling = any(T.ndim == 3 for T in T_bodies_camera)
    snapshot = None if rolling else _snapshot(bodies, np.stack(T_camera_bodies))
    return ShotTransforms(T_world_bodies, T_bodies_world, T_bodies_camera, T_camera_bodies, snapshot)


def _snapshot(bodies: Bodies, T_camera_bodies: Array) -> ShotSurfaces:
    T_camera_surfaces = T_camera_bodies[bodies.of_surface]
    corners_m = se3.apply(T_camera_surfaces, bodies.corners_m)
    normals = np.einsum("sij,sj->si", T_camera_surfaces[:, :3, :3], bodies.normals[:-1])
    away_m = np.einsum("si,si->s", normals, corners_m[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):  # a plane through the camera is seen edge-on: never
        planes = normals / away_m[:, None]
    return ShotSurfaces(corners_m, np.append(planes, np.full((1, 3), np.nan), axis=0), away_m < 0)


def at_rows(tables: Sequence[Array], rows: Array) -> list[Array]:
    """The transforms of each table for rays on rows (R,): (4, 4) as it is, (H, 4, 4) as (R, 4, 4)."""
    return [_between(T, rows) if T.ndim == 3 else T for T in tables]


def _between(table: Array, rows: Array) -> Array:
    """Transforms (R, 4, 4) at rows between those of a table (H, 4, 4); beyond its ends the last ones.

    Two rows differ by so little that a straight line between matrices is a rotation to the last bits.
    """
    place = np.clip(np.nan_to_num(rows), 0, len(table) - 1)
    first = np.minimum(place.astype(np.int64), max(len(table) - 2, 0))
    share = (place - first)[:, None, None]
    if not share.any():
        return table[first]
    blend: Array = (1 - share) * table[first] + share * table[np.minimum(first + 1, len(table) - 1)]
    return blend


def of(T: Array, rays: NDArray[np.intp]) -> Array:
    """Some rays' transforms: the only one, or their own of (R, 4, 4)."""
    return T if T.ndim == 2 else T[rays]
