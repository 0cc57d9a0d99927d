"""Batches of triangles to draw, and culling: which clusters of them can touch a part of a picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, cKDTree

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.view import Box, PinholeView, Plane
from vobench.scene.material import Material, fresnel
from vobench.scene.mesh import WELD_M, Triangles, distinct, unit

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
Floats = NDArray[np.float32]

PIECE_M = 0.25  # of long edges, so that few corners are looked at for each


@dataclass(frozen=True, slots=True)
class Sealed:
    """Triangles that leave no gap: `parent` (T,) is the face that each is a part of.

    corners_m (T, 3, 3); weights (T, 3, 3): what each of the parent's corners counts at each corner.
    """

    corners_m: Array
    parent: Indices
    weights: Array

    def of(self, values: Array) -> Array:
        """Values (F, 3, ...) at the faces' corners as (T, 3, ...) at the parts'."""
        return np.asarray(np.einsum("tij,tjk->tik", self.weights, values[self.parent]))


def sealed(corners_m: Array) -> Sealed:
    """Faces (F, 3, 3) with corners that meet welded, split where corners of others lie on their edges.

    Only edges that no other face shares are looked at: a closed mesh has none.
    """
    points, corner = _welded(corners_m.reshape(-1, 3))
    faces = corner.reshape(-1, 3)
    cuts = _cuts(points, _open_edges(faces))
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], -1)
    keys = np.sort(ends, -1) @ [len(points), 1]
    some = np.flatnonzero(np.isin(keys, list(cuts)).any(1))
    whole = np.setdiff1d(np.arange(len(faces)), some)
    parts = [_split(points, faces[face], keys[face].tolist(), cuts) for face in some]
    return Sealed(
        np.concatenate([points[faces[whole]], *(part[0] for part in parts)]),
        np.concatenate([whole, np.repeat(some, [len(part[0]) for part in parts])]),
        np.concatenate([np.tile(np.eye(3), (len(whole), 1, 1)), *(part[1] for part in parts)]),
    )


def _welded(points_m: Array) -> tuple[Array, Indices]:
    """The distinct ones (P, 3) among points (N, 3), each where the first of those it meets is, and which is which."""
    rows = np.ascontiguousarray(points_m + 0.0)
    _, first, which = np.unique(rows.view(np.dtype((np.void, 24))).ravel(), return_index=True, return_inverse=True)
    unique = rows[first]
    pairs = cKDTree(unique).query_pairs(WELD_M, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(unique), len(unique)))
    count, cluster = connected_components(graph, directed=False)
    earliest = np.full(count, len(rows))
    np.minimum.at(earliest, cluster, first)
    return rows[earliest], cluster[which].astype(np.int64)


def _open_edges(faces: Indices) -> Indices:
    """The edges (E, 2), lower end first, that a single one of the faces (F, 3) has; a face and its back are one."""
    faces = np.sort(faces, 1)
    edges = faces[distinct(faces)[0]][:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2)
    first, which = distinct(edges)
    alone = edges[first[np.bincount(which) == 1]]
    return np.asarray(alone[alone[:, 0] < alone[:, 1]])


def _cuts(points: Array, edges: Indices) -> dict[int, list[tuple[float, int]]]:
    """By edge, lower end times count of points plus upper end: where along it which others of the points lie."""
    ends = np.unique(edges)
    start = points[edges[:, 0]]
    way = points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(way, axis=1)
    pieces = np.ceil(length / PIECE_M).astype(int)
    edge = np.repeat(np.arange(len(edges)), pieces)
    nth = np.arange(len(edge)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    middle = start[edge] + ((nth + 0.5) / pieces[edge])[:, None] * way[edge]
    tree = cKDTree(points[ends]) if len(ends) else None
    found = tree.query_ball_point(middle, length[edge] / pieces[edge] / 2 + WELD_M) if tree else []
    counts = [len(some) for some in found]
    edge = np.repeat(edge, counts)
    point = ends[np.concatenate([np.zeros(0, int), *found]).astype(int)]
    along = np.einsum("ij,ij->i", points[point] - start[edge], way[edge]) / length[edge]
    beside = np.linalg.norm(points[point] - start[edge] - (along / length[edge])[:, None] * way[edge], axis=1)
    on = (beside < WELD_M) & (along > WELD_M) & (along < length[edge] - WELD_M)
    cuts: dict[int, set[tuple[float, int]]] = {}
    for e, share, p in zip(edge[on].tolist(), (along / length[edge])[on].tolist(), point[on].tolist(), strict=True):
        cuts.setdefault(int(edges[e] @ [len(points), 1]), set()).add((share, p))
    return {key: sorted(some) for key, some in cuts.items()}


def _split(
    points: Array, face: Indices, keys: Sequence[int], cuts: dict[int, list[tuple[float, int]]]
) -> tuple[Array, Array]:
    """Parts of a face, from its middle to its edges (T, 3, 3), and the weights of its corners (T, 3, 3)."""
    rim = []
    weights = []
    unit = np.eye(3)
    for nth, key in enumerate(keys):
        here = unit[nth]
        there = unit[(nth + 1) % 3]
        forward = face[nth] < face[(nth + 1) % 3]
        on = [(share if forward else 1 - share, p) for share, p in cuts.get(key, [])][:: 1 if forward else -1]
        rim += [face[nth], *(p for _, p in on)]
        weights += [here, *((1 - share) * here + share * there for share, _ in on)]
    outline = points[rim]
    shares = np.array(weights)
    middle = np.broadcast_to(points[face].mean(0), outline.shape)
    parts = np.stack([outline, np.roll(outline, -1, axis=0), middle], 1)
    return parts, np.stack([shares, np.roll(shares, -1, axis=0), np.full_like(shares, 1 / 3)], 1)


SMOOTH = 0.03  # GGX alpha below which a plane mirrors as if it were perfectly smooth
PROBE_MOST = 0.4  # roughness above which what is mirrored looks like what lights the place


def mirrors(material: Material) -> bool:
    """Whether its look depends on where it is seen from."""
    return material.kind != "body" or material.eta > 1 or material.metal > 0


def sharpness(material: Material) -> float:
    """The share that it mirrors as sharply as a perfect mirror, seen from a steep angle, 0 for none."""
    if material.kind != "pane" and material.roughness > SMOOTH:
        return 0.0
    share = float(fresnel(np.array(0.5), material.eta))
    return 1.0 if material.kind == "mirror" else max(share, material.metal)


@dataclass(frozen=True, slots=True, eq=False)
class Mirror:
    """Faces that mirror sharply in one plane of their mover's frame.

    outline_m (4, 3): corners around them all. strength: what they mirror of what comes from ahead, about.
    """

    index: int
    mover: int
    plane: Plane
    outline_m: Array
    is_pane: bool
    strength: float


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Faces drawn with one state: all of one material, mover (-1 for none) and mirror, in the mover's frame.

    Lamps' faces shine with what the map of light holds.
    """

    index: int
    material: Material
    mover: int
    mirror: Mirror | None
    is_lamp: bool
    area_m2: float

    @property
    def is_pane(self) -> bool:
        """Whether it is glass, seen from both sides."""
        return self.material.kind == "pane" and not self.is_lamp

    @property
    def has_gloss(self) -> bool:
        """Whether its look depends on where it is seen from."""
        return mirrors(self.material) and not self.is_lamp


