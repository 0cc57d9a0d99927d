"""Batches of rectangles to draw, and culling: which of them can touch a part of a picture."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyrender
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene
from vobench.render.geometry import corners, inventory
from vobench.render.opengl import ReflectanceTexture
from vobench.render.view import Box, PinholeView, Plane
from vobench.scene.material import Glass, Material, Mirror, Polished, texture_of
from vobench.scene.surface import Surface

# Corners nearer than this are one: float32 resolves 1e-6 m at 10 m.
WELD_M = 1e-5


@dataclass(frozen=True, slots=True)
class Batch:
    """Rectangles drawn in one call: all of one material and mover (-1 for none), in the mover's frame.

    Those that mirror lie in one plane; panels have no material, and mirrors and panes no texture.
    quads_m (K, 4, 3) are the corners.
    """

    index: int
    primitive: Any
    material: Material | None
    mover: int
    plane: Plane | None
    quads_m: Array
    texture: ReflectanceTexture | None


@dataclass(frozen=True, slots=True)
class BatchPart:
    """One rectangle on its way into a batch: its place in the inventory, its outline (K, 3) in its mover's frame."""

    index: int
    surface: Surface
    outline_m: Array
    mover: int
    material: Material | None

    @property
    def plane(self) -> Plane | None:
        """The plane it mirrors at, None where it does not."""
        if not isinstance(self.material, Polished | Mirror | Glass):
            return None
        normal = self.surface.normal
        return Plane(normal, -float(normal @ self.surface.corner_m))

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for parts of one batch."""
        name = None if self.material is None else self.surface.material
        return self.mover, name, self.plane.key if self.plane else None


def batches(baked: BakedScene, *, copies: int) -> list[Batch]:
    """All rectangles of a scene, each drawn `copies` times (once a sample), in an order that never changes."""
    groups: dict[tuple[object, ...], list[BatchPart]] = {}
    for part in _parts(baked):
        groups.setdefault(part.key, []).append(part)
    textures = {name: ReflectanceTexture(tile) for name, tile in baked.albedo.items()}
    blank = ReflectanceTexture(np.ones((2, 2), np.float32))
    made = []
    for index, parts in enumerate(groups.values()):
        material, mover, quads = parts[0].material, parts[0].mover, np.stack([corners(part.surface) for part in parts])
        texture = blank if material is None else textures.get(parts[0].surface.material)
        primitive = _primitive(baked, parts, copies)
        made.append(Batch(index, primitive, material, mover, parts[0].plane, quads, texture))
    return made


def sealed(outlines_m: Sequence[Array]) -> list[Array]:
    """Outlines (K, 3) of polygons with corners that meet welded, and with those of others that lie on their edges."""
    ends = np.cumsum([len(outline) for outline in outlines_m])
    points = _welded(np.concatenate(outlines_m))
    unique = np.unique(points, axis=0)
    tree = cKDTree(unique)
    return [_split(outline, unique, tree) for outline in np.split(points, ends[:-1])]


def _welded(points_m: Array) -> Array:
    """Points (N, 3), each where the first of those it meets is."""
    count = len(points_m)
    pairs = cKDTree(points_m).query_pairs(WELD_M, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
    _, cluster = connected_components(graph, directed=False)
    _, first = np.unique(cluster, return_index=True)
    return np.asarray(points_m[first[cluster]])


def _split(outline: Array, points: Array, tree: Any) -> Array:
    """An outline (K, 3) with the points that lie on its edges."""
    ways = np.roll(outline, -1, axis=0) - outline
    near = tree.query_ball_point(outline + ways / 2, np.linalg.norm(ways, axis=1) / 2)
    edges = zip(outline, ways, near, strict=True)
    return np.concatenate([_on_edge(start, way, points[among]) for start, way, among in edges])


def _on_edge(start: Array, way: Array, points: Array) -> Array:
    """The start of an edge, then those of the points (N, 3) that lie on it, short of its end."""
    length = float(np.linalg.norm(way))
    direction = way / max(length, WELD_M)
    along = (points - start) @ direction
    beside = np.linalg.norm(points - start - along[:, None] * direction, axis=1)
    on = (beside < WELD_M) & (along > WELD_M) & (along < length - WELD_M)
    return np.concatenate([start[None], points[on][np.argsort(along[on])]])


def _triangles(outline: Array) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (V, 3) and triangles (T, 3) of a rectangle: from its middle where its edges are split."""
    if len(outline) == 4:
        return outline, np.array([[0, 1, 2], [0, 2, 3]])
    rim = np.arange(len(outline))
    middle = (outline.min(0) + outline.max(0)) / 2
    return np.vstack([outline, middle]), np.stack([rim, np.roll(rim, -1), np.full_like(rim, len(rim))], -1)


