"""Batches of rectangles to draw, and culling: which of them can touch a part of a picture."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
import pyrender
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene
from vobench.render.geometry import Floats, Indices, Mask, corners, inventory
from vobench.render.opengl import FloatTexture, ReflectanceTexture
from vobench.render.view import Box, PinholeView, Plane
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
class BatchInputs:
    """What batches are made from: the baked scene, its textures on the graphics side, and how often each is drawn."""

    baked: BakedScene
    light: FloatTexture
    tiles: dict[str, ReflectanceTexture]
    blank: ReflectanceTexture
    copies: int


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


def batches(baked: BakedScene, light: FloatTexture, *, copies: int) -> list[Batch]:
    """All rectangles of a scene, each drawn `copies` times (once a sample), in an order that never changes."""
    groups: dict[tuple[object, ...], list[BatchPart]] = {}
    for part in _parts(baked):
        groups.setdefault(part.key, []).append(part)
    tiles = {name: ReflectanceTexture(tile) for name, tile in baked.albedo.items()}
    stock = BatchInputs(baked, light, tiles, ReflectanceTexture(np.ones((2, 2), np.float32)), copies)
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


def _parts(baked: BakedScene) -> Iterator[BatchPart]:
    scene = baked.scene
    own = [surface for mover in scene.movers for surface in mover.surfaces]
    things = inventory(scene)
    first = len(things.surfaces) - len(own)  # movers come last in the inventory
    surfaces = [*things.surfaces[:first], *own]
    outlines = _outlines(surfaces, things.mover)
    for index, surface in enumerate(surfaces):
        material = None if things.panel[index] >= 0 else scene.materials[surface.material]
        yield BatchPart(index, surface, outlines[index], int(things.mover[index]), material)


def _outlines(surfaces: Sequence[Surface], mover: NDArray[np.int32]) -> dict[int, Array]:
    """Outlines (K, 3) of all surfaces, sealed among those that move together."""
    outlines: dict[int, Array] = {}
    for body in np.unique(mover):
        members = np.flatnonzero(mover == body).tolist()
        outlines |= zip(members, sealed([corners(surfaces[index]) for index in members]), strict=True)
    return outlines


def _batch(stock: BatchInputs, index: int, parts: list[BatchPart]) -> Batch:
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


def _on_light(stock: BatchInputs, part: BatchPart, fractions: Array) -> Array:
    """Coordinates (N, 2) on the map of light of points at fractions (N, 2) of a part's edges."""
    first, along, _, up = stock.baked.layout.texture_coordinates(part.index)
    coordinates: Array = first + fractions @ np.stack([along - first, up - first])
    return coordinates


MARGIN_PX = 1  # samples lie up to half a pixel from the middle


@dataclass(frozen=True, slots=True)
class RigidGroup:
    """Rectangles (Q) that move together, in their mover's frame: corners (4, 4 Q) and planes (Q, 4), homogeneous."""

    mover: int
    corners: Array
    planes: Array
    two_sided: NDArray[np.bool_]
    batch: NDArray[np.int64]

    def in_sight(self, view: PinholeView, bounds: Array) -> NDArray[np.int64]:
        """Indices of batches with a rectangle that faces the eye and is not wholly beyond one of the bounds (P, 4)."""
        T_world_mover = view.pose(self.mover)
        eye = se3.inverse(T_world_mover) @ [*view.eye_m, 1.0]
        faces = self.two_sided | (self.planes @ eye > 0)
        inside = (bounds @ T_world_mover @ self.corners).reshape(len(bounds), -1, 4).max(-1).min(0) > 0
        found: NDArray[np.int64] = self.batch[faces & inside]
        return found


class CullingSet:
    """All batches of a scene."""

    def __init__(self, batches: Sequence[Batch]) -> None:
        self._crews = [_crew(mover, batches) for mover in sorted({batch.mover for batch in batches})]

    def in_sight(self, view: PinholeView, box: Box) -> set[int]:
        """Indices of all batches that can touch a box of a picture; of the others none does."""
        bounds = _bounds(view, box)
        return {index for crew in self._crews for index in crew.in_sight(view, bounds).tolist()}