CLUSTER = 128  # faces: so few that a strip of rows draws little beyond it


@dataclass(frozen=True, slots=True)
class Clusters:
    """Faces that lie together and are culled together, batch by batch: boxes low_m, high_m (C, 3) in a mover's frame.

    first, count (C,): their part of the list of indices; batch, mover (C,); axis (C, 3), sine (C,): the mean direction
    that they face and how far from it they turn, 1 where they may be seen from anywhere.
    """

    low_m: Array
    high_m: Array
    first: Indices
    count: Indices
    batch: Indices
    mover: Indices
    axis: Array
    sine: Array


Runs = dict[int, list[tuple[int, int]]]


class CullingSet:
    """All clusters of a scene."""

    def __init__(self, clusters: Clusters) -> None:
        self._all = clusters
        self._centre_m = (clusters.low_m + clusters.high_m) / 2
        self._radius_m = np.linalg.norm(clusters.high_m - clusters.low_m, axis=1) / 2
        bodies = [np.flatnonzero(clusters.mover == mover) for mover in np.unique(clusters.mover)]
        self._bodies = [(int(clusters.mover[own[0]]), own) for own in bodies]

    def visible(self, view: PinholeView, box: Box) -> Runs:
        """By batch the runs (first, count) of indices that can touch a box of a picture; of the others none does."""
        seen = np.zeros(len(self._all.batch), bool)
        edges = bounds(view, box)
        for mover, own in self._bodies:
            T_world_mover = view.pose(mover)
            planes = edges @ T_world_mover
            normal = planes[:, :3]
            reach = np.maximum(normal, 0) @ self._all.high_m[own].T + np.minimum(normal, 0) @ self._all.low_m[own].T
            seen[own] = (reach + planes[:, 3:] > 0).all(0)
            seen[own] &= self._faces(se3.apply(se3.inverse(T_world_mover), view.eye_m[None])[0], own)
        return self._runs(np.flatnonzero(seen))

    def _faces(self, eye_m: Array, own: Indices) -> Mask:
        """Which clusters (K,) have a face that may be seen from an eye (3,) in their frame."""
        away = self._centre_m[own] - eye_m
        distance = np.linalg.norm(away, axis=1)
        behind = np.einsum("ij,ij->i", away, self._all.axis[own]) - self._radius_m[own]
        return np.asarray(behind < self._all.sine[own] * distance + WELD_M)

    def _runs(self, some: Indices) -> Runs:
        """Neighbours among some clusters joined."""
        batch = self._all.batch[some]
        begins = np.flatnonzero((np.diff(some, prepend=-2) != 1) | (np.diff(batch, prepend=-1) != 0))
        count = np.add.reduceat(self._all.count[some], begins) if len(begins) else begins
        runs: Runs = {}
        for b, first, n in zip(
            batch[begins].tolist(), self._all.first[some[begins]].tolist(), count.tolist(), strict=True
        ):
            runs.setdefault(b, []).append((first, n))
        return runs


