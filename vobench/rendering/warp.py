"""Lenses other than pinholes: pinhole faces around the camera, and the map from their pixels to the lens's.

Each pixel is the mean of 2 x 2 points, each interpolated between the pixels of one face, which are as fine as the
points. Faces overlap by a margin, so that no interpolation crosses a seam; only what the lens sees is drawn.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.renderer import Radiance
from vobench.rendering.view import Box

POINTS = 2  # each way in a pixel
MARGIN_PX = 3
# Beyond this angle from the axis a single face would spend most of its pixels on its rim.
ONE_FACE_RAD = np.deg2rad(65)
NOWHERE = -100.0
NO_SPAN = (1, 0, 1, 0)
# Columns: the x, y and z axes of each face in the camera's: ahead, right, left, below, above, behind.
FACES = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
    ],
    float,
)


@dataclass(frozen=True, slots=True)
class Face:
    """A pinhole turned by R_camera_face (3, 3), whose picture lies in the atlas from `row` on.

    spans (R, 4): first and end column, first and end row that each row of points needs; empty where first >= end.
    """

    camera: Pinhole
    R_camera_face: Array
    row: int
    spans: NDArray[np.int32]

    def needed_for(self, rows: slice) -> Box | None:
        """The box of its picture that rows of the lens's picture need, None for nothing."""
        spans = self.spans[rows.start * POINTS : rows.stop * POINTS]
        spans = spans[spans[:, 0] < spans[:, 1]]
        if len(spans) == 0:
            return None
        first = spans.min(0).tolist()
        end = spans.max(0).tolist()
        return first[0], end[1], first[2], end[3]


