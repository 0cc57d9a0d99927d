"""Watertight triangles: corners that meet are welded, and edges split where corners of others lie on them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vobench.geometry.se3 import Array
from vobench.scene.weld import WELD_M, distinct_rows

Indices = NDArray[np.int64]

PIECE_M = 0.25  # of long edges, so that few corners are looked at for each

Cuts = dict[int, list[tuple[float, int]]]


@dataclass(frozen=True, slots=True)
class WatertightMesh:
    """Triangles that leave no gap: `parent` (T,) is the face that each is a part of.

    corners_m (T, 3, 3); weights (T, 3, 3): what each of the parent's corners counts at each corner.
    """

    corners_m: Array
    parent: Indices
    weights: Array

    def interpolated(self, values: Array) -> Array:
        """Values (F, 3, ...) at the faces' corners as (T, 3, ...) at the parts'."""
        return np.asarray(np.einsum("tij,tjk->tik", self.weights, values[self.parent]))


def watertight(corners_m: Array) -> WatertightMesh:
    """Faces (F, 3, 3) with corners that meet welded, split where corners of others lie on their edges.

    Only edges that no other face shares are looked at: a closed mesh has none.
    """
    points_m, corner = _welded(corners_m.reshape(-1, 3))
    faces = corner.reshape(-1, 3)
    cuts = _cuts(points_m, _open_edges(faces))
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], -1)  # (F, 3, 2): both ends of each edge
    keys = np.sort(ends, -1) @ [len(points_m), 1]
    is_cut = np.isin(keys, list(cuts)).any(1)

    whole = np.flatnonzero(~is_cut)
    corners = [points_m[faces[whole]]]
    parents = [whole]
    weights = [np.tile(np.eye(3), (len(whole), 1, 1))]
    for face in np.flatnonzero(is_cut):
        part_corners_m, part_weights = _split(points_m, faces[face], keys[face].tolist(), cuts)
        corners.append(part_corners_m)
        parents.append(np.full(len(part_corners_m), face))
        weights.append(part_weights)
    return WatertightMesh(np.concatenate(corners), np.concatenate(parents), np.concatenate(weights))


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
    edges = faces[distinct_rows(faces)[0]][:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2)
    first, which = distinct_rows(edges)
    alone = edges[first[np.bincount(which) == 1]]
    return np.asarray(alone[alone[:, 0] < alone[:, 1]])


def _cuts(points_m: Array, edges: Indices) -> Cuts:
    """By edge, lower end times count of points plus upper end: where along it which others of the points lie."""
    if not len(edges):
        return {}
    edge, point = _near_edges(points_m, edges)
    start_m = points_m[edges[:, 0]]
    vector_m = points_m[edges[:, 1]] - points_m[edges[:, 0]]
    length_m = np.linalg.norm(vector_m, axis=1)

    from_start_m = points_m[point] - start_m[edge]
    along_m = np.einsum("ij,ij->i", from_start_m, vector_m[edge]) / length_m[edge]
    share = along_m / length_m[edge]
    from_edge_m = from_start_m - share[:, None] * vector_m[edge]
    beside_m = np.linalg.norm(from_edge_m, axis=1)
    is_between = (along_m > WELD_M) & (along_m < length_m[edge] - WELD_M)
    is_on_edge = (beside_m < WELD_M) & is_between

    cuts: dict[int, set[tuple[float, int]]] = {}
    keys = edges @ [len(points_m), 1]
    for row in np.flatnonzero(is_on_edge):
        key = int(keys[edge[row]])
        cuts.setdefault(key, set()).add((float(share[row]), int(point[row])))
    return {key: sorted(places) for key, places in cuts.items()}


def _near_edges(points_m: Array, edges: Indices) -> tuple[Indices, Indices]:
    """Pairs of edges and ends of edges that may lie on them: rows of `edges` (N,) and of points (N,)."""
    ends = np.unique(edges)
    start_m = points_m[edges[:, 0]]
    vector_m = points_m[edges[:, 1]] - points_m[edges[:, 0]]
    length_m = np.linalg.norm(vector_m, axis=1)
    piece_count = np.ceil(length_m / PIECE_M).astype(int)
    edge = np.repeat(np.arange(len(edges)), piece_count)
    first_piece = np.repeat(np.cumsum(piece_count) - piece_count, piece_count)
    piece = np.arange(len(edge)) - first_piece
    middle_share = (piece + 0.5) / piece_count[edge]
    middle_m = start_m[edge] + middle_share[:, None] * vector_m[edge]
    radius_m = length_m[edge] / piece_count[edge] / 2 + WELD_M
    neighbours = cKDTree(points_m[ends]).query_ball_point(middle_m, radius_m)
    counts = [len(group) for group in neighbours]
    point = ends[np.concatenate([np.zeros(0, int), *neighbours]).astype(int)]
    return np.repeat(edge, counts), point


def _split(
    points_m: Array,
    face: Indices,
    keys: Sequence[int],
    cuts: Cuts,
) -> tuple[Array, Array]:
    """Parts of a face, from its middle to its edges (T, 3, 3), and the weights of its corners (T, 3, 3)."""
    rim = []
    rim_weights = []
    corner_weights = np.eye(3)
    for nth, key in enumerate(keys):
        following = (nth + 1) % 3
        here = corner_weights[nth]
        there = corner_weights[following]
        places = cuts.get(key, [])
        if face[nth] >= face[following]:  # against the direction in which edges are kept
            places = [(1 - share, point) for share, point in reversed(places)]
        rim.append(face[nth])
        rim_weights.append(here)
        for share, point in places:
            rim.append(point)
            rim_weights.append((1 - share) * here + share * there)
    outline_m = points_m[rim]
    weights = np.array(rim_weights)
    middle_m = np.broadcast_to(points_m[face].mean(0), outline_m.shape)
    middle_weights = np.full_like(weights, 1 / 3)
    next_m = np.roll(outline_m, -1, axis=0)
    parts_m = np.stack([outline_m, next_m, middle_m], 1)
    next_weights = np.roll(weights, -1, axis=0)
    return parts_m, np.stack([weights, next_weights, middle_weights], 1)
