"""Rays against the faces of a scene, and how much light passes between two points."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array
from vobench.rendering.embree import new_scene, with_portable_places
from vobench.scene.material import Material, pane_reflectance
from vobench.scene.mesh import Triangles, areas_m2, distinct, unit

Floats = NDArray[Any]  # float32 where there are many, float64 inside formulas
Indices = NDArray[np.int32]
Mask = NDArray[np.bool_]
T = TypeVar("T")

# Rays start this far off their face, and further the further they are from the origin: float32 resolves 1e-7 of it.
RAY_OFFSET_M = 1e-4
RAY_OFFSET = 1e-6
FAR_M = 1e3  # beyond every scene
MOST_PANES = 16  # crossed by one ray
# faces this near to one plane lie in it
FLAT_RAD = 1e-3
FLAT_M = 1e-3
WIDE_M2 = 0.05  # of mirrors that show lamps and of panes that show the sky


def take(table: T, which: NDArray[np.int64] | Mask | slice) -> T:
    """Some rows of all the arrays that a dataclass has."""
    return type(table)(*(getattr(table, field.name)[which] for field in fields(table)))  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere around something: centre (..., 3) and radius (...)."""

    centre_m: Array
    radius_m: Any

    take = take


def ball(points_m: Array) -> Ball:
    """Around points (..., 3)."""
    points = points_m.reshape(-1, 3)
    centre = (points.min(0) + points.max(0)) / 2
    return Ball(centre, float(np.linalg.norm(points - centre, axis=1).max()))


@dataclass(frozen=True, slots=True)
class Flat:
    """Faces (K,) of a table that lie in one plane, seen from one side: their corners (K, 3, 3) and normal (3,)."""

    faces: Indices
    corners_m: Array
    normal: Array

    def height_m(self, points_m: Floats) -> Floats:
        """How far (...) points (..., 3) lie before the plane."""
        return np.asarray((points_m - self.corners_m[0, 0]) @ self.normal)

    def coincides(self, other: "Flat") -> bool:
        """Whether they are the front and the back of one sheet."""
        apart_m = np.abs(self.corners_m.mean((0, 1)) - other.corners_m.mean((0, 1))).max()
        return bool(apart_m < FLAT_M and self.normal @ other.normal < 0)


def flats(faces: Triangles, among: ArrayLike, *, at_least_m2: float = 0.0) -> list[Flat]:
    """Some faces, plane by plane of each thing, without planes that hold less than some area."""
    own = np.asarray(among, np.int32)
    offset = np.einsum("ij,ij->i", faces.plane[own], faces.corners_m[own, 0])
    keys = np.rint(np.column_stack([faces.plane[own] / FLAT_RAD, offset / FLAT_M, faces.thing[own]])).astype(np.int64)
    groups = distinct(keys)[1]
    members = [own[groups == group] for group in range(groups.max(initial=-1) + 1)]
    found = [Flat(some, faces.corners_m[some], unit(faces.plane[some].mean(0))) for some in members]
    return [flat for flat in found if areas_m2(flat.corners_m).sum() >= at_least_m2]


@dataclass(frozen=True, slots=True)
class Hits:
    """Where rays end: face (R,) int32, -1 for none; u, v (R,) weigh its second and third corner.

    distance (R,) is in lengths of the ray's direction, NaN for none.
    """

    face: Indices
    u: Floats
    v: Floats
    distance: Floats

    take = take

    def at(self, of_corners: Floats) -> Floats:
        """Values (R, ...) between those of faces' corners (F, 3, ...)."""
        a, b, c = of_corners[self.face].swapaxes(0, 1)
        shape = (-1, *[1] * (a.ndim - 1))
        u = self.u.reshape(shape)
        v = self.v.reshape(shape)
        return np.asarray(a + u * (b - a) + v * (c - a))


