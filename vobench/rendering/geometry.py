"""Ray casting in a scene, bounding spheres, directions and points that are distributed evenly."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.embree import Hits, TriangleCaster
from vobench.scene.material import Material
from vobench.scene.triangles import Triangles

T = TypeVar("T")

# The distance from their face at which rays start, and what is added to it per metre from the origin of the world. The
# resolution of float32 is 1e-7 of that distance.
RAY_OFFSET_M = 1e-4
RAY_OFFSET = 1e-6
FAR_M = 1e3  # beyond every scene
ENDLESS = 1e8  # in lengths of a direction, beyond every scene
SHORT_OF_END = 1 - 1e-3  # the share of a segment in which a face blocks it, so that the face at its end does not
X_AXIS = (1.0, 0.0, 0.0)
Z_AXIS = (0.0, 0.0, 1.0)


def take(table: T, rows: Rows | Mask | slice) -> T:
    """The same rows of all arrays of a dataclass or of a named tuple."""
    columns = _columns(table)
    if isinstance(rows, np.ndarray) and rows.dtype != bool:
        return type(table)(*(column.take(rows, axis=0) for column in columns))  # three times as fast as an index
    return type(table)(*(column[rows] for column in columns))


def _columns(table: object) -> list[Any]:
    """The arrays of a dataclass or of a named tuple."""
    if isinstance(table, tuple):
        return list(table)
    return [getattr(table, field.name) for field in fields(table)]  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class BoundingSphere:
    """Bounding spheres: centres (..., 3) and radii (...)."""

    centre_m: Array
    radius_m: Any

    take = take


def bounding_sphere(points_m: Array) -> BoundingSphere:
    """A sphere that contains all points (..., 3)."""
    points = points_m.reshape(-1, 3)
    centre = (points.min(0) + points.max(0)) / 2
    distances = np.linalg.norm(points - centre, axis=1)
    return BoundingSphere(centre, float(distances.max()))


def sphere_directions(count: int) -> Array:
    """Unit vectors (count, 3) that are distributed evenly. Source: González (2010), the Fibonacci lattice."""
    steps = np.arange(count) + 0.5
    height = 1 - 2 * steps / count
    angle = np.pi * (1 + np.sqrt(5)) * steps
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], -1)


def reversed_faces(corners_m: Array) -> Indices:
    """The back (F,) of each triangle (F, 3, 3): a triangle with the same corners in reverse order; -1 for none."""
    # A weighted sum of the nine coordinates is almost unique, so that only one candidate has to be compared.
    weights = np.sqrt(np.arange(2.0, 11.0)).reshape(3, 3)
    reverse = np.ascontiguousarray(corners_m[:, ::-1])
    keys = np.einsum("fij,ij->f", np.ascontiguousarray(corners_m), weights)
    wanted = np.einsum("fij,ij->f", reverse, weights)
    order = np.argsort(keys, kind="stable")
    last = max(len(order) - 1, 0)
    place = np.clip(np.searchsorted(keys[order], wanted), 0, last)
    candidate = order[place]
    is_same = (corners_m[candidate] == reverse).all((1, 2))
    return np.where(is_same, candidate, -1).astype(np.int32)


class RayCaster:
    """Casts rays at faces of a table. Hits name faces by their row in the table.

    A sheet consists of two faces back to back. A ray hits the side of a sheet that it comes from.
    `among` (K,) are the rows of the faces that rays can hit, by default all.
    `twin` (F + 1,) is the other side of the sheet of each face, -1 for none. The last entry is that of the face -1.
    `solid` are the faces that do not belong to a sheet.
    """

    def __init__(
        self,
        faces: Triangles,
        among: ArrayLike | None = None,
    ) -> None:
        chosen = np.arange(len(faces)) if among is None else among
        rows = np.asarray(chosen, np.int32)
        self._triangles = TriangleCaster(faces.corners_m, rows, robust=True)
        self._planes = faces.plane
        twin = reversed_faces(faces.corners_m[rows])
        has_twin = twin >= 0
        self._has_sheets = bool(has_twin.any())
        self.twin = np.full(len(faces) + 1, -1, np.int32)
        self.twin[rows[has_twin]] = rows[twin[has_twin]]
        self.solid = rows[~has_twin]

    def occluded(self, origins_m: ArrayLike, targets_m: ArrayLike) -> Mask:
        """Whether a face is between each origin (R, 3) and its target (R, 3)."""
        return self.stops(origins_m, np.asarray(targets_m) - np.asarray(origins_m))

    def stops(self, origins_m: ArrayLike, segments_m: ArrayLike) -> Mask:
        """Whether a face is between origins and origins + segments (R, 3)."""
        return self._triangles.stops(origins_m, segments_m, SHORT_OF_END)

    def nearest(self, origins_m: ArrayLike, directions: ArrayLike) -> Indices:
        """Only the `face` (R,) of `hits`, which is faster."""
        face = self._triangles.nearest(origins_m, directions, ENDLESS)
        behind = self._behind(face, directions)
        face[behind] = self.twin[face[behind]]
        return face

    def _behind(self, face: Indices, directions: ArrayLike) -> Rows:
        """The rays (K,) whose hit is on the far side of a sheet."""
        if not self._has_sheets:
            return np.zeros(0, np.int64)
        rays = np.flatnonzero(self.twin[face] >= 0)
        ray_directions = np.asarray(directions)[rays]
        facing = np.einsum("ij,ij->i", self._planes[face[rays]], ray_directions)
        return np.asarray(rays[facing > 0])

    def one_sided_hits(
        self,
        origins_m: ArrayLike,
        directions: ArrayLike,
        reach: ArrayLike = ENDLESS,
    ) -> Hits:
        """The first hit of each ray (R, 3) within `reach` lengths of its direction, on either side of a sheet."""
        return self._triangles.hits(origins_m, directions, reach)

    def hits(self, origins_m: ArrayLike, directions: ArrayLike) -> Hits:
        """The first hit of each ray (R, 3)."""
        return self.facing(self._triangles.hits(origins_m, directions, ENDLESS), directions)

    def facing(self, hits: Hits, directions: ArrayLike) -> Hits:
        """The same hits, moved in place to the side of each sheet that the ray (R, 3) comes from."""
        behind = self._behind(hits.face, directions)
        # On the other side, the first and the third corner are exchanged.
        hits.v[behind] = 1 - hits.u[behind] - hits.v[behind]
        hits.face[behind] = self.twin[hits.face[behind]]
        return hits


def lengths(vectors: Floats) -> Floats:
    """The lengths (...) of vectors (..., 3)."""
    return np.asarray(np.sqrt(np.einsum("...j,...j->...", vectors, vectors)))


def tangents(normals: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (P, 3) for each normal (P, 3), perpendicular to it and to each other."""
    is_upright = np.abs(normals[:, 2:]) >= 0.9
    helper = np.where(is_upright, X_AXIS, Z_AXIS).astype(normals.dtype)
    u = np.cross(helper, normals)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(normals, u)