MARGIN_PX = 1  # samples lie up to half a pixel from the middle


def bounds(view: PinholeView, box: Box) -> Array:
    """Planes (P, 4) of the world around all that a box shows, positive inside: four sides, near, and the mirror."""
    u0, u1, v0, v1 = box
    x, y, depth, w = view.view_projection
    left, right = (2 * u / view.camera.width_px - 1 for u in (u0 - MARGIN_PX, u1 + MARGIN_PX))
    top, bottom = (1 - 2 * v / view.camera.height_px for v in (v0 - MARGIN_PX, v1 + MARGIN_PX))
    sides = [x - left * w, right * w - x, y - bottom * w, top * w - y, w - depth]
    return np.array(sides if view.mirror is None else [*sides, [*view.mirror.normal, view.mirror.offset_m]])


VERTEX_FLOATS = 10


@dataclass(frozen=True, slots=True)
class Geometry:
    """What is drawn: vertices (V, 10) float32 with position, normal, and places on texture and map of light.

    indices (3 T,) uint32 go by batch and cluster.
    """

    vertices: Floats
    indices: NDArray[np.uint32]
    batches: tuple[Batch, ...]
    mirrors: tuple[Mirror, ...]
    clusters: Clusters


LAMP = Material()


def geometry(faces: Triangles, light_uv: Floats, materials: dict[str, Material]) -> Geometry:
    """All faces of a table, movers in their own frame, in an order that never changes."""
    looks = [materials.get(thing.material, LAMP) for thing in faces.things]
    parts = _sealed_by_mover(faces)
    parent = parts.parent
    thing = faces.thing[parent]
    mover = faces.mover[parent]
    lamp = faces.lamp[parent] >= 0
    areas = np.linalg.norm(np.cross(*np.moveaxis(np.diff(parts.corners_m, axis=1), 1, 0)), axis=1) / 2
    strength = np.array([sharpness(look) for look in looks])[thing] * ~lamp
    pane = np.array([look.kind == "pane" for look in looks], bool)[thing] & ~lamp
    mirror, found = _mirrors(parts.corners_m, faces.plane[parent], areas, mover=mover, strength=strength, pane=pane)
    nth_look = {id(look): nth for nth, look in enumerate(looks)}
    keys = np.column_stack([mover, lamp, mirror, np.array([nth_look[id(look)] for look in looks])[thing]])
    first, batch = distinct(keys)
    area = np.bincount(batch, areas)
    batches = tuple(
        Batch(
            nth, looks[thing[f]], int(mover[f]), found[mirror[f]] if mirror[f] >= 0 else None, bool(lamp[f]), area[nth]
        )
        for nth, f in enumerate(first.tolist())
    )
    order, cluster = _clustered(parts.corners_m.mean(1), batch, thing)
    tile = np.array([look.tile_m for look in looks])[thing]
    gloss = np.array([b.has_gloss and b.mirror is None for b in batches])[batch]
    columns = [
        parts.corners_m,
        parts.of(faces.normals) * gloss[:, None, None],
        parts.of(faces.uv) / tile[:, None, None],
        parts.of(light_uv.astype(float)),
    ]
    rows = np.concatenate([column[order] for column in columns], -1).astype(np.float32).reshape(-1, VERTEX_FLOATS)
    vertices, indices = _indexed(rows + np.float32(0))
    clusters = _boxes(parts.corners_m[order], faces.plane[parent][order], batch[order], cluster, batches)
    return Geometry(vertices, indices, batches, tuple(found), clusters)


