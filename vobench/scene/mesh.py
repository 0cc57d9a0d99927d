"""Meshes, the things made of them, and all triangles of a scene in one table.

A mesh is a `trimesh.Trimesh` made with process=False, so that its vertices keep their order. Its faces are seen from
the side from which their corners run counter-clockwise. `mesh.visual.uv` (V, 2) are places on the texture, in the unit
of `Texture.tile_m`, row 0 of the picture at v = 0 (trimesh's own readers have it at v = 1). `mesh.vertex_normals`
(V, 3) are the normals of the shape that the triangles stand for. trimesh keeps given normals in its cache, so that
`mesh.copy()` drops them; `mesh.copy(include_cache=True)` and the functions of this module keep them. No function here
changes a mesh that it is given: things can share meshes.
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
# Vertices nearer than this are one, here and in all rooms above: float32 resolves 1e-6 m at 10 m.
WELD_M = 1e-5


def face_normals(corners_m: Array) -> Array:
    """Unit normals (F, 3) of triangles (F, 3, 3), 0 where one has no area."""
    a = corners_m[:, 0]
    return unit(cross(corners_m[:, 1] - a, corners_m[:, 2] - a))


def areas_m2(corners_m: Array) -> Array:
    """Areas (F,) of triangles (F, 3, 3)."""
    a, b, c = corners_m.swapaxes(0, 1)
    return np.asarray(np.linalg.norm(cross(b - a, c - a), axis=1) / 2)


@dataclass(frozen=True, slots=True, eq=False)
class MeshArrays:
    """The arrays of a mesh that is still being made: a Trimesh takes far longer to make than most shapes.

    vertices_m (V, 3); faces (F, 3); uv (V, 2); normals (V, 3), unit vectors or 0.
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
        """The arrays of a frame b in the frame a; T_a_b may scale and mirror."""
        T = np.asarray(T_a_b, float)
        M = T[:3, :3]
        M_inverse, mirrors = _inverse(M.tobytes())
        vertices_m = self.vertices_m @ M.T + T[:3, 3]
        faces = self.faces[:, ::-1] if mirrors else self.faces
        normals = unit(self.normals @ M_inverse)
        return MeshArrays(vertices_m, faces, self.uv, normals)

    def flipped(self) -> "MeshArrays":
        """The same faces, seen from their other side."""
        return replace(self, faces=self.faces[:, ::-1], normals=-self.normals)

    def two_sided(self) -> "MeshArrays":
        """The faces and their backs."""
        return joined_arrays([self, self.flipped()])

    def mesh(self) -> "Trimesh":
        """The mesh of these arrays."""
        return make_mesh(self.vertices_m, self.faces, self.uv, self.normals)


@lru_cache(maxsize=1024)
def _inverse(matrix: bytes) -> tuple[Array, bool]:
    """The inverse (3, 3) of a matrix, and whether it mirrors; parts of one thing are moved by the same one."""
    M = np.frombuffer(matrix).reshape(3, 3)
    mirrors = M[0] @ cross(M[1], M[2]) < 0
    inverse: Array = np.asarray(np.linalg.inv(M), float)
    return inverse, bool(mirrors)


def joined_arrays(parts: Sequence[MeshArrays]) -> MeshArrays:
    """All faces of several meshes in one."""
    counts = [len(part.vertices_m) for part in parts]
    starts = np.cumsum([0, *counts])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return MeshArrays(
        np.concatenate([np.zeros((0, 3)), *(part.vertices_m for part in parts)]),
        np.concatenate([np.zeros((0, 3), np.int64), *faces]),
        np.concatenate([np.zeros((0, 2)), *(part.uv for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.normals for part in parts)]),
    )


@cache
def _no_material() -> "SimpleMaterial":
    """The one material of all meshes, for trimesh; a thing's material is that of its name."""
    from trimesh.visual.material import SimpleMaterial

    return SimpleMaterial()  # type: ignore[no-untyped-call]


