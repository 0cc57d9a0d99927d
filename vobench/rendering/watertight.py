"""Watertight triangles: adjacent faces get the same vertices along their common edges, so that no gap is drawn."""

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

# Long edges are divided into pieces of this length, around which the points near the edge are searched.
PIECE_M = 0.25

# The points on each edge: the share of the edge's length at which each lies, and its index. An edge is identified by
# its `_edge_keys`.
Cuts = dict[int, list[tuple[float, int]]]


@dataclass(frozen=True, slots=True)
class WatertightMesh:
    """T triangles without gaps between them.

    `corners_m` (T, 3, 3) are their corners.
    `parent` (T,) is the face that each triangle is a part of.
    `weights` (T, 3, 3) are the barycentric weights of the parent's corners at each corner of a triangle.
    """

    corners_m: Array
    parent: Indices
    weights: Array

    def interpolated(self, values: Array) -> Array:
        """The values at the corners of the triangles (T, 3, C), interpolated between those of the faces (F, 3, C)."""
        return np.asarray(np.einsum("tij,tjk->tik", self.weights, values[self.parent]))


def watertight(corners_m: Array) -> WatertightMesh:
    """Weld the corners of faces (F, 3, 3), and divide the faces on whose edges a corner of another face lies.

    Only edges that belong to a single face are divided. A closed mesh has no such edges.
    """
    points_m, point = _welded(corners_m.reshape(-1, 3))
    faces = point.reshape(-1, 3)
    cuts = _cuts(points_m, _open_edges(faces))
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], -1)  # (F, 3, 2): both ends of each edge
    keys = _edge_keys(np.sort(ends, -1), len(points_m))
    is_cut = np.isin(keys, list(cuts)).any(1)

    whole = np.flatnonzero(~is_cut)
    corners = [points_m[faces[whole]]]
    parents = [whole]
    weights = [np.tile(np.eye(3), (len(whole), 1, 1))]
    for face in np.flatnonzero(is_cut):
        part_corners_m, part_weights = _divided(points_m, faces[face], keys[face].tolist(), cuts)
        corners.append(part_corners_m)
        parents.append(np.full(len(part_corners_m), face))
        weights.append(part_weights)
    return WatertightMesh(np.concatenate(corners), np.concatenate(parents), np.concatenate(weights))


def _welded(corners_m: Array) -> tuple[Array, Indices]:
    """Merge corners (N, 3) that are within WELD_M of each other, directly or through others.

    Returns the points (P, 3), each at the position of the first of its corners, and the point (N,) of each corner.
    """
    # Equal corners are merged first, by their bytes. Adding 0 turns -0.0 into 0.0, whose bytes differ.
    rows = np.ascontiguousarray(corners_m + 0.0)
    row_bytes = rows.view(np.dtype((np.void, 24))).ravel()
    _, first_row, distinct = np.unique(row_bytes, return_index=True, return_inverse=True)
    distinct_m = rows[first_row]

    pairs = cKDTree(distinct_m).query_pairs(WELD_M, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(distinct_m), len(distinct_m)))
    point_count, point = connected_components(graph, directed=False)
    earliest_row = np.full(point_count, len(rows))
    np.minimum.at(earliest_row, point, first_row)
    return rows[earliest_row], point[distinct].astype(np.int64)


def _edge_keys(edges: Indices, point_count: int) -> Indices:
    """A number (...) for each edge (..., 2), whose lower point comes first."""
    return np.asarray(edges @ [point_count, 1])


def _open_edges(faces: Indices) -> Indices:
    """The edges (E, 2) that belong to only one of the faces (F, 3). Their lower point comes first.

    A face and its back are one face. Edges of length 0 are omitted.
    """
    sorted_faces = np.sort(faces, 1)
    first_face, _ = distinct_rows(sorted_faces)
    edges = sorted_faces[first_face][:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2)
    first_edge, edge = distinct_rows(edges)
    face_count = np.bincount(edge)
    open_edges = edges[first_edge[face_count == 1]]
    return np.asarray(open_edges[open_edges[:, 0] < open_edges[:, 1]])


