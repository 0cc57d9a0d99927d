"""Pairs of faces that are back to back: the two sides of a sheet."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Indices
from vobench.rendering.dot_product import dot
from vobench.scene.triangles import Triangles


def back_faces(faces: Triangles) -> Indices:
    """The back (F + 1,) of each face: a face of the same thing with the same corners and the opposite normal.

    It is -1 if there is none. The last entry, -1, is that of the face -1.
    """
    corners_m = faces.corners_m.reshape(-1, 3)
    corner_ids = _ids_of_rows(corners_m).reshape(-1, 3)
    corner_sets = np.sort(corner_ids, axis=1)  # faces with the same corners have the same row
    key = _ids_of_rows(np.column_stack([corner_sets, faces.thing]))
    order = np.argsort(key, kind="stable")
    first = order[:-1]
    second = order[1:]
    cosine = dot(faces.plane[first], faces.plane[second])
    is_pair = (key[first] == key[second]) & (cosine < 0)
    is_pair[1:] &= ~is_pair[:-1]  # a face is in one pair at most
    back = np.full(len(faces) + 1, -1, np.int32)
    back[first[is_pair]] = second[is_pair]
    back[second[is_pair]] = first[is_pair]
    return back


def _ids_of_rows(rows: NDArray[Any]) -> NDArray[np.int64]:
    """A number (N,) for each row (N, K). The numbers of two rows are equal if and only if the rows are equal."""
    order = np.lexsort(rows.T)
    is_new = (np.diff(rows[order], axis=0) != 0).any(1)
    ids = np.zeros(len(rows), np.int64)
    ids[order[1:]] = np.cumsum(is_new)
    return ids