def make_mesh(
    vertices_m: ArrayLike,
    faces: ArrayLike,
    uv: ArrayLike,
    normals: ArrayLike,
) -> "Trimesh":
    """A mesh of copies of vertices (V, 3), faces (F, 3), texture coordinates (V, 2) and normals (V, 3), in this order.

    It casts rays without embree, whose set-up takes longer than all else.
    """
    from trimesh import Trimesh
    from trimesh.visual import TextureVisuals

    vertices = np.array(vertices_m, float)
    is_empty = not len(vertices)  # trimesh refuses normals of no vertices
    visual = TextureVisuals(uv=np.array(uv, float), material=_no_material())  # type: ignore[no-untyped-call]
    return Trimesh(
        vertices,
        np.array(faces, np.int64),
        vertex_normals=None if is_empty else np.array(normals, float),
        visual=visual,
        process=False,
        use_embree=False,
    )


def has_texture_coordinates(mesh: "Trimesh") -> bool:
    """Whether a mesh has texture coordinates; those of `trimesh.creation` have none."""
    return getattr(mesh.visual, "uv", None) is not None


def texture_coordinates(mesh: "Trimesh") -> Array:
    """Texture coordinates (V, 2) of a mesh, 0 where it has none."""
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
    """The mesh of a frame b in the frame a; T_a_b (4, 4) may scale and mirror."""
    return arrays(mesh).moved(T_a_b).mesh()


def copies(mesh: "Trimesh", poses: Iterable[Array]) -> "Trimesh":
    """A mesh at each of several poses T (4, 4), as one."""
    original = arrays(mesh)
    return joined_arrays([original.moved(T) for T in poses]).mesh()


def flipped(mesh: "Trimesh") -> "Trimesh":
    """The same faces, seen from their other side."""
    return arrays(mesh).flipped().mesh()


def two_sided(mesh: "Trimesh") -> "Trimesh":
    """The faces of a mesh and their backs."""
    return arrays(mesh).two_sided().mesh()


def textured(mesh: "Trimesh", uv: ArrayLike) -> "Trimesh":
    """The mesh with other texture coordinates (V, 2)."""
    original = arrays(mesh)
    return make_mesh(original.vertices_m, original.faces, uv, original.normals)


def joined(meshes: Sequence["Trimesh"]) -> "Trimesh":
    """All faces of several meshes in one."""
    if len(meshes) == 1:
        return meshes[0]
    return joined_arrays([arrays(mesh) for mesh in meshes]).mesh()


def flat(vertices_m: ArrayLike, faces: ArrayLike, uv: ArrayLike) -> "Trimesh":
    """A mesh with sharp edges, its vertices (V, 3) repeated for every face (F, 3)."""
    index = np.asarray(faces, np.int64)
    corners_m = np.asarray(vertices_m, float)[index]
    corners_uv = np.asarray(uv, float)[index]
    normals = np.repeat(face_normals(corners_m), 3, axis=0)
    separate = np.arange(index.size).reshape(-1, 3)
    return make_mesh(corners_m.reshape(-1, 3), separate, corners_uv.reshape(-1, 2), normals)


QUAD_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
QUAD_FACES = np.array([[0, 1, 2], [0, 2, 3]])


def quad_arrays(
    corner_m: ArrayLike,
    edge_u_m: ArrayLike,
    edge_v_m: ArrayLike,
    uv_m: ArrayLike = (0.0, 0.0),
) -> MeshArrays:
    """The arrays of `quad`."""
    corner = np.asarray(corner_m, float)
    u = np.asarray(edge_u_m, float)
    v = np.asarray(edge_v_m, float)
    lengths = np.linalg.norm([u, v], axis=1)
    vertices = corner + QUAD_CORNERS @ np.stack([u, v])
    uv = np.asarray(uv_m, float) + QUAD_CORNERS * lengths
    return MeshArrays(vertices, QUAD_FACES, uv, np.tile(unit(cross(u, v)), (4, 1)))


def quad(
    corner_m: ArrayLike,
    edge_u_m: ArrayLike,
    edge_v_m: ArrayLike,
    *,
    uv_m: ArrayLike = (0.0, 0.0),
) -> "Trimesh":
    """A parallelogram of two faces, seen from the side of edge_u × edge_v; its texture begins at uv_m, in metres."""
    return quad_arrays(corner_m, edge_u_m, edge_v_m, uv_m).mesh()


