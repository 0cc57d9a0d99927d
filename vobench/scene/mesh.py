"""Meshes, things (a mesh with a material), and a table of all triangles of a scene.

A mesh is a `trimesh.Trimesh` that was created with process=False, which preserves the order of its vertices.

- A face is visible from the side on which its corners are in counter-clockwise order.
- `mesh.visual.uv` (V, 2) are texture coordinates, in the unit of `Texture.tile_m`. Row 0 of the picture is at v = 0,
  whereas it is at v = 1 in meshes that trimesh reads from files.
- `mesh.vertex_normals` (V, 3) are the normals of the smooth shape that the triangles approximate. trimesh keeps given
  normals in a cache, so `mesh.copy()` drops them. `mesh.copy(include_cache=True)` and the functions of this module
  preserve them.

No function here modifies its arguments, so several things can share a mesh.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit

if TYPE_CHECKING:
    from trimesh import Trimesh
    from trimesh.visual.material import SimpleMaterial

Faces = NDArray[np.int64]
Index = NDArray[np.int32]
# The size of the grid cells in which vertices are merged. At 10 m, float32 numbers are about 1e-6 m apart.
WELD_M = 1e-5


def face_normals(corners_m: Array) -> Array:
    """The unit normals (F, 3) of triangles with corners (F, 3, 3); 0 for a triangle without area."""
    a = corners_m[:, 0]
    return unit(cross(corners_m[:, 1] - a, corners_m[:, 2] - a))


def areas_m2(corners_m: Array) -> Array:
    """The areas (F,) of triangles with corners (F, 3, 3)."""
    a, b, c = corners_m.swapaxes(0, 1)
    return np.asarray(np.linalg.norm(cross(b - a, c - a), axis=1) / 2)


@dataclass(frozen=True, slots=True, eq=False)
class MeshArrays:
    """The arrays of a mesh. Most shapes are built from arrays, because creating a Trimesh takes much longer.

    `vertices_m` (V, 3) are positions.
    `faces` (F, 3) are the vertex indices of each face.
    `uv` (V, 2) are texture coordinates.
    `normals` (V, 3) are unit vectors, or 0.
    """

    vertices_m: Array
    faces: Faces
    uv: Array
    normals: Array

    @property
    def corners_m(self) -> Array:
        """The corners (F, 3, 3) of every face."""
        return self.vertices_m[self.faces]

    def moved(self, T_a_b: Array) -> "MeshArrays":
        """The mesh transformed from frame b to frame a; T_a_b (4, 4) may scale and mirror."""
        T = np.asarray(T_a_b, float)
        M = T[:3, :3]
        M_inverse, mirrors = _inverse(M.tobytes())
        vertices_m = self.vertices_m @ M.T + T[:3, 3]
        faces = self.faces[:, ::-1] if mirrors else self.faces
        normals = unit(self.normals @ M_inverse)
        return MeshArrays(vertices_m, faces, self.uv, normals)

    def flipped(self) -> "MeshArrays":
        """The mesh with faces that are visible from the opposite side."""
        return replace(self, faces=self.faces[:, ::-1], normals=-self.normals)

    def two_sided(self) -> "MeshArrays":
        """The mesh with faces that are visible from both sides."""
        return joined_arrays([self, self.flipped()])

    def mesh(self) -> "Trimesh":
        """The arrays as a Trimesh."""
        return make_mesh(self.vertices_m, self.faces, self.uv, self.normals)


@lru_cache(maxsize=1024)
def _inverse(matrix: bytes) -> tuple[Array, bool]:
    """The inverse of a matrix (3, 3), given as bytes, and whether the matrix mirrors.

    The result is cached because all parts of a thing are moved by the same matrix.
    """
    M = np.frombuffer(matrix).reshape(3, 3)
    determinant = M[0] @ cross(M[1], M[2])
    inverse: Array = np.asarray(np.linalg.inv(M), float)
    return inverse, bool(determinant < 0)


def joined_arrays(parts: Sequence[MeshArrays]) -> MeshArrays:
    """One mesh with the faces of all parts, in their order."""
    vertex_counts = [len(part.vertices_m) for part in parts]
    vertex_offsets = np.cumsum([0, *vertex_counts])
    faces = [part.faces + offset for part, offset in zip(parts, vertex_offsets, strict=False)]
    return MeshArrays(
        np.concatenate([np.zeros((0, 3)), *(part.vertices_m for part in parts)]),
        np.concatenate([np.zeros((0, 3), np.int64), *faces]),
        np.concatenate([np.zeros((0, 2)), *(part.uv for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.normals for part in parts)]),
    )


@cache
def _no_material() -> "SimpleMaterial":
    """The material that trimesh requires of every mesh. The renderers use the material of `Thing` instead."""
    from trimesh.visual.material import SimpleMaterial

    return SimpleMaterial()  # type: ignore[no-untyped-call]


def make_mesh(
    vertices_m: ArrayLike,
    faces: ArrayLike,
    uv: ArrayLike,
    normals: ArrayLike,
) -> "Trimesh":
    """A mesh with vertices (V, 3), faces (F, 3), texture coordinates (V, 2) and normals (V, 3).

    The arrays are copied, and their order is preserved. The mesh does not use embree, because its set-up takes longer
    than all other steps together.
    """
    from trimesh import Trimesh
    from trimesh.visual import TextureVisuals

    vertices = np.array(vertices_m, float)
    is_empty = not len(vertices)
    vertex_normals = None if is_empty else np.array(normals, float)  # trimesh rejects an empty array
    visual = TextureVisuals(uv=np.array(uv, float), material=_no_material())  # type: ignore[no-untyped-call]
    return Trimesh(
        vertices,
        np.array(faces, np.int64),
        vertex_normals=vertex_normals,
        visual=visual,
        process=False,
        use_embree=False,
    )


def has_texture_coordinates(mesh: "Trimesh") -> bool:
    """Whether a mesh has texture coordinates; a mesh from `trimesh.creation` has none."""
    return getattr(mesh.visual, "uv", None) is not None


def texture_coordinates(mesh: "Trimesh") -> Array:
    """The texture coordinates (V, 2) of a mesh; 0 if it has none."""
    uv = getattr(mesh.visual, "uv", None)
    if uv is None:
        return np.zeros((len(mesh.vertices), 2))
    return np.asarray(uv).reshape(-1, 2)


def arrays(mesh: "Trimesh") -> MeshArrays:
    """The arrays of a mesh."""
    return MeshArrays(
        np.asarray(mesh.vertices),
        np.asarray(mesh.faces),
        texture_coordinates(mesh),
        np.asarray(mesh.vertex_normals),
    )


def corners(mesh: "Trimesh") -> Array:
    """The corners (F, 3, 3) of every face of a mesh, in metres."""
    corners_m: Array = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    return corners_m


def moved(mesh: "Trimesh", T_a_b: Array) -> "Trimesh":
    """The mesh transformed from frame b to frame a; T_a_b (4, 4) may scale and mirror."""
    return arrays(mesh).moved(T_a_b).mesh()


def copies(mesh: "Trimesh", poses: Iterable[Array]) -> "Trimesh":
    """One mesh that consists of a copy of the given mesh at each of the poses (4, 4)."""
    original = arrays(mesh)
    return joined_arrays([original.moved(T) for T in poses]).mesh()


def flipped(mesh: "Trimesh") -> "Trimesh":
    """The mesh with faces that are visible from the opposite side."""
    return arrays(mesh).flipped().mesh()


def two_sided(mesh: "Trimesh") -> "Trimesh":
    """The mesh with faces that are visible from both sides."""
    return arrays(mesh).two_sided().mesh()


def textured(mesh: "Trimesh", uv: ArrayLike) -> "Trimesh":
    """The mesh with the given texture coordinates (V, 2) instead of its own."""
    original = arrays(mesh)
    return make_mesh(original.vertices_m, original.faces, uv, original.normals)


def joined(meshes: Sequence["Trimesh"]) -> "Trimesh":
    """One mesh with the faces of all meshes, in their order."""
    if len(meshes) == 1:
        return meshes[0]
    return joined_arrays([arrays(mesh) for mesh in meshes]).mesh()


def flat(vertices_m: ArrayLike, faces: ArrayLike, uv: ArrayLike) -> "Trimesh":
    """A mesh with sharp edges: each face has three vertices that no other face shares.

    `vertices_m` (V, 3), `faces` (F, 3) and `uv` (V, 2) describe the mesh with shared vertices.
    """
    shared_faces = np.asarray(faces, np.int64)
    corners_m = np.asarray(vertices_m, float)[shared_faces]  # (F, 3, 3)
    corners_uv = np.asarray(uv, float)[shared_faces]  # (F, 3, 2)
    normals = np.repeat(face_normals(corners_m), 3, axis=0)  # (3 F, 3)
    separate_faces = np.arange(shared_faces.size).reshape(-1, 3)
    return make_mesh(corners_m.reshape(-1, 3), separate_faces, corners_uv.reshape(-1, 2), normals)


QUAD_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
QUAD_FACES = np.array([[0, 1, 2], [0, 2, 3]])


def quad_arrays(
    corner_m: ArrayLike,
    edge_u_m: ArrayLike,
    edge_v_m: ArrayLike,
    uv_m: ArrayLike = (0.0, 0.0),
) -> MeshArrays:
    """The arrays of a parallelogram; see `quad`."""
    corner = np.asarray(corner_m, float)
    u_m = np.asarray(edge_u_m, float)
    v_m = np.asarray(edge_v_m, float)
    lengths_m = np.linalg.norm([u_m, v_m], axis=1)
    vertices_m = corner + QUAD_CORNERS @ np.stack([u_m, v_m])
    uv = np.asarray(uv_m, float) + QUAD_CORNERS * lengths_m
    normals = np.tile(unit(cross(u_m, v_m)), (4, 1))
    return MeshArrays(vertices_m, QUAD_FACES, uv, normals)


def quad(
    corner_m: ArrayLike,
    edge_u_m: ArrayLike,
    edge_v_m: ArrayLike,
    *,
    uv_m: ArrayLike = (0.0, 0.0),
) -> "Trimesh":
    """A parallelogram of two faces that is visible from the side to which edge_u × edge_v points.

    `corner_m` is the corner where both edges begin. `uv_m` are its texture coordinates, in metres.
    """
    return quad_arrays(corner_m, edge_u_m, edge_v_m, uv_m).mesh()


def distinct(rows: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct rows of an array (N, K), in lexicographic order.

    Returns the index (G,) of the first occurrence of each distinct row, and for each row the index (N,) of the distinct
    row that it equals, like `np.unique` with `return_index` and `return_inverse`.
    """
    order = np.lexsort(rows.T[::-1])  # stable, and much faster than np.unique
    sorted_rows = rows[order]
    differs_from_previous = (np.diff(sorted_rows, axis=0) != 0).any(1)
    is_first = np.append(True, differs_from_previous)[: len(rows)]  # the slice removes the first element if N = 0
    sorted_inverse = np.cumsum(is_first) - 1
    return order[is_first], sorted_inverse[np.argsort(order)]