@dataclass(frozen=True, slots=True)
class Warp:
    """Faces, and where in their atlas each point lies: at_column, at_row (2 H, 2 W)."""

    faces: tuple[Face, ...]
    at_column: Radiance
    at_row: Radiance

    def blank(self, channels: int) -> Radiance:
        """An empty atlas (rows, columns), of three channels (rows, columns, 3)."""
        cameras = [face.camera for face in self.faces]
        rows = sum(camera.height_px for camera in cameras)
        columns = max(camera.width_px for camera in cameras)
        shape = (rows, columns) if channels == 1 else (rows, columns, channels)
        return np.zeros(shape, np.float32)

    def put(
        self,
        atlas: Radiance,
        face: Face,
        box: Box,
        picture: Radiance,
    ) -> None:
        """Lay a box of a face's picture into the atlas."""
        first, end, top, bottom = box
        atlas[face.row + top : face.row + bottom, first:end] = picture

    def picture(self, atlas: Radiance, rows: slice) -> Radiance:
        """Rows of the lens's picture (rows, W) or (rows, W, 3); black where it has no rays."""
        points = slice(rows.start * POINTS, rows.stop * POINTS)
        at_column = self.at_column[points]
        at_row = self.at_row[points]
        mapped = cv2.remap(atlas, at_column, at_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        size = (mapped.shape[1] // POINTS, mapped.shape[0] // POINTS)
        return np.asarray(cv2.resize(mapped, size, interpolation=cv2.INTER_AREA), np.float32)


def warp(camera: Camera) -> Warp:
    """The faces a lens needs, and the map from them."""
    face_of, plane = _faces(_rays(camera))
    focal_px = _focal_px(plane, face_of, np.diag(camera.K)[:2])
    pixels = np.moveaxis((plane * focal_px).astype(np.float32), -1, 0)
    columns, rows = pixels
    faces = []
    first_row = 0  # of a face in the atlas
    at_column = np.full_like(columns, NOWHERE)
    at_row = np.full_like(rows, NOWHERE)
    for index in np.unique(face_of[face_of >= 0]):
        is_member = face_of == index
        face = _face(pixels, is_member, FACES[index], first_row, focal_px=focal_px)
        column_offset = face.camera.cx_px
        row_offset = face.camera.cy_px + first_row
        np.copyto(at_column, columns + column_offset, where=is_member, casting="same_kind")
        np.copyto(at_row, rows + row_offset, where=is_member, casting="same_kind")
        faces.append(face)
        first_row += face.camera.height_px
    return Warp(tuple(faces), at_column, at_row)


def _rays(camera: Camera) -> Array:
    """Unit directions (2 H, 2 W, 3) of all points."""
    size = (camera.height_px * POINTS, camera.width_px * POINTS)
    v, u = np.indices(size) + 0.5
    uv_px = np.stack([u, v], -1) / POINTS - 0.5
    return np.asarray(camera.rays(uv_px))


def _faces(rays: Array) -> tuple[NDArray[np.int8], Array]:
    """Which face each ray (R, C, 3) belongs to, -1 for none, and where it meets that face's plane z = 1 (R, C, 2)."""
    has_no_ray = np.isnan(rays[..., 2])
    fits_one_face = rays[..., 2] > np.cos(ONE_FACE_RAD)
    if np.all(has_no_ray | fits_one_face):
        face_of = np.where(has_no_ray, -1, 0).astype(np.int8)
        return face_of, np.nan_to_num(rays[..., :2] / rays[..., 2:])
    face_of = np.full(has_no_ray.shape, -1, np.int8)
    plane = np.zeros((*has_no_ray.shape, 2))
    best = np.zeros(has_no_ray.shape)
    for index, axes in enumerate(FACES):
        along = rays @ axes[:, 2]
        is_nearer = along > best  # false where there is no ray
        face_of[is_nearer] = index
        best[is_nearer] = along[is_nearer]
        plane[is_nearer] = (rays[is_nearer] @ axes[:, :2]) / along[is_nearer, None]
    return face_of, plane


def _focal_px(
    plane: Array,
    face_of: NDArray[np.int8],
    focal_lengths: Array,
) -> float:
    """Focal length of faces as fine as the points are where they are finest, in the lens's finer direction."""
    # Every third point along rows and columns, and those next to it.
    here = (slice(0, -1, 3), slice(0, -1, 3))
    right = (slice(0, -1, 3), slice(1, None, 3))
    down = (slice(1, None, 3), slice(0, -1, 3))
    has_same_right = face_of[here] == face_of[right]
    has_same_down = face_of[here] == face_of[down]
    is_within = (face_of[here] >= 0) & has_same_right & has_same_down
    step_right = (plane[right] - plane[here])[is_within]
    step_down = (plane[down] - plane[here])[is_within]
    lengths = np.sort([np.hypot(*step_right.T), np.hypot(*step_down.T)], 0)
    # Towards a fisheye's rim and a full sphere's poles, points lie close along one direction without showing more.
    finest = lengths[1].min()
    return float(focal_lengths.max() / focal_lengths.min() / finest)


def _face(
    pixels: Radiance,
    is_member: NDArray[np.bool_],
    axes: Array,
    row: int,
    *,
    focal_px: float,
) -> Face:
    """The face that holds its members of all pixels (2, R, C), which count from its axis."""
    low = np.floor(np.where(is_member, pixels, np.inf).min(2))  # (2, R): of each row of points
    high = np.ceil(np.where(is_member, pixels, -np.inf).max(2))
    cx, cy = (MARGIN_PX - low.min(1)).tolist()
    size = high.max(1) - low.min(1) + 2 * MARGIN_PX + 1
    width, height = size.astype(int).tolist()
    first_column = low[0] + cx - 1
    end_column = high[0] + cx + 2
    first_row = low[1] + cy - 1
    end_row = high[1] + cy + 2
    spans = np.stack([first_column, end_column, first_row, end_row], -1)
    has_members = np.any(is_member, axis=1, keepdims=True)
    spans = np.where(has_members, spans, NO_SPAN)
    return Face(Pinhole(width, height, focal_px, focal_px, cx, cy), axes, row, spans.astype(np.int32))