def offset_from_surface(points_m: Floats, normals: Floats) -> Floats:
    """Move points (P, 3) off their faces along normals (P, 3), so that rays from there do not hit these faces."""
    largest_m = np.abs(points_m).max(1, keepdims=True)
    lift = RAY_OFFSET_M + RAY_OFFSET * largest_m
    return np.asarray(points_m + lift * normals)


def sample_points(corners_m: Array, a: Floats, b: Floats) -> Array:
    """Points (P, 3) that are distributed uniformly over triangles (K, 3, 3), by two random numbers (P,) in [0, 1)."""
    ends_m2 = np.cumsum(areas_m2(corners_m))
    starts_m2 = np.concatenate([[0.0], ends_m2])
    sample_m2 = a * ends_m2[-1]
    triangle = np.searchsorted(ends_m2, sample_m2, side="right")
    triangle = np.minimum(triangle, len(ends_m2) - 1)
    area_m2 = np.maximum(ends_m2[triangle] - starts_m2[triangle], 1e-30)
    within = (sample_m2 - starts_m2[triangle]) / area_m2
    share = np.sqrt(np.clip(within, 0, 1))
    first, second, third = corners_m[triangle].swapaxes(0, 1)
    on_far_edge = second - first + b[:, None] * (third - second)
    return np.asarray(first + share[:, None] * on_far_edge)


def face_materials(
    faces: Triangles,
    materials: Mapping[str, Material],
) -> list[Material | None]:
    """The material of each thing of a table, None for lamps and for things without a material."""
    is_lamp = np.zeros(len(faces.things), bool)
    is_lamp[faces.thing[faces.lamp >= 0]] = True
    thing_materials: list[Material | None] = []
    for thing, emits in zip(faces.things, is_lamp, strict=True):
        thing_materials.append(None if emits else materials.get(thing.material))
    return thing_materials


def are_panes(faces: Triangles, materials: Mapping[str, Material]) -> Mask:
    """Whether each face (F,) of a table is a pane."""
    by_thing = [material is not None and material.kind == "pane" for material in face_materials(faces, materials)]
    return np.array(by_thing, bool)[faces.thing]
