"""Meshes as plain arrays. Most shapes are built from arrays, because creating a Trimesh takes much longer."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit

Faces = NDArray[np.int64]


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
        inverse, is_mirroring = _inverse_map(M.tobytes())
        vertices_m = self.vertices_m @ M.T + T[:3, 3]
        faces = self.faces[:, ::-1] if is_mirroring else self.faces
        normals = unit(self.normals @ inverse)
        return MeshArrays(vertices_m, faces, self.uv, normals)

    def flipped(self) -> "MeshArrays":
        """The mesh with faces that are visible from the opposite side."""
        return replace(self, faces=self.faces[:, ::-1], normals=-self.normals)

    def two_sided(self) -> "MeshArrays":
        """The mesh with faces that are visible from both sides."""
        return joined_arrays([self, self.flipped()])


class _InverseMap(NamedTuple):
    """The inverse (3, 3) of a linear map, and whether the map mirrors."""

    inverse: Array
    is_mirroring: bool


@lru_cache(maxsize=1024)
def _inverse_map(matrix: bytes) -> _InverseMap:
    """The inverse of a matrix (3, 3), given as bytes.

    The result is cached because all parts of a thing are moved by the same matrix.
    """
    M = np.frombuffer(matrix).reshape(3, 3)
    determinant = M[0] @ cross(M[1], M[2])
    inverse = np.asarray(np.linalg.inv(M), float)
    return _InverseMap(inverse, is_mirroring=bool(determinant < 0))


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
