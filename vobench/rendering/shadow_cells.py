"""Shadows of stationary lamps that are known for the cells of large planes, so that no shadow ray is needed there.

All occluding triangles are projected from the lamp onto a plane, and drawn into its grid of cells with a margin for
rounding. No point of a cell that no triangle touches is in shadow. All points of a cell that one triangle covers are in
shadow. In all other cells, shadow rays decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.lamp import Bits, Lamp
from vobench.rendering.occlusion import Occluders
from vobench.rendering.receiver_plane import ReceiverPlane
from vobench.rendering.shadow_raster import ProjectedTriangles, lamp_projection

# A ray of Embree deviates from its line by less than this share of the largest coordinate, about 40 float32 steps.
RAY_ERROR = 4e-6
CONE_ERROR_M = 1e-3  # more than float32 rounding in the test of whether a point is in a cone
WITHIN_LAMP = 1 + 1e-9  # radii of a lamp, with a margin for rounding, in which nothing can hide it
HALF_DIAGONAL = 0.71  # of a square with side 1, rounded up
# The cells of a plane are computed after so many pixels have shown it; at that point, rays would take as long.
MIN_PIXELS = 300_000
MIN_PIXELS_PER_CELL = 6
MIN_LAMPS = 2  # with one lamp, to look up the cells takes as long as the rays


@dataclass(frozen=True, slots=True)
class ShadowCells:
    """The known shadows in the cells of a plane.

    `decided` (H·W + 1,) has a bit for each lamp, which is set if the whole cell is in its shadow or none of it is.
    `hidden` (H·W + 1,) has a bit for each lamp, which is set if the whole cell is in its shadow.
    The last entry stands for all points outside the grid, where nothing is decided.
    """

    plane: ReceiverPlane
    decided: Bits
    hidden: Bits


def shadow_cells(plane: ReceiverPlane, lamps: tuple[Lamp, ...], occluders: Occluders) -> ShadowCells:
    """The shadows of stationary lamps that can be proven for the cells of a plane, given all stationary occluders."""
    largest_m = max(1.0, float(np.abs(occluders.corners_m).max(initial=0.0)))
    error_m = RAY_ERROR * largest_m
    count = plane.height * plane.width
    decided = np.zeros(count + 1, np.uint32)
    hidden = np.zeros(count + 1, np.uint32)

    # Only triangles that reach above the plane can cast a shadow on it.
    all_heights_m = plane.heights_m(occluders.corners_m)
    rows = np.flatnonzero(all_heights_m.max(1) > -error_m)
    corners_m = occluders.corners_m[rows]
    heights_m = all_heights_m[rows]
    is_above_plane = heights_m.min(1) > error_m
    is_solid = occluders.is_whole[rows] & is_above_plane
    triangles = ProjectedTriangles(plane, plane.coordinates_m(corners_m), heights_m)

    for index, lamp in enumerate(lamps):
        projection = lamp_projection(plane, lamp)
        if projection is None:
            continue
        shadows = triangles.shadows(projection, ~_is_within(lamp, corners_m), is_solid, error_m)
        cone = _cone_cells(plane, lamp)
        is_hidden = cone.inside & shadows.covered
        is_free = cone.inside & ~shadows.touched
        bit = np.uint32(1 << index)
        decided[:count][is_hidden | is_free | cone.outside] |= bit
        hidden[:count][is_hidden] |= bit
    return ShadowCells(plane, decided, hidden)


def _is_within(lamp: Lamp, corners_m: Array) -> Mask:
    """Which triangles (T, 3, 3) are in the sphere of a lamp, so that they cannot hide it."""
    if lamp.center_m is None or lamp.radius_m == 0:
        return np.zeros(len(corners_m), bool)
    distances_m = np.linalg.norm(corners_m - lamp.center_m, axis=2).max(1)
    return np.asarray(distances_m <= lamp.radius_m * WITHIN_LAMP)


@dataclass(frozen=True, slots=True)
class _ConeCells:
    """The cells (H·W,) that are in the cone of a lamp with all their points, and those with no point in it."""

    inside: Mask
    outside: Mask


def _cone_cells(plane: ReceiverPlane, lamp: Lamp) -> _ConeCells:
    """The cells inside and outside of a lamp's cone; those at its rim are neither."""
    count = plane.height * plane.width
    if lamp.center_m is None or lamp.min_cosine < -1:
        return _ConeCells(inside=np.ones(count, bool), outside=np.zeros(count, bool))
    row, column = np.divmod(np.arange(count), plane.width)
    middles_m = (
        plane.origin_m
        + (column[:, None] + 0.5) * plane.cell_m * plane.u_axis
        + (row[:, None] + 0.5) * plane.cell_m * plane.v_axis
    )
    vectors_m = middles_m - lamp.center_m

    # The clearance is positive in the cone, and changes by at most 1 + |cosine| per metre.
    clearance_m = vectors_m @ lamp.axis - lamp.min_cosine * np.linalg.norm(vectors_m, axis=1)
    margin_m = (1 + abs(lamp.min_cosine)) * HALF_DIAGONAL * plane.cell_m + CONE_ERROR_M
    return _ConeCells(inside=clearance_m > margin_m, outside=clearance_m < -margin_m)


class KnownShadows:
    """The known shadows of stationary lamps on large planes.

    The cells of a plane are computed once many pixels have shown it, so that a single picture costs little more.
    They reduce the time that ground truth takes, and never change its values.
    """

    def __init__(
        self,
        planes: Sequence[ReceiverPlane],
        face_plane: Indices,
        lamps: Sequence[Lamp],
        occluders: Occluders,
    ) -> None:
        """`face_plane` (F + 1,) is the index of each face's plane, -1 for none."""
        self._planes = planes
        self._face_plane = face_plane
        self._lamps = tuple(lamps)
        self._occluders = occluders
        self._pixels = np.zeros(len(planes), np.int64)  # that have shown each plane so far
        cell_counts = np.array([plane.height * plane.width for plane in planes], np.int64)
        self._min_pixels = MIN_PIXELS + MIN_PIXELS_PER_CELL * cell_counts
        self._cells: dict[int, ShadowCells] = {}

    def shown(self, face: Indices) -> Rows:
        """The number of pixels that show each plane (P,), given the face (R,) in each pixel."""
        plane_or_none = self._face_plane[face] + 1  # 0 for no plane
        counts = np.bincount(plane_or_none, minlength=len(self._planes) + 1)
        return counts[1:]

    def learn(self, shown: Rows) -> None:
        """Count the pixels (P,) that have shown each plane, and compute the cells of those shown often."""
        if len(self._lamps) < MIN_LAMPS:
            return
        self._pixels += shown
        for index in np.flatnonzero(self._pixels >= self._min_pixels).tolist():
            if index not in self._cells:
                self._cells[index] = shadow_cells(self._planes[index], self._lamps, self._occluders)

    def bits(self, face: Indices, starts_m: Floats) -> tuple[Bits, Bits]:
        """The lamps whose shadows are known at points (R, 3) of faces (R,), and those of them that are hidden there.

        Each is a set of bits (R,), as in ShadowCells. `starts_m` are the points where shadow rays start.
        """
        decided = np.zeros(len(face), np.uint32)
        hidden = np.zeros(len(face), np.uint32)
        plane_of_pixel = self._face_plane[face]
        for index, cells in self._cells.items():
            pixels = np.flatnonzero(plane_of_pixel == index)
            cell = cells.plane.cell(starts_m[pixels])
            decided[pixels] = cells.decided[cell]
            hidden[pixels] = cells.hidden[cell]
        return decided, hidden
