"""Batches of triangles that are drawn with one state, and the vertices and clusters of a scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Mask
from vobench.rendering.culling import Clusters
from vobench.rendering.planar_mirror import MirrorFaces, PlanarMirror, planar_mirrors, sharpness
from vobench.rendering.watertight import WatertightMesh, watertight
from vobench.scene.material import Material
from vobench.scene.triangles import Triangles
from vobench.scene.weld import WELD_M, distinct_rows

Indices = NDArray[np.int64]

VERTEX_FLOATS = 10  # position, normal, place on the texture, place on the map of light
CLUSTER = 128  # faces: so few that a strip of rows draws little beyond it
LAMP = Material()  # what lamps that name no material are made of


def depends_on_view(material: Material) -> bool:
    """Whether its look depends on where it is seen from."""
    return material.kind != "body" or material.eta > 1 or material.metal > 0


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Faces drawn with one state: all of one material, mover (-1 for none) and mirror, in the mover's frame.

    Lamps' faces shine with what the map of light holds.
    """

    index: int
    material: Material
    mover: int
    mirror: PlanarMirror | None
    is_lamp: bool
    area_m2: float

    @property
    def is_pane(self) -> bool:
        """Whether it is glass, seen from both sides."""
        return self.material.kind == "pane" and not self.is_lamp

    @property
    def has_gloss(self) -> bool:
        """Whether its look depends on where it is seen from."""
        return depends_on_view(self.material) and not self.is_lamp

    @property
    def has_holes(self) -> bool:
        """Whether the opacity of its texture leaves holes."""
        material = self.material
        is_textured_body = material.kind == "body" and material.texture is not None and not self.is_lamp
        return is_textured_body and bool(material.cutout)


@dataclass(frozen=True, slots=True)
class Geometry:
    """What is drawn: vertices (V, 10) float32 with position, normal, and places on texture and map of light.

    indices (3 T,) uint32 go by batch and cluster.
    """

    vertices: Floats
    indices: NDArray[np.uint32]
    batches: tuple[Batch, ...]
    mirrors: tuple[PlanarMirror, ...]
    clusters: Clusters


@dataclass(frozen=True, slots=True)
class _Parts:
    """The properties of triangles (T,) of the watertight mesh, taken from the faces that they are parts of."""

    thing: NDArray[Any]
    mover: NDArray[Any]
    is_lamp: Mask
    normals: Array
    area_m2: Array


def geometry(
    faces: Triangles,
    light_uv: Floats,
    materials: dict[str, Material],
) -> Geometry:
    """All faces of a table, movers in their own frame, in an order that never changes."""
    of_things = [materials.get(thing.material, LAMP) for thing in faces.things]
    mesh = _watertight_by_mover(faces)
    parts = _Parts(
        thing=faces.thing[mesh.parent],
        mover=faces.mover[mesh.parent],
        is_lamp=faces.lamp[mesh.parent] >= 0,
        normals=faces.plane[mesh.parent],
        area_m2=_areas_m2(mesh.corners_m),
    )
    mirror, mirrors = planar_mirrors(_mirror_faces(mesh, parts, of_things))
    batch, batches = _batches(parts, mirror, mirrors, of_things)
    order, cluster = _clustered(mesh.corners_m.mean(1), batch, parts.thing)

    tile_m = np.array([material.tile_m for material in of_things])[parts.thing]
    shows_gloss = [one.has_gloss and one.mirror is None for one in batches]
    needs_normals = np.array(shows_gloss)[batch]
    columns = [
        mesh.corners_m,
        mesh.interpolated(faces.normals) * needs_normals[:, None, None],
        mesh.interpolated(faces.uv) / tile_m[:, None, None],
        mesh.interpolated(light_uv.astype(float)),
    ]
    corners = np.concatenate([column[order] for column in columns], -1)  # (T, 3, 10)
    rows = corners.astype(np.float32).reshape(-1, VERTEX_FLOATS)
    vertices, indices = _indexed(rows + np.float32(0))
    clusters = _clusters(mesh.corners_m[order], parts.normals[order], batch[order], cluster, batches)
    return Geometry(vertices, indices, batches, tuple(mirrors), clusters)


def _watertight_by_mover(faces: Triangles) -> WatertightMesh:
    """The faces, made watertight separately for each rigid body."""
    corners_m = []
    parents = []
    weights = []
    for mover in np.unique(faces.mover):
        members = np.flatnonzero(faces.mover == mover)
        mesh = watertight(faces.corners_m[members])
        corners_m.append(mesh.corners_m)
        parents.append(members[mesh.parent])
        weights.append(mesh.weights)
    return WatertightMesh(np.concatenate(corners_m), np.concatenate(parents), np.concatenate(weights))


