"""Parts of faces: triangles that are divided along the lines of a grid."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.scene.triangles import Triangles

LEAST_SIDES = 0.25  # the smallest distance of a line from the end of a face that it divides, in sides of a cell
LEAST_SHARE = 1e-9  # the smallest share of the area of a face that is a part
PLANE_AXES = np.array([[1, 2], [0, 2], [0, 1]])  # the other two axes of each axis


@dataclass(frozen=True, slots=True)
class FaceParts:
    """T parts of the faces of a table. A face that is not divided is its only part.

    `parent` (T,) is the face of each part.
    `weights` (T, 3, 3) are the barycentric weights of the parent's corners at each corner of a part.
    """

    parent: Indices
    weights: Array

    @classmethod
    def whole(cls, count: int) -> "FaceParts":
        """Faces that are not divided."""
        return cls(np.arange(count, dtype=np.int32), _whole_weights(count))

    def of(self, faces: Triangles) -> Triangles:
        """The table of the parts of the faces of a table."""
        return replace(
            faces,
            corners_m=self.at_corners(faces.corners_m),
            normals=self.at_corners(faces.normals),
            uv=self.at_corners(faces.uv),
            plane=faces.plane[self.parent],
            thing=faces.thing[self.parent],
            mover=faces.mover[self.parent],
            lamp=faces.lamp[self.parent],
        )

    def at_corners(self, values: Array) -> Array:
        """The values at the corners of the parts (T, 3, C), interpolated between those of the faces (F, 3, C)."""
        return np.asarray(np.einsum("tij,tjk->tik", self.weights, values[self.parent]))

    def with_whole(self, is_whole: Mask) -> tuple["FaceParts", Rows]:
        """Replace the parts of the faces in a mask (F,) by the whole faces, and sort all parts by their face.

        Also returns the former index (T,) of each part, -1 for a whole face.
        """
        whole = np.flatnonzero(is_whole)
        kept = np.flatnonzero(~is_whole[self.parent])
        parent = np.concatenate([whole, self.parent[kept]]).astype(np.int32)
        weights = np.concatenate([_whole_weights(len(whole)), self.weights[kept]])
        former = np.concatenate([np.full(len(whole), -1), kept])
        order = np.argsort(parent, kind="stable")
        return FaceParts(parent[order], weights[order]), former[order]


def _whole_weights(count: int) -> Array:
    """The weights (count, 3, 3) of faces that are not divided."""
    return np.broadcast_to(np.eye(3), (count, 3, 3))


def divided(faces: Triangles, rows: Rows, side_m: Array) -> FaceParts:
    """Divide the faces at rows (N,) along a grid of cubes, whose side `side_m` (F,) depends on the face.

    A face is divided along the two axes that are nearest to its plane. Lines near the ends of a face are skipped.
    """
    is_cut = _are_cut(faces.corners_m[rows], side_m[rows])
    uncut = np.setdiff1d(rows, rows[is_cut])
    parents = [uncut.astype(np.int32)]
    weights = [_whole_weights(len(uncut))]
    for face in rows[is_cut]:
        for polygon in _polygons(faces.corners_m[face], faces.plane[face], float(side_m[face])):
            fan = _fan(polygon)
            parents.append(np.full(len(fan), face, np.int32))
            weights.append(fan)
    return FaceParts(np.concatenate(parents), np.concatenate(weights))


def _are_cut(corners_m: Array, side_m: Array) -> Mask:
    """Whether lines of the grid can divide each of N faces (N, 3, 3)."""
    place = corners_m / side_m[:, None, None]
    first_line = np.ceil(place.min(1) + LEAST_SIDES)
    last_line = np.floor(place.max(1) - LEAST_SIDES)
    return np.asarray((first_line <= last_line).any(1))


def _fan(polygon: Floats) -> Floats:
    """The triangles (T, 3, 3) of a convex polygon (K, 3) that share its first corner, without degenerate ones."""
    first = np.broadcast_to(polygon[0], polygon[1:-1].shape)
    triangles = np.stack([first, polygon[1:-1], polygon[2:]], 1)
    area_share = np.abs(np.linalg.det(triangles))  # of the face, because corners are barycentric weights
    return np.asarray(triangles[area_share > LEAST_SHARE])


def _polygons(corners_m: Array, normal: Array, side_m: float) -> list[Floats]:
    """The parts of a triangle (3, 3) in the cells of a grid.

    Each is a convex polygon (K, 3), whose corners are barycentric weights of the corners of the triangle.
    """
    polygons: list[Floats] = [np.eye(3)]
    for axis in PLANE_AXES[np.abs(normal).argmax()]:
        place = corners_m[:, axis] / side_m  # of each corner along the axis, in cells
        first_line = np.ceil(place.min() + LEAST_SIDES)
        last_line = np.floor(place.max() - LEAST_SIDES)
        for line in np.arange(first_line, last_line + 1):
            halves = [_halves(polygon, polygon @ place - line) for polygon in polygons]
            polygons = [half for pair in halves for half in pair]
    return polygons


def _halves(polygon: Floats, heights: Floats) -> list[Floats]:
    """The parts of a convex polygon (K, 3) on both sides of a line.

    `heights` (K,) are the signed distances of its corners from the line. If all are on one side, the polygon is the
    only part.
    """
    if (heights >= 0).all() or (heights <= 0).all():
        return [polygon]
    below = []
    above = []
    for nth, height in enumerate(heights):
        corner = polygon[nth]
        if height <= 0:
            below.append(corner)
        if height >= 0:
            above.append(corner)

        following = (nth + 1) % len(heights)
        following_height = heights[following]
        if height * following_height < 0:
            share = height / (height - following_height)
            crossing = (1 - share) * corner + share * polygon[following]
            below.append(crossing)
            above.append(crossing)
    return [np.array(below), np.array(above)]
