"""What cameras see of bodies that move: rays against them, and occlusion of whole tiles of a picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.se3 import Array
from vobench.render.geometry import RAY_OFFSET_M, Floats, Indices, Mask, RayCaster, corners, inventory
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface

# A ray passes this many back sides before it counts as lost between surfaces that touch.
MOST_BACK_SIDES = 64


@dataclass(frozen=True, slots=True)
class VisibleSurfaces:
    """Where rays end: surface (R,) by its place in the inventory, -1 for none; distance_m (R,), NaN for none."""

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
        things = inventory(scene)
        moving = [surface for mover in scene.movers for surface in mover.surfaces]
        self.surfaces = (*scene.surfaces, *(panel.surface for panel in scene.panels), *moving)
        self.of_surface = things.mover + 1
        # The last entry is that of the surface -1: nothing.
        self.normals = np.array([*(s.normal for s in self.surfaces), np.full(3, np.nan)])
        self.corners_m = np.array([corners(s) for s in self.surfaces]).reshape(-1, 4, 3)
        self.opaque = ~things.pane
        self._offsets_m = np.array([*(s.normal @ s.corner_m for s in self.surfaces), np.nan])
        members = [self.of_surface == index for index in range(len(scene.movers) + 1)]
        self._bodies = [_body(self.surfaces, member, things.pane) for member in members]
        self._paths = [mover.path for mover in scene.movers]

    def T_world_bodies(self, t_ns: NDArray[np.int64]) -> list[Array]:
        """Where the bodies are at an instant () or at some (H,): (4, 4) each, or (H, 4, 4) for what moves."""
        poses = [np.array([path.pose(t) for t in np.ravel(t_ns).tolist()]) for path in self._paths]
        return [np.eye(4), *(T if np.ndim(t_ns) else T[0] for T in poses)]

    def visible_surfaces(self, directions: Array, T_bodies_camera: Sequence[Array]) -> VisibleSurfaces:
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
        """Whether glass is before what is seen at some distance (R,), or before nothing where that is NaN."""
        behind = np.zeros(len(directions), bool)
        limit_m = np.nan_to_num(distance_m, nan=np.inf)
        for body, T_body_camera in zip(self._bodies, T_bodies_camera, strict=True):
            if body.panes is not None:
                origins, turned = into(T_body_camera, directions)
                pane = body.panes.nearest(origins, turned)
                behind |= (pane >= 0) & (self._distance_m(pane, origins, turned)[0] < limit_m)
        return behind

    def blocked(self, starts_m: Array, targets_m: Array, T_bodies_world: Sequence[Array]) -> Mask:
        """Whether anything but glass is between starts (R, 3) and targets (R, 3), both in the world."""
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
    return np.asarray(np.einsum("ij,rj->ri" if R.ndim == 2 else "rij,rj->ri", R, vectors))


def moved(T_a_b: Array, points: Array) -> Array:
    """Points (R, 3) in b as points in a."""
    return turn(T_a_b, points) + T_a_b[..., :3, 3]


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ri,ri->r", a, b))


@dataclass(frozen=True, slots=True)
class Shot:
    """Where a camera is and when it takes a picture: a pose (4, 4) and an instant, or (H, 4, 4) and (H,) by row."""

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
    return np.asarray((1 - share) * table[first] + share * table[np.minimum(first + 1, len(table) - 1)])


def of(T: Array, rays: NDArray[np.intp]) -> Array:
    """Some rays' transforms: the only one, or their own of (R, 4, 4)."""
    return T if T.ndim == 2 else T[rays]


Scalar = TypeVar("Scalar", bound=np.generic)

TILE_PX = 16
MARGIN = 2e-6  # on sines and cosines, for float32
EDGE_ON_M = 1e-6


@dataclass(frozen=True, slots=True)
class Tiles:
    """A camera's pixels (H, W, 2), their unit rays (H, W, 3), and for each tile the cone around its pixels' rays.

    axis (V, U, 3) unit; sine (V, U) of the angle to the farthest ray, infinite where a pixel has none.
    """

    uv_px: Array
    rays: Array
    axis: Floats
    sine: Floats


@lru_cache(maxsize=4)
def tiles(camera: Camera) -> Tiles:
    """The tiles of a camera; kept, as cameras are few and pictures many."""
    uv_px = pixel_grid(camera)
    rays = camera.rays(uv_px)
    sums = _over_tiles(np.add, rays)
    with np.errstate(invalid="ignore"):
        axis = sums / np.linalg.norm(sums, axis=-1, keepdims=True)
        cosine = _over_tiles(np.minimum, (rays * spread(axis, rays.shape)).sum(-1))
    # Beyond some 60° bounds are of no use; NaN compares false.
    sine = np.where(cosine > 0.5, np.sqrt(np.clip(1 - cosine**2, 0, 1)) + MARGIN, np.inf)
    return Tiles(uv_px, rays, np.nan_to_num(axis).astype(np.float32), sine.astype(np.float32))


def spread(values: NDArray[Scalar], shape: tuple[int, ...]) -> NDArray[Scalar]:
    """Values of tiles (V, U, ...) at each of their pixels, for a picture of some shape (H, W, ...)."""
    return values.repeat(TILE_PX, 0)[: shape[0]].repeat(TILE_PX, 1)[:, : shape[1]]


