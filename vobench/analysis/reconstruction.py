"""The place of a recording, rebuilt from its own images: a textured mesh that emits the light that was recorded.

Each keyframe becomes a surface: a grid of its pixels at their depths. Keyframes that see things from near come first,
and each adds what those before it do not show. Surfaces emit the light of the images and reflect none, so a camera at
the pose of a keyframe records its image again.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise
from math import ceil, sqrt

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.analysis.keyframe_depth import Keyframe, ViewGeometry, seen_from
from vobench.asset.luminous_model import Surface
from vobench.geometry.se3 import Array, apply, inverse
from vobench.rendering.array_types import Mask

GRID_SHARE = 1 / 200  # of the width, between vertices, unless there are more than MOST_FACES
MOST_FACES = 600_000
BACKDROP_SPACINGS = 8  # between vertices of the backdrop, in those of the other surfaces
MARGIN_SHARE = 0.08  # of the width, by which images are extended on all sides
SAME_PX = 1.0  # of disparity; surfaces that differ by less in this or in depth are the same
SAME_RATIO = 0.05  # of depth
IN_FRONT_PX = 2.0  # of disparity, by which a surface is in front of what another keyframe sees there
IN_FRONT_RATIO = 0.1  # of depth, likewise
SMOOTH_PX = 5  # the side of the windows whose means are compared
ALIKE_DN = 25.0  # largest difference of these means for the same surface
VOTERS = 40  # keyframes before and after that are asked whether they see a surface, too
FARTHER = 0.5  # the inverse depth of the backdrop, in that of the farthest points
EDGE_PX = 1.0  # of disparity between the corners of a quad that is at a depth edge
EDGE_RATIO = 0.08  # of depth, likewise


def reconstruct(keyframes: Sequence[Keyframe], geometry: ViewGeometry) -> list[Surface]:
    """The surfaces that keyframes show, each with the image of one of them as its texture.

    Quads that most keyframes contradict are shown only where nothing else is. Behind everything, far away, are the
    images once more, so that gaps are not black.
    """
    spacing_px = max(round(GRID_SHARE * geometry.width_px), 1)
    while True:
        surfaces = list(_surfaces(keyframes, geometry, spacing_px))
        faces = sum(len(surface.faces) for surface in surfaces)
        if faces <= MOST_FACES:
            return surfaces
        spacing_px = ceil(spacing_px * sqrt(faces / MOST_FACES))


def _surfaces(keyframes: Sequence[Keyframe], geometry: ViewGeometry, spacing_px: int) -> Iterator[Surface]:
    """The surfaces whose vertices have a distance in the images."""
    margin_px = round(MARGIN_SHARE * geometry.width_px)
    wide_geometry = _extended_geometry(geometry, margin_px)
    wide = [_extended(keyframe, margin_px) for keyframe in keyframes]
    order = _nearest_views_first(keyframes)
    mosaic = _Mosaic(wide, wide_geometry, order, spacing_px=spacing_px)
    mosaic.add(ImagePart.IMAGES, rejects_outvoted=True)
    mosaic.add(ImagePart.MARGINS, rejects_outvoted=True)
    mosaic.add(ImagePart.IMAGES)
    yield from mosaic.surfaces()

    far_rho = FARTHER * geometry.least_rho
    far = [replace(keyframe, rho=np.broadcast_to(far_rho, keyframe.rho.shape)) for keyframe in wide]
    backdrop = _Mosaic(far, wide_geometry, order, spacing_px=BACKDROP_SPACINGS * spacing_px)
    backdrop.add(ImagePart.IMAGES)
    backdrop.add(ImagePart.MARGINS)
    yield from backdrop.surfaces()


class ImagePart(Enum):
    """What cameras recorded, or the margins around it."""

    IMAGES = 0
    MARGINS = 1


class _Mosaic:
    """Surfaces that are put together from quads of keyframes, none of which shows what is shown already."""

    def __init__(
        self,
        keyframes: Sequence[Keyframe],
        geometry: ViewGeometry,
        order: Sequence[int],
        *,
        spacing_px: int,
    ) -> None:
        self._keyframes = list(keyframes)
        self._geometry = geometry
        self._order = order
        self._sheets = [_sheet(keyframe, geometry, spacing_px) for keyframe in keyframes]
        self._smooth = [cv2.blur(keyframe.image.astype(np.float32), (SMOOTH_PX, SMOOTH_PX)) for keyframe in keyframes]
        self._shown = [np.zeros(sheet.shape, bool) for sheet in self._sheets]

    def add(self, part: ImagePart, *, rejects_outvoted: bool = False) -> None:
        """Add the quads of a part of all keyframes that are not shown yet."""
        for index in self._order:
            is_recorded = self._geometry.records(self._sheets[index].centre_px)
            is_candidate = (is_recorded if part is ImagePart.IMAGES else ~is_recorded) & ~self._shown[index]
            if rejects_outvoted:
                is_candidate &= ~self._outvoted(index, is_candidate)
            if is_candidate.any():
                self._shown[index] |= is_candidate & ~self._covered(index, is_candidate)

    def surfaces(self) -> Iterator[Surface]:
        """The surfaces of all quads that are shown."""
        for sheet, is_shown, keyframe in zip(self._sheets, self._shown, self._keyframes, strict=True):
            if is_shown.any():
                yield _surface(sheet, is_shown, keyframe, self._geometry)

    def _covered(self, index: int, is_candidate: Mask) -> Mask:
        """Whether candidates of the quads of a sheet, and those around them, are surfaces that others show already."""
        pixels, rho = self._sheets[index].centres(is_candidate)
        uncovered = np.arange(len(rho))
        nearest_first = sorted(range(len(self._shown)), key=lambda other: abs(other - index))
        for other in nearest_first[1:]:
            shown = self._shown[other]
            if not len(uncovered) or not shown.any():
                continue
            view = self._viewed(index, other, pixels[uncovered], rho[uncovered])
            rows, columns = _quads_at(view.pixels, self._sheets[other])
            is_covered = view.is_seen & view.is_same & shown[rows, columns]
            uncovered = uncovered[~is_covered]
        covered_candidates = np.ones(len(rho), bool)
        covered_candidates[uncovered] = False
        covered = np.ones(is_candidate.shape, bool)
        covered[is_candidate] = covered_candidates
        # Quads at the rim of what is covered are shown, so that no gap remains.
        return np.asarray(scipy.ndimage.binary_erosion(covered, np.ones((3, 3), bool), border_value=1), bool)

    def _outvoted(self, index: int, is_candidate: Mask) -> Mask:
        """Whether most keyframes see something behind candidates of the quads, or something else at their place."""
        pixels, rho = self._sheets[index].centres(is_candidate)
        balance = np.ones(len(rho), int)  # its own keyframe sees it
        for other in range(max(index - VOTERS, 0), min(index + VOTERS + 1, len(self._keyframes))):
            if other == index:
                continue
            view = self._viewed(index, other, pixels, rho)
            is_in_image = view.is_seen & self._geometry.records(view.pixels)
            balance += is_in_image & view.is_same & view.is_alike
            balance -= is_in_image & view.is_same & ~view.is_alike
            balance -= is_in_image & view.is_in_front
        outvoted = np.zeros(is_candidate.shape, bool)
        outvoted[is_candidate] = balance < 0
        return outvoted

    def _viewed(self, index: int, other: int, pixels: Array, rho: Array) -> "_View":
        """The quads of a keyframe with centres at pixels (Q, 2) and inverse depths (Q,), as another one sees them."""
        geometry = self._geometry
        seen_px, depth_m = seen_from(self._keyframes[other], self._keyframes[index], pixels, rho, geometry)
        is_seen = geometry.contains(seen_px)
        seen_px = np.where(is_seen[:, None], seen_px, 0.0)
        own_rho = np.where(is_seen, 1 / depth_m, np.nan)

        columns, rows = seen_px.round().astype(int).T
        other_rho = self._keyframes[other].rho[rows, columns]
        same = np.maximum(SAME_PX * geometry.rho_of_px, SAME_RATIO * other_rho)
        in_front = np.maximum(IN_FRONT_PX * geometry.rho_of_px, IN_FRONT_RATIO * other_rho)
        with np.errstate(invalid="ignore"):
            is_same = np.abs(own_rho - other_rho) <= same
            is_in_front = own_rho - other_rho > in_front
        own_columns, own_rows = pixels.round().astype(int).T
        difference_dn = self._smooth[index][own_rows, own_columns] - self._smooth[other][rows, columns]
        is_alike = np.abs(difference_dn) <= ALIKE_DN
        return _View(seen_px, is_seen, is_same, is_in_front, is_alike)


def _nearest_views_first(keyframes: Sequence[Keyframe]) -> list[int]:
    """The order of keyframes: a camera that moves forward sees things from near before they leave its view."""
    forward_m = 0.0
    for before, after in pairwise(keyframes):
        T_before_after = inverse(before.T_world_view) @ after.T_world_view
        forward_m += float(T_before_after[2, 3])
    order = list(range(len(keyframes)))
    return order[::-1] if forward_m >= 0 else order


# --- Margins: what is just outside of an image may be seen from other places ---


def _extended(keyframe: Keyframe, margin_px: int) -> Keyframe:
    """A keyframe whose image is mirrored at its edges, at the depth of these."""
    sides = (margin_px,) * 4
    image = cv2.copyMakeBorder(keyframe.image, *sides, cv2.BORDER_REFLECT_101).astype(np.uint8, copy=False)
    rho = np.pad(keyframe.rho, margin_px, mode="edge")
    return replace(keyframe, image=image, rho=rho)


def _extended_geometry(geometry: ViewGeometry, margin_px: int) -> ViewGeometry:
    K = geometry.K.copy()
    K[:2, 2] += margin_px
    return replace(
        geometry,
        K=K,
        width_px=geometry.width_px + 2 * margin_px,
        height_px=geometry.height_px + 2 * margin_px,
        is_recorded=np.pad(geometry.is_recorded, margin_px),
    )


# --- Sheets ---


@dataclass(frozen=True, slots=True)
class _Sheet:
    """The quads of a keyframe: `rows` (R,) and `columns` (C,) are the pixels of its grid.

    `corner_rho` (R - 1, C - 1, 4) are the inverse depths of the corners of quads, row by row. Quads at a depth edge
    are at the farther depth.
    """

    rows: Array
    columns: Array
    corner_rho: Array

    @property
    def shape(self) -> tuple[int, int]:
        """The numbers of rows and columns of quads."""
        rows, columns, _ = self.corner_rho.shape
        return rows, columns

    @property
    def centre_px(self) -> Array:
        """The pixels (R - 1, C - 1, 2) of the centres of quads."""
        middle_rows = (self.rows[1:] + self.rows[:-1]) / 2
        middle_columns = (self.columns[1:] + self.columns[:-1]) / 2
        columns, rows = np.meshgrid(middle_columns, middle_rows)
        return np.stack([columns, rows], -1)

    def centres(self, is_chosen: Mask) -> tuple[Array, Array]:
        """The pixels (Q, 2) and the inverse depths (Q,) of the centres of chosen quads (R - 1, C - 1)."""
        return self.centre_px[is_chosen], self.corner_rho[is_chosen].mean(-1)


def _sheet(keyframe: Keyframe, geometry: ViewGeometry, spacing_px: int) -> _Sheet:
    rows = _grid_lines(geometry.height_px, spacing_px)
    columns = _grid_lines(geometry.width_px, spacing_px)
    rho = keyframe.rho[np.ix_(rows, columns)]
    corners = np.stack([rho[:-1, :-1], rho[:-1, 1:], rho[1:, :-1], rho[1:, 1:]], -1)
    least = corners.min(-1)
    largest = corners.max(-1)
    is_edge = (largest - least > EDGE_PX * geometry.rho_of_px) & (largest > (1 + EDGE_RATIO) * least)
    corner_rho = np.where(is_edge[..., None], least[..., None], corners)
    return _Sheet(rows.astype(float), columns.astype(float), corner_rho)


def _grid_lines(size_px: int, spacing_px: int) -> NDArray[np.int64]:
    return np.unique(np.append(np.arange(0, size_px, spacing_px), size_px - 1))


# --- What others see ---


@dataclass(frozen=True, slots=True)
class _View:
    """The quads of a sheet as another keyframe sees them: the pixels (Q, 2) of their centres there.

    Quads outside of it are not seen, and have the pixel 0, 0.
    """

    pixels: Array
    is_seen: Mask
    is_same: Mask
    is_in_front: Mask
    is_alike: Mask


def _quads_at(pixels: Array, sheet: _Sheet) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The rows and columns (Q,) of the quads of a sheet that contain pixels (Q, 2)."""
    rows = np.clip(np.searchsorted(sheet.rows, pixels[:, 1], side="right") - 1, 0, len(sheet.rows) - 2)
    columns = np.clip(np.searchsorted(sheet.columns, pixels[:, 0], side="right") - 1, 0, len(sheet.columns) - 2)
    return rows.astype(np.int64), columns.astype(np.int64)