def twins(corners_m: Array) -> Indices:
    """For each triangle (F, 3, 3) one with the same corners in reverse, its back where a sheet has two sides; or -1."""
    weights = np.sqrt(np.arange(2.0, 11.0)).reshape(3, 3)
    reverse = np.ascontiguousarray(corners_m[:, ::-1])
    keys, wanted = (np.einsum("fij,ij->f", np.ascontiguousarray(c), weights) for c in (corners_m, reverse))
    order = np.argsort(keys, kind="stable")
    found = order[np.clip(np.searchsorted(keys[order], wanted), 0, max(len(order) - 1, 0))]
    same = (corners_m[found] == reverse).all((1, 2))
    return np.where(same, found, -1).astype(np.int32)


class RayCaster:
    """Rays against some faces of a table, with Embree; `among` (K,) says which; hits name them as the table does.

    Of the two sides of a sheet rays meet the one that they come from.
    """

    def __init__(self, faces: Triangles, among: ArrayLike | None = None) -> None:
        self._among = np.arange(len(faces), dtype=np.int32) if among is None else np.asarray(among, np.int32)
        triangles = faces.corners_m[self._among].astype(np.float32)
        # A scene without triangles would make Embree fail; one beyond everything is never hit.
        triangles = triangles if len(triangles) else np.full((1, 3, 3), 1e7, np.float32)
        from embreex import mesh_construction

        self._triangles = triangles
        self._scene = new_scene(robust=True)
        self._mesh = mesh_construction.TriangleMesh(self._scene, np.ascontiguousarray(triangles))
        self._twin = twins(faces.corners_m[self._among])
        self._planes = faces.plane[self._among]
        self._has_sheets = bool((self._twin >= 0).any())
        self.solid = self._among[self._twin < 0]

    def occluded(self, origins_m: ArrayLike, targets_m: ArrayLike) -> Mask:
        """Whether anything is between each of (R, 3) origins and its target (R, 3)."""
        return self.stops(origins_m, np.asarray(targets_m) - np.asarray(origins_m))

    def stops(self, origins_m: ArrayLike, way: ArrayLike) -> Mask:
        """Whether anything is between origins and origins + way (R, 3)."""
        blocked = np.asarray(self._scene.run(*_rays(origins_m, way, reach=1 - 1e-3), query="OCCLUDED"))
        return np.asarray(blocked >= 0)

    def nearest(self, origins_m: ArrayLike, directions: ArrayLike) -> Indices:
        """Which face each ray (R, 3) meets first, -1 for none: `hits` for those who work out the rest."""
        triangle: Indices = self._scene.run(*_rays(origins_m, directions, reach=1e8), query="INTERSECT")
        behind = self._behind(triangle, directions)
        triangle[behind] = self._twin[triangle[behind]]
        return np.asarray(np.append(self._among, np.int32(-1))[triangle])

    def _behind(self, triangle: Indices, directions: ArrayLike) -> NDArray[np.int64]:
        """The rays (K,) that met the far one of a sheet's two sides."""
        if not self._has_sheets:
            return np.zeros(0, np.int64)
        rays = np.flatnonzero(np.append(self._twin, -1)[triangle] >= 0)
        facing = np.einsum("ij,ij->i", self._planes[triangle[rays]], np.asarray(directions)[rays])
        return np.asarray(rays[facing > 0])

    def hits(self, origins_m: ArrayLike, directions: ArrayLike) -> Hits:
        """The nearest face along each ray (R, 3)."""
        rays = _rays(origins_m, directions, reach=1e8)
        found: dict[str, Any] = self._scene.run(*rays, query="INTERSECT", output=1)
        hit = with_portable_places(found, self._triangles, rays[0], rays[1])
        triangle = hit["primID"].astype(np.int32)
        behind = self._behind(triangle, directions)
        # The corners in reverse: the second keeps its place, the first is the third.
        hit["v"][behind] = 1 - hit["u"][behind] - hit["v"][behind]
        triangle[behind] = self._twin[triangle[behind]]
        face = np.append(self._among, np.int32(-1))[triangle]
        return Hits(face, hit["u"], hit["v"], np.where(triangle < 0, np.float32(np.nan), hit["tfar"]))