def _crew(mover: int, batches: Sequence[Batch]) -> RigidGroup:
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


Scalar = TypeVar("Scalar", bound=np.generic)

TILE_PX = 16
MARGIN = 2e-6  # on sines and cosines, for float32
EDGE_ON_M = 1e-6


@dataclass(frozen=True, slots=True)
class Tiles:
    """A camera's pixels (H, W, 2), their unit rays (H, W, 3), and for each tile the cone around its pixels' rays.

    axis (V, U, 3) unit; sine (V, U) of the angle to the farthest ray, infinite where a pixel has none.
    """

    uv_px: Array
    rays: Array
    axis: Floats
    sine: Floats


@lru_cache(maxsize=4)
def tiles(camera: Camera) -> Tiles:
    """The tiles of a camera; kept, as cameras are few and pictures many."""
    uv_px = camera.pixel_grid()
    rays = camera.rays(uv_px)
    sums = _over_tiles(np.add, rays)
    with np.errstate(invalid="ignore"):
        axis = sums / np.linalg.norm(sums, axis=-1, keepdims=True)
        cosine = _over_tiles(np.minimum, (rays * spread(axis, rays.shape)).sum(-1))
    # Beyond some 60° bounds are of no use; NaN compares false.
    sine = np.where(cosine > 0.5, np.sqrt(np.clip(1 - cosine**2, 0, 1)) + MARGIN, np.inf)
    return Tiles(uv_px, rays, np.nan_to_num(axis).astype(np.float32), sine.astype(np.float32))


def spread(values: NDArray[Scalar], shape: tuple[int, ...]) -> NDArray[Scalar]:
    """Values of tiles (V, U, ...) at each of their pixels, for a picture of some shape (H, W, ...)."""
    return values.repeat(TILE_PX, 0)[: shape[0]].repeat(TILE_PX, 1)[:, : shape[1]]


def balls(planes: Array, axis: Floats, sine: Floats) -> tuple[Array, Array]:
    """Centres (T, 3) and radii (T,) of balls around what cones cut out of planes, as in `geometry.ShotSurfaces`.

    NaN or infinite where a cone does not end on its plane.
    """
    half_sine = np.minimum(sine, 1).astype(float)
    half_cosine = np.sqrt(1 - half_sine**2)
    along = np.einsum("tc,tc->t", planes, axis)
    across = np.sqrt(np.maximum((planes**2).sum(1) - along**2, 0)) * half_sine
    with np.errstate(divide="ignore", invalid="ignore"):
        middle_m, nearest_m = 1 / along, 1 / (along * half_cosine + across)
        farthest_m = np.where(along * half_cosine > across, 1 / (along * half_cosine - across), np.inf)
        aside = np.maximum(farthest_m - middle_m, middle_m - nearest_m)
        return axis * middle_m[:, None], (aside + middle_m * np.sqrt(2 - 2 * half_cosine)) * (1 + MARGIN)


def _over_tiles(reduce: np.ufunc, values: Array) -> Array:
    """A reduction over the pixels of each tile: (H, W, ...) to (V, U, ...)."""
    height, width = values.shape[:2]
    by_row = reduce.reduceat(values, np.arange(0, height, TILE_PX), axis=0)
    return np.asarray(reduce.reduceat(by_row, np.arange(0, width, TILE_PX), axis=1))


