"""Welding: merging vertices at the same position, and what the welded faces then share.

No function here modifies its arguments.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.scene.mesh_arrays import MeshArrays

# The size of the grid cells in which vertices are merged. At 10 m, float32 numbers are about 1e-6 m apart.
WELD_M = 1e-5


class DistinctRows(NamedTuple):
    """The distinct rows of an array of N rows, in lexicographic order, as `np.unique` describes them.

    `first_index` (G,) is the index of the first occurrence of each distinct row.
    `inverse` (N,) is, for each row, the index of the distinct row that it equals.
    """

    first_index: NDArray[np.int64]
    inverse: NDArray[np.int64]


def distinct_rows(rows: NDArray[Any]) -> DistinctRows:
    """The distinct rows of an array (N, K)."""
    order = np.lexsort(rows.T[::-1])  # stable, and much faster than np.unique
    sorted_rows = rows[order]
    differs_from_previous = (np.diff(sorted_rows, axis=0) != 0).any(1)
    is_first = np.append(True, differs_from_previous)[: len(rows)]  # the slice removes the first element if N = 0
    sorted_inverse = np.cumsum(is_first) - 1
    return DistinctRows(first_index=order[is_first], inverse=sorted_inverse[np.argsort(order)])


def welded(points_m: Array) -> DistinctRows:
    """Merge points (N, 3) that are in the same grid cell of size WELD_M; a distinct row is an occupied cell."""
    cells = np.rint(points_m / WELD_M).astype(np.int64)
    return distinct_rows(cells)


def open_edges(faces: NDArray[Any]) -> NDArray[np.int64]:
    """The edges (E, 2) that belong to only one of the faces (F, 3)."""
    from trimesh.geometry import faces_to_edges
    from trimesh.grouping import group_rows

    edges = np.sort(faces_to_edges(faces), axis=1)  # type: ignore[no-untyped-call]
    open_rows = group_rows(edges, require_count=1)  # type: ignore[no-untyped-call]
    return np.asarray(edges[open_rows], np.int64)


def is_closed_body(mesh: MeshArrays) -> bool:
    """Whether a mesh, with its vertices welded, encloses a volume and has its front faces outside."""
    from trimesh import Trimesh

    vertices = welded(mesh.vertices_m)
    faces = vertices.inverse[mesh.faces]
    has_distinct_corners = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    body = Trimesh(mesh.vertices_m[vertices.first_index], faces[has_distinct_corners], process=False, use_embree=False)
    return bool(body.is_volume)