def distinct(rows: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which rows (N, K) are the first of their kind (V,), kinds in their order, and the kind of each (N,)."""
    order = np.lexsort(rows.T[::-1])  # in a fraction of the time of np.unique
    is_first = np.append(True, (np.diff(rows[order], axis=0) != 0).any(1))[: len(rows)]
    kind = np.cumsum(is_first) - 1
    return order[is_first], kind[np.argsort(order)]


def welded(points_m: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which points (N, 3) are the first in their cell of WELD_M (P,), and which of these each is (N,)."""
    cells = np.rint(points_m / WELD_M).astype(np.int64)
    return distinct(cells)


def open_edges(faces: NDArray[Any]) -> NDArray[np.int64]:
    """The edges (E, 2) that one of the faces (F, 3) alone has."""
    from trimesh.geometry import faces_to_edges
    from trimesh.grouping import group_rows

    edges = np.sort(faces_to_edges(faces), axis=1)  # type: ignore[no-untyped-call]
    alone = group_rows(edges, require_count=1)  # type: ignore[no-untyped-call]
    return np.asarray(edges[alone], np.int64)


def is_closed_body(mesh: MeshArrays) -> bool:
    """Whether a mesh, its vertices welded, encloses a volume and is seen from outside."""
    from trimesh import Trimesh

    first, point = welded(mesh.vertices_m)
    faces = point[mesh.faces]
    has_three_corners = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    body = Trimesh(mesh.vertices_m[first], faces[has_three_corners], process=False, use_embree=False)
    return bool(body.is_volume)


def is_mesh(value: object) -> bool:
    """Whether a value is a mesh."""
    from trimesh import Trimesh

    return isinstance(value, Trimesh)


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """A mesh of one material; `name` is the instance it belongs to, as ground truth tells things apart.

    spacing_m: between samples of its light; None where the renderer's own will do.
    """

    name: str
    mesh: "Trimesh"
    material: str
    spacing_m: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """Every face of a scene in one order: stationary things, the lamps that are seen, movers.

    corners_m, normals (F, 3, 3) and uv (F, 3, 2) are those of each face's three corners, where its thing is at one
    instant; plane (F, 3) is the unit normal of the flat face. thing, mover, lamp (F,) int32: its place among the things
    of `things`, the scene's movers and the scene's lights; -1 for none.
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
        """The table of the selected faces (K,) alone."""
        names = ("corners_m", "normals", "uv", "plane", "thing", "mover", "lamp")
        return replace(self, **{name: getattr(self, name)[which] for name in names})

    def moved(self, T_world_movers: Sequence[Array]) -> "Triangles":
        """The table of things in their movers' frames with the movers at these poses (4, 4)."""
        corners = self.corners_m.copy()
        normals = self.normals.copy()
        plane = self.plane.copy()
        for index, T in enumerate(T_world_movers):
            moving = self.mover == index
            R = T[:3, :3]
            corners[moving] = se3.apply(T, corners[moving])
            normals[moving] = normals[moving] @ R.T
            plane[moving] = plane[moving] @ R.T
        return replace(self, corners_m=corners, normals=normals, plane=plane)


def table(
    things: Sequence[Thing],
    mover: Sequence[int],
    lamp: Sequence[int],
) -> Triangles:
    """The faces of things whose mover and lamp are given, -1 for none, each in its own frame."""
    parts = [arrays(thing.mesh) for thing in things]
    counts = [len(part.faces) for part in parts]
    whole = joined_arrays(parts)
    return Triangles(
        things=tuple(things),
        corners_m=whole.corners_m,
        normals=whole.normals[whole.faces],
        uv=whole.uv[whole.faces],
        plane=face_normals(whole.corners_m),
        thing=np.repeat(np.arange(len(things), dtype=np.int32), counts),
        mover=np.repeat(np.asarray(mover, np.int32), counts),
        lamp=np.repeat(np.asarray(lamp, np.int32), counts),
    )