def _cuts(points_m: Array, edges: Indices) -> Cuts:
    """The ends of other edges that lie on each of the edges (E, 2), from its start to its end."""
    if not len(edges):
        return {}
    edge, point = _nearby_points(points_m, edges)
    start_m = points_m[edges[:, 0]]
    vector_m = points_m[edges[:, 1]] - points_m[edges[:, 0]]
    length_m = np.linalg.norm(vector_m, axis=1)

    from_start_m = points_m[point] - start_m[edge]
    along_m = np.einsum("ij,ij->i", from_start_m, vector_m[edge]) / length_m[edge]
    share = along_m / length_m[edge]
    from_edge_m = from_start_m - share[:, None] * vector_m[edge]
    distance_m = np.linalg.norm(from_edge_m, axis=1)
    is_between_ends = (along_m > WELD_M) & (along_m < length_m[edge] - WELD_M)
    is_on_edge = (distance_m < WELD_M) & is_between_ends

    # A point near two pieces of an edge is found twice, but belongs to the set once.
    cuts: dict[int, set[tuple[float, int]]] = {}
    keys = _edge_keys(edges, len(points_m))
    for row in np.flatnonzero(is_on_edge):
        key = int(keys[edge[row]])
        cuts.setdefault(key, set()).add((float(share[row]), int(point[row])))
    return {key: sorted(places) for key, places in cuts.items()}


def _nearby_points(points_m: Array, edges: Indices) -> tuple[Indices, Indices]:
    """Pairs of an edge (N,), as a row of `edges` (E, 2), and the end of an edge (N,) that can lie on it."""
    ends = np.unique(edges)
    start_m = points_m[edges[:, 0]]
    vector_m = points_m[edges[:, 1]] - points_m[edges[:, 0]]
    length_m = np.linalg.norm(vector_m, axis=1)

    # The middle of each piece of an edge, and the radius of the ball around it that contains the piece.
    piece_count = np.ceil(length_m / PIECE_M).astype(int)
    edge = np.repeat(np.arange(len(edges)), piece_count)
    first_piece = np.repeat(np.cumsum(piece_count) - piece_count, piece_count)
    piece = np.arange(len(edge)) - first_piece
    middle_share = (piece + 0.5) / piece_count[edge]
    middle_m = start_m[edge] + middle_share[:, None] * vector_m[edge]
    radius_m = length_m[edge] / piece_count[edge] / 2 + WELD_M

    neighbours = cKDTree(points_m[ends]).query_ball_point(middle_m, radius_m)
    neighbour_counts = [len(group) for group in neighbours]
    neighbour = np.concatenate([np.zeros(0, int), *neighbours]).astype(int)
    return np.repeat(edge, neighbour_counts), ends[neighbour]


def _divided(points_m: Array, face: Indices, keys: Sequence[int], cuts: Cuts) -> tuple[Array, Array]:
    """Divide a face (3,) with edges that have the given keys (3,) into a fan around its middle.

    Returns the corners (T, 3, 3) of the triangles, and the weights (T, 3, 3) of the face's corners there.
    """
    outline = list[int]()
    outline_weights = list[Array]()
    corner_weights = np.eye(3)
    for corner, key in enumerate(keys):
        next_corner = (corner + 1) % 3
        start_weights = corner_weights[corner]
        end_weights = corner_weights[next_corner]
        outline.append(int(face[corner]))
        outline_weights.append(start_weights)

        places = cuts.get(key, [])
        if face[corner] >= face[next_corner]:  # the stored direction, from the lower to the higher point, is reversed
            places = [(1 - share, point) for share, point in reversed(places)]
        for share, point in places:
            outline.append(point)
            outline_weights.append((1 - share) * start_weights + share * end_weights)

    outline_m = points_m[outline]
    next_m = np.roll(outline_m, -1, axis=0)
    middle_m = np.broadcast_to(points_m[face].mean(0), outline_m.shape)
    weights = np.array(outline_weights)
    next_weights = np.roll(weights, -1, axis=0)
    middle_weights = np.full_like(weights, 1 / 3)
    return np.stack([outline_m, next_m, middle_m], 1), np.stack([weights, next_weights, middle_weights], 1)