def _areas_m2(corners_m: Array) -> Array:
    first, second = np.moveaxis(np.diff(corners_m, axis=1), 1, 0)
    return np.asarray(np.linalg.norm(np.cross(first, second), axis=1) / 2)


def _mirror_faces(mesh: WatertightMesh, parts: _Parts, of_things: Sequence[Material]) -> MirrorFaces:
    strength = np.array([sharpness(material) for material in of_things])[parts.thing]
    glass = [material.kind == "pane" for material in of_things]
    of_glass = np.array(glass, bool)[parts.thing]
    return MirrorFaces(
        corners_m=mesh.corners_m,
        normals=parts.normals,
        area_m2=parts.area_m2,
        mover=parts.mover,
        strength=strength * ~parts.is_lamp,
        is_pane=of_glass & ~parts.is_lamp,
    )


def _batches(
    parts: _Parts,
    mirror: Indices,
    mirrors: Sequence[PlanarMirror],
    of_things: Sequence[Material],
) -> tuple[Indices, tuple[Batch, ...]]:
    """The batch that each triangle (T,) is drawn with, and the batches."""
    number = {id(material): nth for nth, material in enumerate(of_things)}
    material = np.array([number[id(material)] for material in of_things])[parts.thing]
    first, batch = distinct_rows(np.column_stack([parts.mover, parts.is_lamp, mirror, material]))
    area_m2 = np.bincount(batch, parts.area_m2)
    batches = []
    for index, triangle in enumerate(first.tolist()):
        batches.append(
            Batch(
                index=index,
                material=of_things[parts.thing[triangle]],
                mover=int(parts.mover[triangle]),
                mirror=mirrors[mirror[triangle]] if mirror[triangle] >= 0 else None,
                is_lamp=bool(parts.is_lamp[triangle]),
                area_m2=area_m2[index],
            )
        )
    return batch, tuple(batches)


def _clustered(
    centres_m: Array,
    batch: Indices,
    thing: NDArray[Any],
) -> tuple[Indices, Indices]:
    """An order of faces by batch, thing and place, and the cluster of each in that order; small things share one."""
    key = batch * (thing.max() + 1) + thing
    _, part, count = np.unique(key, return_inverse=True, return_counts=True)
    part[count[part] < CLUSTER // 4] = -1
    order = np.lexsort((morton(centres_m), part, batch))
    new_batch = np.diff(batch[order], prepend=-1) != 0
    new_part = np.diff(part[order], prepend=-2) != 0
    is_new = new_batch | new_part
    first = np.flatnonzero(is_new)[np.cumsum(is_new) - 1]
    rank = np.arange(len(order)) - first  # of a face in its part
    return order, np.cumsum(rank % CLUSTER == 0) - 1


def morton(points_m: Array) -> NDArray[np.uint64]:
    """Numbers (N,) that are close for points (N, 3) that are. Source: Morton (1966)."""
    low_m = points_m.min(0)
    high_m = points_m.max(0)
    largest_m = max(float((high_m - low_m).max()), WELD_M)
    cells = ((points_m - low_m) / largest_m * 1023).astype(np.uint64)
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        cells = (cells | cells << np.uint64(shift)) & np.uint64(mask)
    return np.asarray(cells @ np.array([1, 2, 4], np.uint64))


def _indexed(rows: Floats) -> tuple[Floats, NDArray[np.uint32]]:
    """The distinct rows (V, 10), first come first, and which of them each (N,) is."""
    whole_row = np.dtype((np.void, rows.itemsize * VERTEX_FLOATS))
    _, first, which = np.unique(rows.view(whole_row).ravel(), return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rows[first[order]], rank[which].astype(np.uint32)


def _clusters(
    corners_m: Array,
    normals: Array,
    batch: Indices,
    cluster: Indices,
    batches: Sequence[Batch],
) -> Clusters:
    """The clusters of ordered faces."""
    begins = np.searchsorted(cluster, np.arange(cluster[-1] + 1))
    batch_of = batch[begins]
    axis = unit(np.add.reduceat(normals, begins))
    along_axis = np.einsum("ij,ij->i", normals, axis[cluster])
    cosine = np.minimum.reduceat(along_axis, begins)
    is_pane = np.array([batch.is_pane for batch in batches])[batch_of]
    seen_from_anywhere = (cosine <= 0) | is_pane
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    return Clusters(
        low_m=np.minimum.reduceat(corners_m.min(1), begins),
        high_m=np.maximum.reduceat(corners_m.max(1), begins),
        first=3 * begins,
        count=3 * np.diff(begins, append=len(cluster)),
        batch=batch_of,
        mover=np.array([batch.mover for batch in batches])[batch_of],
        axis=axis,
        sine=np.where(seen_from_anywhere, 1.0, sine),
    )