def balls(planes: Array, axis: Floats, sine: Floats) -> tuple[Array, Array]:
    """Centres (T, 3) and radii (T,) of balls around what cones cut out of planes, as in `geometry.ShotSurfaces`.

    NaN or infinite where a cone does not end on its plane.
    """
    half_sine = np.minimum(sine, 1).astype(float)
    half_cosine = np.sqrt(1 - half_sine**2)
    along = np.einsum("tc,tc->t", planes, axis)
    across = np.sqrt(np.maximum((planes**2).sum(1) - along**2, 0)) * half_sine
    with np.errstate(divide="ignore", invalid="ignore"):
        middle_m, nearest_m = 1 / along, 1 / (along * half_cosine + across)
        farthest_m = np.where(along * half_cosine > across, 1 / (along * half_cosine - across), np.inf)
        aside = np.maximum(farthest_m - middle_m, middle_m - nearest_m)
        return axis * middle_m[:, None], (aside + middle_m * np.sqrt(2 - 2 * half_cosine)) * (1 + MARGIN)


def _over_tiles(reduce: np.ufunc, values: Array) -> Array:
    """A reduction over the pixels of each tile: (H, W, ...) to (V, U, ...)."""
    height, width = values.shape[:2]
    by_row = reduce.reduceat(values, np.arange(0, height, TILE_PX), axis=0)
    return np.asarray(reduce.reduceat(by_row, np.arange(0, width, TILE_PX), axis=1))


class PointView:
    """Rectangles as one point sees them: corners (S, 4, 3) relative to it, `counts` (S,) says which count."""

    def __init__(self, corners_m: Array, counts: Mask) -> None:
        normal = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 3] - corners_m[:, 0])
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        away_m = np.einsum("sc,sc->s", normal, corners_m[:, 0])
        # A rectangle seen edge-on hides nothing.
        self._which = np.flatnonzero(counts & (np.abs(away_m) > EDGE_ON_M))
        corner, normal, away_m = corners_m[self._which], normal[self._which], away_m[self._which]
        edges = np.cross(corner, np.roll(corner, -1, axis=1))
        inward = np.sign(np.einsum("sec,sc->se", edges, corner.mean(1)))[..., None]
        length = np.linalg.norm(edges, axis=-1, keepdims=True)
        # Where the point lies in line with an edge the normal is 0: neither inside nor outside.
        self._edges = (inward * edges / np.where(length > 0, length, 1.0)).astype(np.float32)
        self._normal = (np.where(away_m < 0, -1, 1)[:, None] * normal).astype(np.float32)
        self._away_m = np.abs(away_m).astype(np.float32)

    def fills(self, axis: Floats, sine: Floats) -> Indices:
        """The surface that is all there is to see in cones (T, 3), (T,), -1 where that is not sure."""
        inside = self._inside(axis)
        nearest_m, farthest_m = self._range_m(axis, sine)
        covering = np.where((inside > sine[:, None]), farthest_m, np.inf)
        if not len(self._which):
            return np.full(len(axis), -1, np.int32)
        best = covering.argmin(1)
        limit_m = np.take_along_axis(covering, best[:, None], 1)
        other = (inside >= -sine[:, None]) & (nearest_m < limit_m)
        np.put_along_axis(other, best[:, None], values=False, axis=1)
        sure = np.isfinite(limit_m[:, 0]) & ~other.any(1)
        return np.where(sure, self._which[best], -1).astype(np.int32)

    def shading(self, centers_m: Array, radii_m: Array, own: Indices) -> tuple[Mask, Mask]:
        """Balls (T, 3), (T,) of points of surfaces `own` (T,) that are surely all visible, and surely all hidden."""
        reach_m = np.linalg.norm(centers_m, axis=-1)
        outside = reach_m > 2 * radii_m
        reach_m, centers_m = np.where(outside, reach_m, 1), np.where(outside[:, None], centers_m, 1)
        axis = (centers_m / reach_m[:, None]).astype(np.float32)
        sine = (np.where(outside, radii_m / reach_m, 1) + MARGIN).astype(np.float32)
        inside, (nearest_m, farthest_m) = self._inside(axis), self._range_m(axis, sine)
        others = self._which != own[:, None]
        before = others & (inside >= -sine[:, None]) & (nearest_m < (reach_m + radii_m)[:, None])
        across = others & (inside > sine[:, None]) & (farthest_m < (reach_m - radii_m)[:, None])
        return np.asarray(outside & ~before.any(1)), np.asarray(outside & across.any(1))

    def touches(self, axis: Floats, sine: Floats) -> Mask:
        """Whether anything may be in cones (T, 3), (T,)."""
        return np.asarray(~(self._inside(axis) < -sine[:, None]).all(1))

    def _inside(self, axis: Floats) -> Floats:
        """The least sine (T, S) of the angle between axes and the planes through the point and an edge."""
        first, second, third, fourth = (np.einsum("tc,sc->ts", axis, self._edges[:, edge]) for edge in range(4))
        return np.asarray(np.minimum(np.minimum(first, second), np.minimum(third, fourth)))

    def _range_m(self, axis: Floats, sine: Floats) -> tuple[Floats, Floats]:
        """How near and how far (T, S) the surfaces' planes may be along rays of cones."""
        half_sine = np.minimum(sine, 1)[:, None]
        half_cosine = np.sqrt(1 - half_sine**2)
        cosine = np.clip(np.einsum("tc,sc->ts", axis, self._normal), -1, 1)
        along, across = cosine * half_cosine, np.sqrt(1 - cosine**2) * half_sine
        # Within the cone's half angle of the normal, the normal itself is among the rays.
        most = np.where(cosine >= half_cosine, 1, along + across) + np.float32(MARGIN)
        least = along - across - np.float32(MARGIN)
        with np.errstate(divide="ignore", invalid="ignore"):
            nearest = np.where(most > 0, self._away_m / most, np.inf)
            farthest = np.where(least > 0, self._away_m / least, np.inf)
        return nearest, farthest
