"""A baked scene as what OpenGL draws: rectangles in batches, one for each material, mover and mirroring plane.

OpenGL leaves no gap between triangles that share the ends of an edge to the last bit, and only between those. So
corners that meet are welded, and an edge on which others end is split there.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyrender
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene
from vobench.render.geometry import corners, inventory
from vobench.render.mirror import Plane
from vobench.render.texture import FloatTexture, ReflectanceTexture
from vobench.scene.material import Glass, Material, Mirror, Polished, texture_of
from vobench.scene.surface import Surface

# Corners nearer than this are one: float32 resolves 1e-6 m at 10 m.
WELD_M = 1e-5


@dataclass(frozen=True, slots=True)
class Batch:
    """Rectangles drawn in one call: all of one material and mover (-1 for none), in the mover's frame.

    Those that mirror lie in one plane; panels have no material. quads_m (K, 4, 3) are the corners.
    """

    index: int
    primitive: Any
    material: Material | None
    mover: int
    plane: Plane | None
    quads_m: Array
    body_scale: float


@dataclass(frozen=True, slots=True)
class Stock:
    """What batches are made from: the baked scene, its textures on the graphics side, and how often each is drawn."""

    baked: BakedScene
    light: FloatTexture
    tiles: dict[str, ReflectanceTexture]
    blank: ReflectanceTexture
    copies: int


@dataclass(frozen=True, slots=True)
class Part:
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


def batches(baked: BakedScene, light: FloatTexture, *, copies: int) -> list[Batch]:
    """All rectangles of a scene, each drawn `copies` times (once a sample), in an order that never changes."""
    groups: dict[tuple[object, ...], list[Part]] = {}
    for part in _parts(baked):
        groups.setdefault(part.key, []).append(part)
    tiles = {name: ReflectanceTexture(tile) for name, tile in baked.albedo.items()}
    stock = Stock(baked, light, tiles, ReflectanceTexture(np.ones((2, 2), np.float32)), copies)
    return [_batch(stock, index, parts) for index, parts in enumerate(groups.values())]


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
    welded: Array = points_m[first[cluster]]
    return welded


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


def _parts(baked: BakedScene) -> Iterator[Part]:
    scene = baked.scene
    own = [surface for mover in scene.movers for surface in mover.surfaces]
    things = inventory(scene)
    first = len(things.surfaces) - len(own)  # movers come last in the inventory
    surfaces = [*things.surfaces[:first], *own]
    outlines = _outlines(surfaces, things.mover)
    for index, surface in enumerate(surfaces):
        material = None if things.panel[index] >= 0 else scene.materials[surface.material]
        yield Part(index, surface, outlines[index], int(things.mover[index]), material)


def _outlines(surfaces: Sequence[Surface], mover: NDArray[np.int32]) -> dict[int, Array]:
    """Outlines (K, 3) of all surfaces, sealed among those that move together."""
    outlines: dict[int, Array] = {}
    for body in np.unique(mover):
        members = np.flatnonzero(mover == body).tolist()
        outlines |= zip(members, sealed([corners(surfaces[index]) for index in members]), strict=True)
    return outlines


def _batch(stock: Stock, index: int, parts: list[Part]) -> Batch:
    material = parts[0].material
    texture = texture_of(material) if material is not None else None
    tile = stock.blank if texture is None else stock.tiles[parts[0].surface.material]
    meshes = [_triangles(part.outline_m) for part in parts]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    places = [_fractions(part.surface, vertices) for part, (vertices, _) in zip(parts, meshes, strict=True)]
    on_texture = [part.surface.on_texture_m(*place.T) for part, place in zip(parts, places, strict=True)]
    on_light = [_on_light(stock, part, place) for part, place in zip(parts, places, strict=True)]
    primitive = pyrender.Primitive(
        positions=np.concatenate([vertices for vertices, _ in meshes]),
        texcoord_0=np.concatenate(on_texture) / (texture.tile_m if texture else 1),
        texcoord_1=np.concatenate(on_light),
        indices=np.concatenate([start + mesh[1] for start, mesh in zip(starts[:-1], meshes, strict=True)]),
        material=pyrender.MetallicRoughnessMaterial(baseColorTexture=tile, emissiveTexture=stock.light),
        mode=4,
        poses=np.tile(np.eye(4), (stock.copies, 1, 1)),
    )
    quads = np.stack([corners(part.surface) for part in parts])
    return Batch(index, primitive, material, parts[0].mover, parts[0].plane, quads, tile.scale / np.pi)


def _fractions(surface: Surface, points_m: Array) -> Array:
    """Where points (N, 3) lie along a surface's two edges, as fractions (N, 2)."""
    edges = np.stack([surface.edge_u_m, surface.edge_v_m], -1)
    fractions: Array = (points_m - surface.corner_m) @ edges / (edges**2).sum(0)
    return fractions


def _on_light(stock: Stock, part: Part, fractions: Array) -> Array:
    """Coordinates (N, 2) on the map of light of points at fractions (N, 2) of a part's edges."""
    first, along, _, up = stock.baked.layout.texture_coordinates(part.index)
    coordinates: Array = first + fractions @ np.stack([along - first, up - first])
    return coordinates
