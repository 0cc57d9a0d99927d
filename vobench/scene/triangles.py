"""Things, which are meshes with a material, and the table of all triangles of a scene."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import face_normals
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import joined_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh

Index = NDArray[np.int32]


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

    def with_movers_at(self, T_world_movers: Sequence[Array]) -> "Triangles":
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


def triangle_table(
    things: Sequence[Thing],
    mover: Sequence[int],
    lamp: Sequence[int],
) -> Triangles:
    """The table of the faces of things. The faces of each thing are in the frame of its mesh.

    `mover` and `lamp` are the index of each thing's mover and lamp; -1 if it has none.
    """
    parts = [as_arrays(thing.mesh) for thing in things]
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