def _sealed_by_mover(faces: Triangles) -> Sealed:
    """The faces, sealed among those that move together."""
    parts = []
    for mover in np.unique(faces.mover):
        own = np.flatnonzero(faces.mover == mover)
        part = sealed(faces.corners_m[own])
        parts.append((part.corners_m, own[part.parent], part.weights))
    return Sealed(*(np.concatenate(column) for column in zip(*parts, strict=True)))


# between faces that mirror as one plane
PLANE_TILT = np.deg2rad(0.1)
PLANE_OFF_M = 1e-3
LEAST_M2 = 0.05
MOST_MIRRORS = 64
LEAST_FILL = 0.02  # of the rectangle around them: a rim is no mirror


def _mirrors(
    corners_m: Array, normals: Array, areas: Array, *, mover: Any, strength: Array, pane: Mask
) -> tuple[Indices, list[Mirror]]:
    """Which mirror each face belongs to (F,), -1 for none, and the mirrors, the largest first."""
    # Panes mirror on both sides: those that face away are the same plane.
    sign = np.where(pane & (normals @ [1e-4, 1e-2, 1.0] < 0), -1.0, 1.0)
    normal = normals * sign[:, None]
    offset = -np.einsum("ij,ij->i", normal, corners_m[:, 0])
    free = (strength > 0) & normals.any(1)
    index = np.full(len(areas), -1)
    found = list[Mirror]()
    cells = np.round(np.column_stack([500 * normal, 500 * offset, mover, pane]))
    cell = distinct(cells)[1]
    sizes = np.bincount(cell, areas * free)
    for nth in np.argsort(-sizes, kind="stable")[: 4 * MOST_MIRRORS].tolist():
        own = np.flatnonzero(free & (cell == nth))
        if len(own) == 0 or len(found) == MOST_MIRRORS:
            continue
        seed = own[np.argmax(areas[own])]
        plane = Plane(normal[seed], float(offset[seed]))
        near = free & (mover == mover[seed]) & (pane == pane[seed]) & (normal @ plane.normal > np.cos(PLANE_TILT))
        near[near] = np.abs(corners_m[near] @ plane.normal + plane.offset_m).max(1) < PLANE_OFF_M
        outline = _outline(corners_m[near].reshape(-1, 3), plane)
        least = max(LEAST_M2, LEAST_FILL * float(np.prod(np.linalg.norm(np.diff(outline[:3], axis=0), axis=1))))
        if areas[near].sum() < least:
            continue
        index[near] = len(found)
        free = free & ~near
        most = float(strength[near].max())
        found.append(Mirror(len(found), int(mover[seed]), plane, outline, bool(pane[seed]), most))
    return index, found