def _parts(baked: BakedScene) -> Iterator[BatchPart]:
    scene = baked.scene
    own = [surface for mover in scene.movers for surface in mover.surfaces]
    things = inventory(scene)
    first = len(things.surfaces) - len(own)  # movers come last in the inventory
    surfaces = [*things.surfaces[:first], *own]
    outlines: dict[int, Array] = {}  # sealed among surfaces that move together
    for body in np.unique(things.mover):
        members = np.flatnonzero(things.mover == body).tolist()
        outlines |= zip(members, sealed([corners(surfaces[index]) for index in members]), strict=True)
    for index, surface in enumerate(surfaces):
        material = None if things.panel[index] >= 0 else scene.materials[surface.material]
        yield BatchPart(index, surface, outlines[index], int(things.mover[index]), material)


def _primitive(baked: BakedScene, parts: list[BatchPart], copies: int) -> Any:
    """The parts' triangles on the graphics side, with their places on their texture and in the map of light."""
    texture = texture_of(parts[0].material) if parts[0].material is not None else None
    meshes = [_triangles(part.outline_m) for part in parts]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    places = [_fractions(part.surface, vertices) for part, (vertices, _) in zip(parts, meshes, strict=True)]
    on_texture = [part.surface.on_texture_m(*place.T) for part, place in zip(parts, places, strict=True)]
    on_light = [_on_light(baked, part, place) for part, place in zip(parts, places, strict=True)]
    primitive = pyrender.Primitive(
        positions=np.concatenate([vertices for vertices, _ in meshes]),
        texcoord_0=np.concatenate(on_texture) / (texture.tile_m if texture else 1),
        texcoord_1=np.concatenate(on_light),
        indices=np.concatenate([start + mesh[1] for start, mesh in zip(starts[:-1], meshes, strict=True)]),
        poses=np.tile(np.eye(4), (copies, 1, 1)),
    )
    primitive._add_to_context()
    return primitive


def _fractions(surface: Surface, points_m: Array) -> Array:
    """Where points (N, 3) lie along a surface's two edges, as fractions (N, 2)."""
    edges = np.stack([surface.edge_u_m, surface.edge_v_m], -1)
    return np.asarray((points_m - surface.corner_m) @ edges / (edges**2).sum(0))


def _on_light(baked: BakedScene, part: BatchPart, fractions: Array) -> Array:
    """Coordinates (N, 2) on the map of light of points at fractions (N, 2) of a part's edges."""
    first, along, _, up = baked.atlas.texture_coordinates(part.index)
    return np.asarray(first + fractions @ np.stack([along - first, up - first]))


MARGIN_PX = 1  # samples lie up to half a pixel from the middle


@dataclass(frozen=True, slots=True)
class RigidGroup:
    """Rectangles (Q) that move together, in their mover's frame: corners (4, 4 Q) and planes (Q, 4), homogeneous."""

    mover: int
    corners: Array
    planes: Array
    two_sided: NDArray[np.bool_]
    batch: NDArray[np.int64]

    def visible(self, view: PinholeView, bounds: Array) -> NDArray[np.int64]:
        """Indices of batches with a rectangle that faces the eye and is not wholly beyond one of the bounds (P, 4)."""
        T_world_mover = view.pose(self.mover)
        eye = se3.inverse(T_world_mover) @ [*view.eye_m, 1.0]
        faces = self.two_sided | (self.planes @ eye > 0)
        inside = (bounds @ T_world_mover @ self.corners).reshape(len(bounds), -1, 4).max(-1).min(0) > 0
        return np.asarray(self.batch[faces & inside])


class CullingSet:
    """All batches of a scene."""

    def __init__(self, batches: Sequence[Batch]) -> None:
        self._groups = [_rigid_group(mover, batches) for mover in sorted({batch.mover for batch in batches})]

    def visible(self, view: PinholeView, box: Box) -> set[int]:
        """Indices of all batches that can touch a box of a picture; of the others none does."""
        bounds = _bounds(view, box)
        return {index for group in self._groups for index in group.visible(view, bounds).tolist()}


def _rigid_group(mover: int, batches: Sequence[Batch]) -> RigidGroup:
    own = [batch for batch in batches if batch.mover == mover]
    quads = np.concatenate([batch.quads_m for batch in own])
    normals = np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0])
    offsets = -np.einsum("ij,ij->i", normals, quads[:, 0])
    corners = quads.reshape(-1, 3).T
    counts = [len(batch.quads_m) for batch in own]
    return RigidGroup(
        mover,
        np.vstack([corners, np.ones(corners.shape[1])]),
        np.column_stack([normals, offsets]),
        np.repeat([isinstance(batch.material, Glass) for batch in own], counts),
        np.repeat([batch.index for batch in own], counts),
    )


def _bounds(view: PinholeView, box: Box) -> Array:
    """Planes (P, 4) of the world around all that a box shows, positive inside: four sides, near, and the mirror."""
    u0, u1, v0, v1 = box
    x, y, depth, w = view.view_projection
    left, right = (2 * u / view.camera.width_px - 1 for u in (u0 - MARGIN_PX, u1 + MARGIN_PX))
    top, bottom = (1 - 2 * v / view.camera.height_px for v in (v0 - MARGIN_PX, v1 + MARGIN_PX))
    sides = [x - left * w, right * w - x, y - bottom * w, top * w - y, depth + w]
    return np.array(sides if view.mirror is None else [*sides, [*view.mirror.normal, view.mirror.offset_m]])
