"""Creates, transforms and joins meshes.

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
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import face_normals
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh
    from trimesh.visual.material import SimpleMaterial


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

    The arrays are copied, and their order is preserved.
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
        use_embree=False,  # its set-up takes longer than all other steps of creating a mesh together
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


def as_arrays(mesh: "Trimesh") -> MeshArrays:
    """The arrays of a mesh."""
    return MeshArrays(
        np.asarray(mesh.vertices),
        np.asarray(mesh.faces),
        texture_coordinates(mesh),
        np.asarray(mesh.vertex_normals),
    )


def as_mesh(arrays: MeshArrays) -> "Trimesh":
    """The mesh with these arrays."""
    return make_mesh(arrays.vertices_m, arrays.faces, arrays.uv, arrays.normals)


def face_corners(mesh: "Trimesh") -> Array:
    """The corners (F, 3, 3) of every face of a mesh, in metres."""
    corners_m: Array = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    return corners_m


def moved(mesh: "Trimesh", T_a_b: Array) -> "Trimesh":
    """The mesh transformed from frame b to frame a; T_a_b (4, 4) may scale and mirror."""
    return as_mesh(as_arrays(mesh).moved(T_a_b))


def copies(mesh: "Trimesh", poses: Iterable[Array]) -> "Trimesh":
    """One mesh that consists of a copy of the given mesh at each of the poses (4, 4)."""
    original = as_arrays(mesh)
    return as_mesh(joined_arrays([original.moved(T) for T in poses]))


def flipped(mesh: "Trimesh") -> "Trimesh":
    """The mesh with faces that are visible from the opposite side."""
    return as_mesh(as_arrays(mesh).flipped())


def two_sided(mesh: "Trimesh") -> "Trimesh":
    """The mesh with faces that are visible from both sides."""
    return as_mesh(as_arrays(mesh).two_sided())


def textured(mesh: "Trimesh", uv: ArrayLike) -> "Trimesh":
    """The mesh with the given texture coordinates (V, 2) instead of its own."""
    original = as_arrays(mesh)
    return make_mesh(original.vertices_m, original.faces, uv, original.normals)


def joined(meshes: Sequence["Trimesh"]) -> "Trimesh":
    """One mesh with the faces of all meshes, in their order. A single mesh is returned as it is."""
    if len(meshes) == 1:
        return meshes[0]
    return as_mesh(joined_arrays([as_arrays(mesh) for mesh in meshes]))


def flat_shaded(vertices_m: ArrayLike, faces: ArrayLike, uv: ArrayLike) -> "Trimesh":
    """A mesh with flat shading. No two of its faces share a vertex, so its edges are sharp.

    The arguments describe the mesh with shared vertices.

    `vertices_m` (V, 3) are the positions of the vertices.
    `faces` (F, 3) are the indices of the vertices of each face.
    `uv` (V, 2) are the texture coordinates of the vertices.
    """
    shared_faces = np.asarray(faces, np.int64)
    corners_m = np.asarray(vertices_m, float)[shared_faces]  # (F, 3, 3)
    corners_uv = np.asarray(uv, float)[shared_faces]  # (F, 3, 2)
    normals = np.repeat(face_normals(corners_m), 3, axis=0)  # (3 F, 3)
    separate_faces = np.arange(shared_faces.size).reshape(-1, 3)
    return make_mesh(corners_m.reshape(-1, 3), separate_faces, corners_uv.reshape(-1, 2), normals)


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
    return as_mesh(quad_arrays(corner_m, edge_u_m, edge_v_m, uv_m))


def is_mesh(value: object) -> bool:
    """Whether a value is a mesh."""
    from trimesh import Trimesh

    return isinstance(value, Trimesh)