def _rays(origins_m: ArrayLike, directions: ArrayLike, *, reach: float) -> tuple[Floats, Floats, Floats]:
    """Contiguous float32 arrays, as Embree wants them; `reach` in lengths of the direction."""
    origins = np.ascontiguousarray(origins_m, np.float32)
    return origins, np.ascontiguousarray(directions, np.float32), np.full(len(origins), reach, np.float32)


def lengths(vectors: Floats) -> Floats:
    """Lengths (...) of vectors (..., 3)."""
    return np.asarray(np.sqrt(np.einsum("...j,...j->...", vectors, vectors)))


def off(points_m: Floats, normals: Floats) -> Floats:
    """Points (P, 3) lifted off their faces, so that rays from there do not meet these."""
    lift = RAY_OFFSET_M + RAY_OFFSET * np.abs(points_m).max(1, keepdims=True)
    return np.asarray(points_m + lift * normals)


def face_materials(faces: Triangles, materials: Mapping[str, Material]) -> list[Material | None]:
    """What each thing of a table is made of, None for lamps and what has no material."""
    lamps = set(faces.thing[faces.lamp >= 0].tolist())
    return [None if i in lamps else materials.get(thing.material) for i, thing in enumerate(faces.things)]


class Visibility:
    """Opaque faces and panes of a table, of those `among` (K,) names. Cut-outs count as solid."""

    def __init__(self, faces: Triangles, materials: Mapping[str, Material], among: ArrayLike) -> None:
        own = np.asarray(among, np.int32)
        made_of = face_materials(faces, materials)
        kinds = np.array([m.kind if m else "" for m in made_of])
        is_pane = kinds[faces.thing[own]] == "pane"
        is_mirror = kinds[faces.thing[own]] == "mirror"
        smooth = np.array([m is not None and m.roughness == 0 for m in made_of])[faces.thing[own]]
        self.faces = faces
        self.normals = np.append(faces.plane, np.zeros((1, 3)), 0).astype(np.float32)
        self._eta = np.array([m.eta if m else 1.0 for m in made_of])[faces.thing]
        self._tint = np.array([m.tint if m else 1.0 for m in made_of], np.float32)[faces.thing]
        self.opaque = RayCaster(faces, own[~is_pane])
        self._glass = RayCaster(faces, own[is_pane])
        self._has_panes = bool(is_pane.any())
        # Mirrors that show lamps as sharp as they are. Coats mirror too, but faintly.
        found = flats(faces, own[is_mirror & smooth], at_least_m2=WIDE_M2)
        self.mirrors = [(flat, float(self._tint[flat.faces[0]]), RayCaster(faces, flat.faces)) for flat in found]
        # Panes that the sky is seen through are lamps of their own.
        self.sky_panes: list[Flat] = []
        for pane in flats(faces, own[is_pane], at_least_m2=WIDE_M2):
            if self._sees_sky(pane) and not any(pane.coincides(other) for other in self.sky_panes):
                self.sky_panes.append(pane)
        self._sky_panes = RayCaster(faces, [face for pane in self.sky_panes for face in pane.faces])

    def passing(self, origins_m: Floats, way: Floats) -> Floats:
        """Share (R,) of light that comes from origins + way (R, 3) to the origins (R, 3)."""
        share = (~self.opaque.stops(origins_m, way)).astype(np.float32)
        if self._has_panes:
            clear = np.flatnonzero(share)
            share[clear] = self.through_panes(origins_m[clear], way[clear])
        return share

    def clear(self, origins_m: Floats, way: Floats) -> Mask:
        """Whether nothing opaque is between origins and origins + way (R, 3)."""
        return ~self.opaque.stops(origins_m, way)

    def pane_passes(self, pane: Flat, directions: Floats) -> Floats:
        """Share (R,) that one pane lets through along unit directions (R, 3)."""
        face = pane.faces[0]
        return np.asarray(self._tint[face] * (1 - pane_reflectance(directions @ pane.normal, float(self._eta[face]))))

    def crosses_sky_pane(self, origins_m: Floats, way: Floats) -> Mask:
        """Whether one of the panes that show the sky is between origins and origins + way (R, 3)."""
        return self._sky_panes.stops(origins_m, way) if self.sky_panes else np.zeros(len(origins_m), bool)

    def first_panes(self, origins_m: Floats, way: Floats) -> tuple[NDArray[np.int64], Hits]:
        """Which rays from origins along way (R, 3) cross a pane (K,), and where they meet their first."""
        rays = np.flatnonzero(self._glass.stops(origins_m, way)) if self._has_panes else np.zeros(0, np.int64)
        return rays, self._glass.hits(origins_m[rays], way[rays])

    def pane_mirrors(self, panes: Indices, cosine: Floats) -> Floats:
        """Share (R,) that panes, given by their faces (R,), reflect at cosines (R,)."""
        return pane_reflectance(cosine, self._eta[panes]).astype(np.float32)

    def through_panes(self, origins_m: Floats, way: Floats) -> Floats:
        """Share (R,) that all panes between origins and origins + way (R, 3) let through."""
        share = np.ones(len(origins_m), np.float32)
        if not self._has_panes:
            return share
        rays = np.flatnonzero(self._glass.stops(origins_m, way))
        gone = np.zeros(len(rays), np.float32)
        for _ in range(MOST_PANES):
            if not len(rays):
                break
            ahead = way[rays] * (1 - gone)[:, None]
            hits = self._glass.hits(origins_m[rays] + way[rays] * gone[:, None], ahead)
            met = np.flatnonzero((hits.face >= 0) & (hits.distance < 1))
            rays = rays[met]
            pane = hits.face[met]
            ahead = ahead[met]
            length = lengths(ahead)
            cosine = np.einsum("ij,ij->i", ahead, self.normals[pane]) / length
            share[rays] *= self._tint[pane] * (1 - pane_reflectance(cosine, self._eta[pane])).astype(np.float32)
            gone = (gone[met] + (1 - gone[met]) * (hits.distance[met] + RAY_OFFSET_M / length)).astype(np.float32)
        return share

    def _sees_sky(self, pane: Flat) -> bool:
        """Whether any of 1024 fixed rays, half to each side, leaves the scene without another pane."""
        a, b, tilt, turn = np.random.default_rng(0).random((4, 512))
        across = unit(pane.corners_m[0, 1] - pane.corners_m[0, 0])
        radius = np.sqrt(tilt)[:, None]
        angle = 2 * np.pi * turn[:, None]
        flat = radius * (np.cos(angle) * across + np.sin(angle) * np.cross(pane.normal, across))
        up = np.sqrt(1 - radius**2) * pane.normal
        directions = np.concatenate([flat + up, flat - up])
        origins = np.tile(spots(pane.corners_m, a, b), (2, 1)) + RAY_OFFSET_M * directions
        blocked = self.opaque.stops(origins, FAR_M * directions) | self._glass.stops(origins, FAR_M * directions)
        return not blocked.all()


def spots(corners_m: Array, a: Floats, b: Floats) -> Array:
    """Points (P, 3) spread evenly over triangles (K, 3, 3) by two numbers (P,) in [0, 1) each."""
    ends = np.cumsum(areas_m2(corners_m))
    at = a * ends[-1]
    which = np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)
    starts = np.concatenate([[0.0], ends])
    share = np.sqrt(np.clip((at - starts[which]) / np.maximum(ends[which] - starts[which], 1e-30), 0, 1))
    first, second, third = corners_m[which].swapaxes(0, 1)
    return np.asarray(first + share[:, None] * (second - first + b[:, None] * (third - second)))
