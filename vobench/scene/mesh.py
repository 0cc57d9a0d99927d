"""Meshes: triangles with texture coordinates and normals, the things made of them, and all of a scene in one table."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array

Faces = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles that are seen from the side from which their corners run counter-clockwise.

    vertices_m (V, 3); faces (F, 3) int32; uv (V, 2) places on the texture, in the unit of `Texture.tile_m`, row 0 of
    the picture at v = 0; normals (V, 3) unit, of the shape that the triangles stand for.
    """

    vertices_m: Array
    faces: Faces
    uv: Array
    normals: Array

    @property
    def corners_m(self) -> Array:
        """The corners (F, 3, 3) of every face."""
        return self.vertices_m[self.faces]

    def moved(self, T_a_b: Array) -> "Mesh":
        """The mesh of a frame b in the frame a; T_a_b may scale and mirror."""
        M = np.asarray(T_a_b, float)[:3, :3]
        mirrors = M[0] @ cross(M[1], M[2]) < 0
        normals = unit(self.normals @ np.linalg.inv(M))
        return Mesh(
            self.vertices_m @ M.T + T_a_b[:3, 3], self.faces[:, ::-1] if mirrors else self.faces, self.uv, normals
        )

    def flipped(self) -> "Mesh":
        """The same faces, seen from their other side."""
        return replace(self, faces=self.faces[:, ::-1], normals=-self.normals)

    def two_sided(self) -> "Mesh":
        """The faces and their backs."""
        return joined([self, self.flipped()])


def unit(vectors: ArrayLike) -> Array:
    """Vectors (..., 3) at length 1; 0 stays 0."""
    v = np.asarray(vectors, float)
    length = np.sqrt((v * v).sum(-1, keepdims=True))
    return np.asarray(v / np.where(length > 0, length, 1))


NEXT = np.array([1, 2, 0])
LAST = np.array([2, 0, 1])


def cross(a: Array, b: Array) -> Array:
    """Products (..., 3), to the last bit those of np.cross, whose checks take longer than small meshes do."""
    return np.asarray(a[..., NEXT] * b[..., LAST] - a[..., LAST] * b[..., NEXT])


def distinct(rows: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which rows (N, K) are the first of their kind (V,), kinds in their order, and the kind of each (N,)."""
    order = np.lexsort(rows.T[::-1])  # in a fraction of the time of np.unique
    new = np.append(True, (np.diff(rows[order], axis=0) != 0).any(1))[: len(rows)]
    return order[new], (np.cumsum(new) - 1)[np.argsort(order)]


def face_normals(corners_m: Array) -> Array:
    """Unit normals (F, 3) of triangles (F, 3, 3), 0 where one has no area."""
    return unit(cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0]))


def areas_m2(corners_m: Array) -> Array:
    """Areas (F,) of triangles (F, 3, 3)."""
    a, b, c = corners_m.swapaxes(0, 1)
    return np.asarray(np.linalg.norm(cross(b - a, c - a), axis=1) / 2)


def flat(vertices_m: ArrayLike, faces: ArrayLike, uv: ArrayLike) -> Mesh:
    """A mesh with sharp edges, its vertices (V, 3) repeated for every face (F, 3)."""
    index = np.asarray(faces, np.int64)
    corners = np.asarray(vertices_m, float)[index]
    own = np.arange(index.size, dtype=np.int32).reshape(-1, 3)
    normals = np.repeat(face_normals(corners), 3, axis=0)
    return Mesh(corners.reshape(-1, 3), own, np.asarray(uv, float)[index].reshape(-1, 2), normals)


def quad(corner_m: ArrayLike, edge_u_m: ArrayLike, edge_v_m: ArrayLike, *, uv_m: ArrayLike = (0.0, 0.0)) -> Mesh:
    """A parallelogram of two faces, seen from the side of edge_u × edge_v; its texture begins at uv_m, in metres."""
    o, u, v = (np.asarray(part, float) for part in (corner_m, edge_u_m, edge_v_m))
    lengths = np.linalg.norm([u, v], axis=1)
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    normals = np.tile(unit(cross(u, v)), (4, 1))
    return Mesh(o + corners @ np.stack([u, v]), faces, np.asarray(uv_m, float) + corners * lengths, normals)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """All faces of some meshes in one."""
    starts = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes)])
    return Mesh(
        np.concatenate([np.zeros((0, 3)), *(mesh.vertices_m for mesh in meshes)]),
        np.concatenate(
            [np.zeros((0, 3), np.int32), *(m.faces + np.int32(s) for m, s in zip(meshes, starts, strict=False))]
        ),
        np.concatenate([np.zeros((0, 2)), *(mesh.uv for mesh in meshes)]),
        np.concatenate([np.zeros((0, 3)), *(mesh.normals for mesh in meshes)]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """A mesh of one material; `name` is the instance it belongs to, as ground truth tells things apart.

    spacing_m: between samples of its light; None where the renderer's own will do.
    """

    name: str
    mesh: Mesh
    material: str
    spacing_m: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """Every face of a scene in one order: things that stand still, the lamps that are seen, movers.

    corners_m, normals (F, 3, 3) and uv (F, 3, 2) are those of each face's three corners, where its thing is at one
    instant; plane (F, 3) is the unit normal of the flat face. thing, mover, lamp (F,) int32: its place among the things
    of `things`, the scene's movers and the scene's lights; -1 for none.
    """

    things: tuple[Thing, ...]
    corners_m: Array
    normals: Array
    uv: Array
    plane: Array
    thing: Faces
    mover: Faces
    lamp: Faces

    def __len__(self) -> int:
        return len(self.corners_m)

    def some(self, which: Faces) -> "Triangles":
        """The table of some faces (K,) alone."""
        names = ("corners_m", "normals", "uv", "plane", "thing", "mover", "lamp")
        return replace(self, **{name: getattr(self, name)[which] for name in names})

    def moved(self, T_world_movers: Sequence[Array]) -> "Triangles":
        """The table of things in their movers' frames with the movers at these poses (4, 4)."""
        corners = self.corners_m.copy()
        normals = self.normals.copy()
        plane = self.plane.copy()
        for index, T in enumerate(T_world_movers):
            own = self.mover == index
            corners[own] = se3.apply(T, corners[own])
            normals[own] = normals[own] @ T[:3, :3].T
            plane[own] = plane[own] @ T[:3, :3].T
        return replace(self, corners_m=corners, normals=normals, plane=plane)


def table(things: Sequence[Thing], mover: Sequence[int], lamp: Sequence[int]) -> Triangles:
    """The faces of some things, whose mover and lamp are given, -1 for none, each in its own frame."""
    meshes = [thing.mesh for thing in things]
    counts = [len(mesh.faces) for mesh in meshes]
    whole = joined(meshes)
    corners = whole.corners_m
    thing, movers, lamps = (
        np.repeat(np.asarray(x, np.int32), counts) for x in (range(len(things)), list(mover), list(lamp))
    )
    flat_normals = face_normals(corners)
    return Triangles(
        tuple(things), corners, whole.normals[whole.faces], whole.uv[whole.faces], flat_normals, thing, movers, lamps
    )