def _outline(points_m: Array, plane: Plane) -> Array:
    """The corners (4, 3) of the smallest rectangle around points (N, 3) in a plane; one side is the hull's."""
    axes = np.linalg.svd(plane.normal[None])[2][1:]
    hull = points_m[ConvexHull(points_m @ axes.T).vertices]
    along = unit(np.roll(hull, -1, axis=0) - hull)
    across = np.cross(plane.normal, along)
    u = hull @ along.T
    v = hull @ across.T
    best = int(np.argmin(np.ptp(u, axis=0) * np.ptp(v, axis=0)))
    a, b = ([x[:, best].min(), x[:, best].max()] for x in (u, v))
    corners = np.array([[a[0], b[0]], [a[1], b[0]], [a[1], b[1]], [a[0], b[1]]])
    return np.asarray(corners @ np.stack([along[best], across[best]]) - plane.offset_m * plane.normal)


def _clustered(centres_m: Array, batch: Indices, thing: Any) -> tuple[Indices, Indices]:
    """An order of faces by batch, thing and place, and the cluster of each in that order; small things share one."""
    _, part, count = np.unique(batch * (thing.max() + 1) + thing, return_inverse=True, return_counts=True)
    part[count[part] < CLUSTER // 4] = -1
    order = np.lexsort((_morton(centres_m), part, batch))
    new = (np.diff(batch[order], prepend=-1) != 0) | (np.diff(part[order], prepend=-2) != 0)
    rank = np.arange(len(order)) - np.flatnonzero(new)[np.cumsum(new) - 1]
    return order, np.cumsum(rank % CLUSTER == 0) - 1


def _morton(points_m: Array) -> NDArray[np.uint64]:
    """Numbers (N,) that are near for points (N, 3) that are. Source: Morton (1966)."""
    low = points_m.min(0)
    high = points_m.max(0)
    cells = ((points_m - low) / max(float((high - low).max()), WELD_M) * 1023).astype(np.uint64)
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        cells = (cells | cells << np.uint64(shift)) & np.uint64(mask)
    return np.asarray(cells @ np.array([1, 2, 4], np.uint64))


def _indexed(rows: Floats) -> tuple[Floats, NDArray[np.uint32]]:
    """The distinct rows (V, 10), first come first, and which of them each (N,) is."""
    _, first, which = np.unique(
        rows.view(np.dtype((np.void, rows.itemsize * VERTEX_FLOATS))).ravel(), return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rows[first[order]], rank[which].astype(np.uint32)


def _boxes(corners_m: Array, normals: Array, batch: Indices, cluster: Indices, batches: Sequence[Batch]) -> Clusters:
    """The clusters of ordered faces."""
    begins = np.searchsorted(cluster, np.arange(cluster[-1] + 1))
    own = batch[begins]
    axis = unit(np.add.reduceat(normals, begins))
    cosine = np.minimum.reduceat(np.einsum("ij,ij->i", normals, axis[cluster]), begins)
    open_ = (cosine <= 0) | np.array([b.is_pane for b in batches])[own]
    return Clusters(
        np.minimum.reduceat(corners_m.min(1), begins),
        np.maximum.reduceat(corners_m.max(1), begins),
        3 * begins,
        3 * np.diff(begins, append=len(cluster)),
        own,
        np.array([b.mover for b in batches])[own],
        axis,
        np.where(open_, 1.0, np.sqrt(np.maximum(1 - cosine**2, 0))),
    )