def welded(points_m: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Merge points (N, 3) that are in the same grid cell of size WELD_M.

    Returns the index (P,) of the first point in each occupied cell, and for each point the index (N,) of its cell.
    """
    cells = np.rint(points_m / WELD_M).astype(np.int64)
    return distinct(cells)


def open_edges(faces: NDArray[Any]) -> NDArray[np.int64]:
    """The edges (E, 2) that belong to only one of the faces (F, 3)."""
    from trimesh.geometry import faces_to_edges
    from trimesh.grouping import group_rows

    edges = np.sort(faces_to_edges(faces), axis=1)  # type: ignore[no-untyped-call]
    open_rows = group_rows(edges, require_count=1)  # type: ignore[no-untyped-call]
    return np.asarray(edges[open_rows], np.int64)


def is_closed_body(mesh: MeshArrays) -> bool:
    """Whether a mesh, with its vertices welded, encloses a volume and has its front faces outside."""
    from trimesh import Trimesh

    first_vertices, cells = welded(mesh.vertices_m)
    faces = cells[mesh.faces]
    has_distinct_corners = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    body = Trimesh(mesh.vertices_m[first_vertices], faces[has_distinct_corners], process=False, use_embree=False)
    return bool(body.is_volume)


def is_mesh(value: object) -> bool:
    """Whether a value is a mesh."""
    from trimesh import Trimesh

    return isinstance(value, Trimesh)


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """A mesh with one material.

    `name` is the name of the instance; things with the same name are one instance in the ground truth.
    `material` is the name of the material.
    `spacing_m` is the distance between samples of the light on the mesh; None selects the renderer's default.
    """

    name: str
    mesh: "Trimesh"
    material: str
    spacing_m: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """A table of all faces of a scene at one instant: first stationary things, then visible lamps, then movers.

    `corners_m` (F, 3, 3), `normals` (F, 3, 3) and `uv` (F, 3, 2) are the positions, smooth normals and texture
    coordinates of the three corners of each face.
    `plane` (F, 3) is the unit normal of the flat face.
    `thing` (F,) is the index of the face's thing in `things`.
    `mover` (F,) is the index of the face's mover in the scene, -1 for a stationary face.
    `lamp` (F,) is the index of the face's light in the scene, -1 for a face that is not a lamp.
    """

    things: tuple[Thing, ...]
    corners_m: Array
    normals: Array
    uv: Array
    plane: Array
    thing: Index
    mover: Index
    lamp: Index

    def __len__(self) -> int:
        return len(self.corners_m)

    def some(self, which: NDArray[Any]) -> "Triangles":
        """The table of the faces that are selected by an index or a mask `which`."""
        names = ("corners_m", "normals", "uv", "plane", "thing", "mover", "lamp")
        return replace(self, **{name: getattr(self, name)[which] for name in names})

    def moved(self, T_world_movers: Sequence[Array]) -> "Triangles":
        """The table with each mover at its pose (4, 4). In this table, faces of movers must be in the mover's frame."""
        corners_m = self.corners_m.copy()
        normals = self.normals.copy()
        plane = self.plane.copy()
        for index, T_world_mover in enumerate(T_world_movers):
            is_moved = self.mover == index
            R_world_mover = T_world_mover[:3, :3]
            corners_m[is_moved] = se3.apply(T_world_mover, corners_m[is_moved])
            normals[is_moved] = normals[is_moved] @ R_world_mover.T
            plane[is_moved] = plane[is_moved] @ R_world_mover.T
        return replace(self, corners_m=corners_m, normals=normals, plane=plane)


def table(
    things: Sequence[Thing],
    mover: Sequence[int],
    lamp: Sequence[int],
) -> Triangles:
    """The table of the faces of things. The faces of each thing are in the frame of its mesh.

    `mover` and `lamp` are the index of each thing's mover and lamp; -1 if it has none.
    """
    parts = [arrays(thing.mesh) for thing in things]
    face_counts = [len(part.faces) for part in parts]
    whole = joined_arrays(parts)
    return Triangles(
        things=tuple(things),
        corners_m=whole.corners_m,
        normals=whole.normals[whole.faces],
        uv=whole.uv[whole.faces],
        plane=face_normals(whole.corners_m),
        thing=np.repeat(np.arange(len(things), dtype=np.int32), face_counts),
        mover=np.repeat(np.asarray(mover, np.int32), face_counts),
        lamp=np.repeat(np.asarray(lamp, np.int32), face_counts),
    )
