"""Planes that contain a large area of faces, as rectangles divided into cells, for shadows that are known per cell."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.geometry import tangents

MIN_AREA_M2 = 0.5  # of the faces in a plane that is worth a grid
MAX_CELLS = 300_000  # of one grid
MIN_CELL_M = 0.02
SAME_PLANE_M = 1e-6  # a face whose corners are farther from a plane does not belong to it
KEY_DIGITS = 6  # to which normals and offsets of planes are rounded, to find the faces in the same plane


@dataclass(frozen=True, slots=True)
class ReceiverPlane:
    """A rectangle of H x W cells in a plane that contains faces of the scene.

    `origin_m` (3,) is the corner of the first cell. `u_axis` and `v_axis` (3,) are unit vectors: the column of a cell
    counts along `u_axis`, its row along `v_axis`. The rectangle is a little in front of the faces, where their shadow
    rays start.
    """

    origin_m: Array
    u_axis: Array
    v_axis: Array
    normal: Array
    cell_m: float
    height: int
    width: int

    def cell(self, points_m: Floats) -> Rows:
        """The index of the cell (P,) of each point (P, 3), or H·W outside the rectangle."""
        column, is_column = _cell_along(points_m, self.u_axis, self.width, self)
        row, is_row = _cell_along(points_m, self.v_axis, self.height, self)
        cell = row * self.width + column
        cell[~(is_column & is_row)] = self.height * self.width
        return cell

    def heights_m(self, points_m: Array) -> Array:
        """The heights (...) of points (..., 3) above the plane."""
        return np.asarray((points_m - self.origin_m) @ self.normal)

    def coordinates_m(self, points_m: Array) -> Array:
        """The coordinates (..., 2) of points (..., 3) along columns and rows."""
        axes = np.stack([self.u_axis, self.v_axis], -1)
        return np.asarray((points_m - self.origin_m) @ axes)


def _cell_along(points_m: Floats, axis: Array, count: int, plane: ReceiverPlane) -> tuple[Rows, Mask]:
    """The column or row (P,) of points (P, 3) along an axis of a plane, and whether it is one of the `count` cells."""
    scaled_axis = (axis / plane.cell_m).astype(np.float32)
    first = np.float32(axis @ plane.origin_m / plane.cell_m)
    position = points_m @ scaled_axis - first
    is_inside = (position >= 0) & (position < count)
    return position.astype(np.int64), is_inside


def large_planes(
    corners_m: Array,
    normals: Array,
    selected: Mask,
    lift_m: float,
) -> tuple[list[ReceiverPlane], Indices]:
    """The planes with a large area of selected faces (F,), and the index (F + 1,) of each face's plane, -1 for none.

    `corners_m` (F, 3, 3) and `normals` (F, 3) are those of all faces. The rectangles are `lift_m` in front of
    the faces.
    """
    face_plane = np.full(len(corners_m) + 1, -1, np.int32)
    faces = np.flatnonzero(selected)
    areas_m2 = _areas_m2(corners_m[faces])

    # Faces with the same rounded normal and offset are candidates for the same plane.
    offsets_m = np.einsum("fj,fj->f", normals[faces], corners_m[faces, 0])
    keys = np.round(np.column_stack([normals[faces], offsets_m]), KEY_DIGITS)
    keys += 0.0  # turns negative zeros into zeros
    _, candidate_of_face = np.unique(keys, axis=0, return_inverse=True)
    candidate_of_face = candidate_of_face.reshape(-1)
    candidate_areas_m2 = np.bincount(candidate_of_face, areas_m2)

    planes: list[ReceiverPlane] = []
    for candidate in np.flatnonzero(candidate_areas_m2 >= MIN_AREA_M2):
        members = faces[candidate_of_face == candidate]
        plane = _plane(corners_m[members], normals[members[0]], lift_m)
        distances_m = np.abs(plane.heights_m(corners_m[members]) + lift_m).max(1)
        face_plane[members[distances_m <= SAME_PLANE_M]] = len(planes)
        planes.append(plane)
    return planes, face_plane


def _areas_m2(corners_m: Array) -> Array:
    """The areas (F,) of faces (F, 3, 3)."""
    edges_m = corners_m[:, 1:] - corners_m[:, :1]
    normals_m2 = np.cross(edges_m[:, 0], edges_m[:, 1])
    return np.asarray(np.linalg.norm(normals_m2, axis=1) / 2)


def _plane(corners_m: Array, normal: Array, lift_m: float) -> ReceiverPlane:
    """The rectangle around faces (F, 3, 3) that lie in one plane."""
    u_axes, v_axes = tangents(normal[None])
    u_axis = u_axes[0]
    v_axis = v_axes[0]
    points_m = corners_m.reshape(-1, 3)
    in_plane_m = points_m @ np.stack([u_axis, v_axis], -1)  # (N, 2)
    low_m = in_plane_m.min(0)
    size_m = np.ptp(in_plane_m, axis=0)

    cell_m = max(MIN_CELL_M, float(np.sqrt(np.prod(size_m) / MAX_CELLS)))
    width, height = (np.ceil(size_m / cell_m).astype(int) + 1).tolist()
    offset_m = normal @ points_m[0] + lift_m
    return ReceiverPlane(
        origin_m=low_m[0] * u_axis + low_m[1] * v_axis + offset_m * normal,
        u_axis=u_axis,
        v_axis=v_axis,
        normal=normal,
        cell_m=cell_m,
        height=height,
        width=width,
    )