# --- Meshes ---


def _surface(sheet: _Sheet, is_shown: Mask, keyframe: Keyframe, geometry: ViewGeometry) -> Surface:
    """The shown quads of a sheet, in the world. No two of them share vertices."""
    quad_rows, quad_columns = np.nonzero(is_shown)
    corners = [(0, 0), (0, 1), (1, 0), (1, 1)]
    pixels = np.stack(
        [
            np.stack([sheet.columns[quad_columns + right], sheet.rows[quad_rows + below]], -1)
            for below, right in corners
        ],
        axis=1,
    )  # (Q, 4, 2)
    rho = sheet.corner_rho[quad_rows, quad_columns]  # (Q, 4)
    points_m = geometry.rays(pixels) / rho[..., None]
    vertices_m = apply(keyframe.T_world_view, points_m).reshape(-1, 3)
    uv = (pixels.reshape(-1, 2) + 0.5) / [geometry.width_px, geometry.height_px]
    first = 4 * np.arange(len(quad_rows))[:, None]
    upper = first + np.array([0, 2, 1])  # counter-clockwise as seen from the camera, with y down
    lower = first + np.array([1, 2, 3])
    faces = np.concatenate([upper, lower])
    return Surface(vertices_m, uv, faces.astype(np.int64), keyframe.image)