class PointView:
    """Rectangles as one point sees them: corners (S, 4, 3) relative to it, `counts` (S,) says which count."""

    def __init__(self, corners_m: Array, counts: Mask) -> None:
        normal = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 3] - corners_m[:, 0])
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        away_m = np.einsum("sc,sc->s", normal, corners_m[:, 0])
        # A rectangle seen edge-on hides nothing.
        self._which = np.flatnonzero(counts & (np.abs(away_m) > EDGE_ON_M))
        corner, normal, away_m = corners_m[self._which], normal[self._which], away_m[self._which]
        edges = np.cross(corner, np.roll(corner, -1, axis=1))
        inward = np.sign(np.einsum("sec,sc->se", edges, corner.mean(1)))[..., None]
        length = np.linalg.norm(edges, axis=-1, keepdims=True)
        # Where the point lies in line with an edge the normal is 0: neither inside nor outside.
        self._edges = (inward * edges / np.where(length > 0, length, 1.0)).astype(np.float32)
        self._normal = (np.where(away_m < 0, -1, 1)[:, None] * normal).astype(np.float32)
        self._away_m = np.abs(away_m).astype(np.float32)

    def fills(self, axis: Floats, sine: Floats) -> Indices:
        """The surface that is all there is to see in cones (T, 3), (T,), -1 where that is not sure."""
        inside = self._inside(axis)
        nearest_m, farthest_m = self._range_m(axis, sine)
        covering = np.where((inside > sine[:, None]), farthest_m, np.inf)
        if not len(self._which):
            return np.full(len(axis), -1, np.int32)
        best = covering.argmin(1)
        limit_m = np.take_along_axis(covering, best[:, None], 1)
        rival = (inside >= -sine[:, None]) & (nearest_m < limit_m)
        np.put_along_axis(rival, best[:, None], values=False, axis=1)
        sure = np.isfinite(limit_m[:, 0]) & ~rival.any(1)
        return np.where(sure, self._which[best], -1).astype(np.int32)

    def shading(self, centers_m: Array, radii_m: Array, own: Indices) -> tuple[Mask, Mask]:
        """Balls (T, 3), (T,) of points of surfaces `own` (T,) that are surely in plain sight, and surely all hidden."""
        reach_m = np.linalg.norm(centers_m, axis=-1)
        outside = reach_m > 2 * radii_m
        reach_m, centers_m = np.where(outside, reach_m, 1), np.where(outside[:, None], centers_m, 1)
        axis = (centers_m / reach_m[:, None]).astype(np.float32)
        sine = (np.where(outside, radii_m / reach_m, 1) + MARGIN).astype(np.float32)
        inside, (nearest_m, farthest_m) = self._inside(axis), self._range_m(axis, sine)
        others = self._which != own[:, None]
        before = others & (inside >= -sine[:, None]) & (nearest_m < (reach_m + radii_m)[:, None])
        across = others & (inside > sine[:, None]) & (farthest_m < (reach_m - radii_m)[:, None])
        return np.asarray(outside & ~before.any(1)), np.asarray(outside & across.any(1))

    def touches(self, axis: Floats, sine: Floats) -> Mask:
        """Whether anything may be in cones (T, 3), (T,)."""
        return np.asarray(~(self._inside(axis) < -sine[:, None]).all(1))

    def _inside(self, axis: Floats) -> Floats:
        """The least sine (T, S) of the angle between axes and the planes through the point and an edge."""
        first, second, third, fourth = (np.einsum("tc,sc->ts", axis, self._edges[:, edge]) for edge in range(4))
        least: Floats = np.minimum(np.minimum(first, second), np.minimum(third, fourth))
        return least

    def _range_m(self, axis: Floats, sine: Floats) -> tuple[Floats, Floats]:
        """How near and how far (T, S) the surfaces' planes may be along rays of cones."""
        half_sine = np.minimum(sine, 1)[:, None]
        half_cosine = np.sqrt(1 - half_sine**2)
        cosine = np.clip(np.einsum("tc,sc->ts", axis, self._normal), -1, 1)
        along, across = cosine * half_cosine, np.sqrt(1 - cosine**2) * half_sine
        # Within the cone's half angle of the normal, the normal itself is among the rays.
        most = np.where(cosine >= half_cosine, 1, along + across) + np.float32(MARGIN)
        least = along - across - np.float32(MARGIN)
        with np.errstate(divide="ignore", invalid="ignore"):
            nearest = np.where(most > 0, self._away_m / most, np.inf)
            farthest = np.where(least > 0, self._away_m / least, np.inf)
        return nearest, farthest
