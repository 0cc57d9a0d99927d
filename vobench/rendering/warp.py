"""Pictures of lenses that are not pinholes: pinhole pictures in several directions, the faces, are drawn and warped.

A pixel of the lens is the mean of 2 x 2 points. Each point is interpolated between the pixels of one face, whose
resolution is that of the points. Faces overlap by a margin, so that no interpolation crosses a seam. Only the parts of
faces that the lens sees are drawn.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.renderer import Radiance
from vobench.rendering.view import Box

POINTS = 2  # the number of points along each side of a pixel
MARGIN_PX = 3  # by which faces overlap
ONE_FACE_RAD = np.deg2rad(
    65
)  # a single face is used up to this angle; beyond it, most of its pixels would be at its rim
NOWHERE = -100.0  # the place in the atlas of points without a ray
NO_SPAN = (1, 0, 1, 0)  # an empty span of columns and rows

# The x, y and z axes of each face in the camera frame, as columns: ahead, right, left, below, above, behind.
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
    """A pinhole camera with the orientation R_camera_face (3, 3). Its picture begins at `row` in the atlas.

    `spans` (R, 4) are the pixels that each row of points needs: first and end column, first and end row. A span is
    empty if the first is not less than the end.
    """

    camera: Pinhole
    R_camera_face: Array
    row: int
    spans: NDArray[np.int32]

    def needed_for(self, rows: slice) -> Box | None:
        """The box in the face's picture that rows of the lens's picture need; None if they need nothing."""
        spans = self.spans[rows.start * POINTS : rows.stop * POINTS]
        spans = spans[spans[:, 0] < spans[:, 1]]
        if len(spans) == 0:
            return None
        first = spans.min(0).tolist()
        end = spans.max(0).tolist()
        return first[0], end[1], first[2], end[3]


@dataclass(frozen=True, slots=True)
class Warp:
    """The faces of a lens, and the place of each point in the atlas of their pictures: at_column, at_row (2 H, 2 W)."""

    faces: tuple[Face, ...]
    at_column: Radiance
    at_row: Radiance

    def blank(self, channels: int) -> Radiance:
        """An empty atlas: (rows, columns) for one channel, otherwise (rows, columns, channels)."""
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
        """Copy a box of a face's picture to the atlas."""
        first, end, top, bottom = box
        atlas[face.row + top : face.row + bottom, first:end] = picture

    def picture(self, atlas: Radiance, rows: slice) -> Radiance:
        """Rows of the lens's picture (rows, W) or (rows, W, 3). Pixels without rays are black."""
        points = slice(rows.start * POINTS, rows.stop * POINTS)
        at_column = self.at_column[points]
        at_row = self.at_row[points]
        mapped = cv2.remap(atlas, at_column, at_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        size = (mapped.shape[1] // POINTS, mapped.shape[0] // POINTS)
        return np.asarray(cv2.resize(mapped, size, interpolation=cv2.INTER_AREA), np.float32)


def warp(camera: Camera) -> Warp:
    """The faces that a lens needs, and the map from them to its picture."""
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
    """The unit directions (2 H, 2 W, 3) of all points."""
    size = (camera.height_px * POINTS, camera.width_px * POINTS)
    v, u = np.indices(size) + 0.5
    uv_px = np.stack([u, v], -1) / POINTS - 0.5
    return np.asarray(camera.rays(uv_px))


def _faces(rays: Array) -> tuple[NDArray[np.int8], Array]:
    """The face of each ray (R, C, 3), -1 for none, and its intersection (R, C, 2) with the plane z = 1 of the face."""
    has_no_ray = np.isnan(rays[..., 2])
    fits_one_face = rays[..., 2] > np.cos(ONE_FACE_RAD)
    if np.all(has_no_ray | fits_one_face):
        face_of = np.where(has_no_ray, -1, 0).astype(np.int8)
        return face_of, np.nan_to_num(rays[..., :2] / rays[..., 2:])
    face_of = np.full(has_no_ray.shape, -1, np.int8)
    plane = np.zeros((*has_no_ray.shape, 2))
    largest_cosine = np.zeros(has_no_ray.shape)
    for index, axes in enumerate(FACES):
        cosine = rays @ axes[:, 2]
        is_nearer = cosine > largest_cosine  # false without a ray
        face_of[is_nearer] = index
        largest_cosine[is_nearer] = cosine[is_nearer]
        plane[is_nearer] = (rays[is_nearer] @ axes[:, :2]) / cosine[is_nearer, None]
    return face_of, plane


def _focal_px(
    plane: Array,
    face_of: NDArray[np.int8],
    focal_lengths: Array,
) -> float:
    """The focal length of faces whose resolution is the finest of the points, in the finer direction of the lens."""
    # Every third point along rows and columns, and its neighbours to the right and below.
    here = (slice(0, -1, 3), slice(0, -1, 3))
    right = (slice(0, -1, 3), slice(1, None, 3))
    down = (slice(1, None, 3), slice(0, -1, 3))
    has_same_right = face_of[here] == face_of[right]
    has_same_down = face_of[here] == face_of[down]
    is_within = (face_of[here] >= 0) & has_same_right & has_same_down
    step_right = (plane[right] - plane[here])[is_within]
    step_down = (plane[down] - plane[here])[is_within]
    lengths = np.sort([np.hypot(*step_right.T), np.hypot(*step_down.T)], 0)
    # Near the rim of a fisheye and the poles of a sphere, points are close in one direction without showing more.
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
    """The face that contains its members (R, C) of all points. Their pixels (2, R, C) are relative to its axis."""
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
