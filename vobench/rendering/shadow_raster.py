"""Projects triangles from a lamp onto a plane, and draws their shadows into its cells with a margin for rounding.

A lamp projects as a pinhole camera does, so a projected point is homogeneous: (x, y, w) is the point (x / w, y / w) of
the plane, in metres along its axes. w is 1 on the plane, 0 at the height of the lamp, and negative above it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Mask, Rows
from vobench.rendering.lamp import Lamp
from vobench.rendering.receiver_plane import ReceiverPlane

NEAR_LAMP = 1e-3  # the share of a shadow ray's length, at the lamp, in which nothing is tested
MIN_W = NEAR_LAMP / 2  # triangles are clipped here, closer to the lamp than any ray is tested
# Lamps that are lower than one of these limits have no projection. Their shadows are computed by rays.
MIN_LAMP_HEIGHT_M = 0.05  # the smallest height of the lower end of a lamp above the plane
MIN_ELEVATION_SINE = 0.02  # the smallest sine of the elevation of a lamp, seen from any cell
MIN_RELATIVE_AREA = 1e-9  # a projected triangle with a smaller one counts as a line
MIN_LENGTH = 1e-300  # avoids a division by zero for edges without length
# A shadow with more cells than this is drawn alone, by slices of the grid instead of lists of cells.
MAX_CELLS_TOGETHER = 2000
CELLS_AT_ONCE = 30_000  # the number of cells of small shadows that are tested at once; it limits the memory


@dataclass(frozen=True, slots=True)
class LampProjection:
    """The projection from a lamp onto a plane.

    It maps the point (u, v) at height h above the plane to (u - u_slope h, v - v_slope h, 1 - w_slope h).

    `u_slope` and `v_slope` have no unit.
    `w_slope` is in 1/m. It is 0 for the sun.
    `min_sine` is the smallest sine of the lamp's elevation, seen from any cell.
    `ray_end_w` is the smallest w that all shadow rays reach. They can end before they reach points with a smaller w.
    """

    u_slope: float
    v_slope: float
    w_slope: float
    min_sine: float
    ray_end_w: float


def lamp_projection(plane: ReceiverPlane, lamp: Lamp) -> LampProjection | None:
    """The projection from a lamp onto a plane; None if the lamp is behind the plane, or too low above it."""
    if lamp.center_m is None:
        return _sun_projection(plane, lamp)
    u_m, v_m = plane.coordinates_m(lamp.center_m)
    height_m = float(plane.heights_m(lamp.center_m))

    # The lamp is seen at the smallest elevation from the corner that is farthest away.
    farthest_u_m = max(abs(u_m), abs(u_m - plane.width * plane.cell_m))
    farthest_v_m = max(abs(v_m), abs(v_m - plane.height * plane.cell_m))
    farthest_m = float(np.sqrt(farthest_u_m**2 + farthest_v_m**2 + height_m**2))
    min_sine = height_m / farthest_m

    is_clear_of_plane = height_m - lamp.radius_m > MIN_LAMP_HEIGHT_M
    if not is_clear_of_plane or min_sine <= MIN_ELEVATION_SINE:
        return None
    return LampProjection(
        u_slope=float(u_m / height_m),
        v_slope=float(v_m / height_m),
        w_slope=1 / height_m,
        min_sine=min_sine,
        ray_end_w=lamp.radius_m / height_m + 2 * NEAR_LAMP,
    )


def _sun_projection(plane: ReceiverPlane, sun: Lamp) -> LampProjection | None:
    """The projection along parallel rays; None if the sun is behind the plane, or too low above it."""
    sine = float(plane.normal @ sun.axis)
    if sine <= MIN_ELEVATION_SINE:
        return None
    return LampProjection(
        u_slope=float(plane.u_axis @ sun.axis) / sine,
        v_slope=float(plane.v_axis @ sun.axis) / sine,
        w_slope=0.0,
        min_sine=sine,
        ray_end_w=0.0,
    )


class DrawnShadows(NamedTuple):
    """The cells (H·W,) that any shadow touches, and those that one solid triangle's shadow covers."""

    touched: Mask
    covered: Mask


@dataclass(frozen=True, slots=True)
class ProjectedTriangles:
    """Triangles in the coordinates of a plane.

    `along_m` (T, 3, 2) are the positions of the corners along the axes of the plane.
    `heights_m` (T, 3) are their heights above the plane.
    """

    plane: ReceiverPlane
    along_m: Array
    heights_m: Array

    def shadows(
        self,
        projection: LampProjection,
        is_occluder: Mask,
        is_solid: Mask,
        error_m: float,
    ) -> DrawnShadows:
        """Draw the shadows of triangles (T,) that are occluders. Those that are not solid cover no cell.

        `error_m` is the largest distance of a shadow ray from its ideal line.
        """
        x = self.along_m[..., 0] - projection.u_slope * self.heights_m
        y = self.along_m[..., 1] - projection.v_slope * self.heights_m
        w = 1 - projection.w_slope * self.heights_m
        nearness = np.clip(w.min(1), NEAR_LAMP, 1)
        margin_m = error_m / (nearness * projection.min_sine)  # (T,), by which rounding moves the border of a shadow

        rows = np.flatnonzero(is_occluder & self._may_reach_grid(x, y, w, margin_m))
        vertices = np.stack([x[rows], y[rows], w[rows]], -1)
        is_before_ray_end = w.min(1) > projection.ray_end_w
        is_covering = is_solid & is_before_ray_end
        shadows = _Shadows.of_triangles(vertices, margin_m[rows], is_covering[rows])
        return self._drawn(shadows)

    def _may_reach_grid(self, x: Array, y: Array, w: Array, margin_m: Array) -> Mask:
        """Whether the shadows of projected triangles (T, 3) may reach the grid.

        A point with w > 0 is right of the left border if x / w >= -margin, which is x + margin w >= 0. This is linear
        in x and w: if it holds for no corner, it holds for no point of the triangle. The other borders are alike.
        """
        width_m = self.plane.width * self.plane.cell_m
        height_m = self.plane.height * self.plane.cell_m
        margins_m = margin_m[:, None]
        is_below_lamp = w.max(1) > 0
        is_right_of_left_border = (x + margins_m * w).max(1) >= 0
        is_left_of_right_border = (x - (width_m + margins_m) * w).min(1) <= 0
        is_past_first_border = (y + margins_m * w).max(1) >= 0
        is_before_last_border = (y - (height_m + margins_m) * w).min(1) <= 0
        in_columns = is_right_of_left_border & is_left_of_right_border
        in_rows = is_past_first_border & is_before_last_border
        may_reach: Mask = is_below_lamp & in_columns & in_rows
        return may_reach

    def _drawn(self, shadows: "_Shadows") -> DrawnShadows:
        """The cells that shadows touch and cover."""
        cell_count = self.plane.height * self.plane.width
        drawn = DrawnShadows(touched=np.zeros(cell_count, bool), covered=np.zeros(cell_count, bool))
        counts = shadows.cell_ranges(self.plane).cell_counts
        is_large = counts > MAX_CELLS_TOGETHER
        shadows.take(np.flatnonzero(is_large)).draw_one_by_one(self.plane, drawn)

        small = np.flatnonzero((counts > 0) & ~is_large)
        for chunk in _chunks(counts[small]):
            shadows.take(small[chunk]).draw_together(self.plane, drawn)
        return drawn


def _chunks(counts: Rows) -> Iterator[slice]:
    """Consecutive slices of shadows that have up to CELLS_AT_ONCE cells each, or are one shadow."""
    ends = np.cumsum(counts)
    start = 0
    while start < len(counts):
        cells_before = ends[start - 1] if start else 0
        stop = int(np.searchsorted(ends, cells_before + CELLS_AT_ONCE, side="right"))
        stop = max(start + 1, stop)
        yield slice(start, stop)
        start = stop


class _CellRanges(NamedTuple):
    """T rectangles of cells.

    `first` (T, 2) are the first column and the first row.
    `sizes` (T, 2) are the numbers of columns and rows.
    """

    first: Rows
    sizes: Rows

    @property
    def cell_counts(self) -> Rows:
        """The number of cells (T,) of each rectangle."""
        return np.asarray(self.sizes.prod(1))


@dataclass(frozen=True, slots=True)
class _Shadows:
    """Shadows of T triangles on a plane, each as the lines of its three edges.

    `lines` (3, 3, T) are the coefficients a, b and c (first axis) of the line of each edge (second axis). The signed
    distance of (u, v) from the line is a u + b v + c in metres. It is positive inside.
    `low_m` (T, 2) and `high_m` (T, 2) are the bounding boxes, with margins.
    `margin_m` (T,) is the largest distance by which rounding moves the border of the shadow.
    `is_flat` (T,) is whether the lamp sees the triangle edge-on. All three lines of such a shadow are that of its
    longest edge.
    `is_solid` (T,) is whether the shadow covers cells.
    """

    lines: Array
    low_m: Array
    high_m: Array
    margin_m: Array
    is_flat: Mask
    is_solid: Mask

    @classmethod
    def of_triangles(cls, vertices: Array, margin_m: Array, is_solid: Mask) -> "_Shadows":
        """Shadows of triangles with homogeneous vertices (T, 3, 3)."""
        # The line through two homogeneous points is their cross product. Line i is that of the edge opposite vertex i.
        next_vertices = np.roll(vertices, -1, axis=1)
        last_vertices = np.roll(vertices, -2, axis=1)
        lines = np.cross(next_vertices, last_vertices)  # (T, edge, coefficient)
        lengths = np.linalg.norm(lines[..., :2], axis=2)

        # The determinant of the vertices is proportional to the area, and negative if they are in clockwise order.
        determinant = np.einsum("ti,ti->t", vertices[:, 0], lines[:, 0])
        longest_vertex = np.linalg.norm(vertices, axis=2).max(1)
        longest_line = np.linalg.norm(lines, axis=2).max(1)
        max_determinant = longest_vertex * longest_line
        is_flat = np.abs(determinant) <= MIN_RELATIVE_AREA * max_determinant

        flat_rows = np.flatnonzero(is_flat)
        longest_edge = lengths.argmax(1)[flat_rows]
        lines[flat_rows] = lines[flat_rows, longest_edge][:, None]
        lengths[flat_rows] = lengths[flat_rows, longest_edge][:, None]

        # Scaled to unit normals that point inwards, a line's value at a point is the signed distance in metres.
        sign = np.where(determinant < 0, -1.0, 1.0)
        scale = sign[:, None] / np.maximum(lengths, MIN_LENGTH)
        lines *= scale[..., None]
        boxes = _bounding_boxes(vertices)
        return cls(
            lines=np.ascontiguousarray(lines.transpose(2, 1, 0)),
            low_m=boxes.low_m - margin_m[:, None],
            high_m=boxes.high_m + margin_m[:, None],
            margin_m=margin_m,
            is_flat=is_flat,
            is_solid=is_solid & ~is_flat,
        )

    def take(self, rows: Rows) -> "_Shadows":
        """The shadows with these indices."""
        return _Shadows(
            lines=self.lines[:, :, rows],
            low_m=self.low_m[rows],
            high_m=self.high_m[rows],
            margin_m=self.margin_m[rows],
            is_flat=self.is_flat[rows],
            is_solid=self.is_solid[rows],
        )

    def cell_ranges(self, plane: ReceiverPlane) -> _CellRanges:
        """The cells of the bounding boxes that are in the grid of a plane."""
        shape = np.array([plane.width, plane.height])
        first = np.clip(np.floor(self.low_m / plane.cell_m), 0, shape).astype(np.int64)
        last = np.clip(np.floor(self.high_m / plane.cell_m), -1, shape - 1).astype(np.int64)
        return _CellRanges(first, np.maximum(last - first + 1, 0))

    def draw_together(self, plane: ReceiverPlane, drawn: DrawnShadows) -> None:
        """Mark the cells that shadows touch or cover. The cells of all their bounding boxes are tested in one list."""
        ranges = self.cell_ranges(plane)
        counts = ranges.cell_counts
        # The arrays from here on have one entry for each cell of each bounding box.
        shadow = np.repeat(np.arange(len(counts)), counts)
        first_in_list = np.cumsum(counts) - counts
        index_in_box = np.arange(len(shadow)) - first_in_list[shadow]
        row_in_box, column_in_box = np.divmod(index_in_box, ranges.sizes[shadow, 0])
        row = row_in_box + ranges.first[shadow, 1]
        column = column_in_box + ranges.first[shadow, 0]

        u_m = (column + 0.5) * plane.cell_m
        v_m = (row + 0.5) * plane.cell_m
        is_touched, is_covered = self._test_cells(shadow, u_m, v_m, plane.cell_m)
        cell = row * plane.width + column
        drawn.touched[cell[is_touched]] = True
        drawn.covered[cell[is_covered]] = True

    def draw_one_by_one(self, plane: ReceiverPlane, drawn: DrawnShadows) -> None:
        """Mark the same cells as `draw_together`; faster if each shadow has many cells."""
        touched_grid = drawn.touched.reshape(plane.height, plane.width)
        covered_grid = drawn.covered.reshape(plane.height, plane.width)
        ranges = self.cell_ranges(plane)
        for shadow in range(len(self.margin_m)):
            first_column, first_row = ranges.first[shadow].tolist()
            column_count, row_count = ranges.sizes[shadow].tolist()
            columns = np.arange(first_column, first_column + column_count)
            rows = np.arange(first_row, first_row + row_count)
            u_m = (columns + 0.5) * plane.cell_m
            v_m = (rows[:, None] + 0.5) * plane.cell_m
            is_touched, is_covered = self._test_cells(shadow, u_m, v_m, plane.cell_m)

            box = (slice(first_row, first_row + row_count), slice(first_column, first_column + column_count))
            touched_grid[box] |= is_touched
            covered_grid[box] |= is_covered

    def _test_cells(self, shadow: Rows | int, u_m: Array, v_m: Array, cell_m: float) -> tuple[Mask, Mask]:
        """Whether shadows touch, and whether they cover, the cells with centres (u, v).

        `shadow` is the index of one shadow for all cells, or of one for each cell.
        """
        is_flat = self.is_flat[shadow]
        has_flat = np.any(is_flat)
        is_touched: Mask = np.ones(1, bool)
        is_covered = self.is_solid[shadow]
        for edge in range(3):
            a = self.lines[0, edge][shadow]
            b = self.lines[1, edge][shadow]
            c = self.lines[2, edge][shadow]
            distance_m = (a * u_m + c) + b * v_m
            # The corner that is farthest from the edge is this much farther than the centre.
            corner_m = (np.abs(a) + np.abs(b)) * (cell_m / 2)
            reach_m = corner_m + self.margin_m[shadow]
            is_covered = is_covered & (distance_m >= reach_m)
            if has_flat:
                # A flat shadow has no inside: it touches the cells that are near its line on either side.
                distance_m = np.where(is_flat, -np.abs(distance_m), distance_m)
            is_touched = is_touched & (distance_m >= -reach_m)
        return is_touched, is_covered


class _Boxes(NamedTuple):
    """Bounding boxes of T sets of points: their lowest and highest coordinates, (T, 2) each."""

    low_m: Array
    high_m: Array

    def extended(self, points: Array, is_included: Mask) -> "_Boxes":
        """The boxes extended to include one homogeneous point (T, 3) each, where `is_included` (T,)."""
        w = np.where(is_included, points[:, 2], 1.0)
        projected_m = points[:, :2] / w[:, None]
        return _Boxes(
            low_m=np.where(is_included[:, None], np.minimum(self.low_m, projected_m), self.low_m),
            high_m=np.where(is_included[:, None], np.maximum(self.high_m, projected_m), self.high_m),
        )


def _bounding_boxes(vertices: Array) -> _Boxes:
    """The bounding boxes of triangles with homogeneous vertices (T, 3, 3), clipped where w is MIN_W."""
    boxes = _Boxes(low_m=np.full((len(vertices), 2), np.inf), high_m=np.full((len(vertices), 2), -np.inf))
    for corner in range(3):
        start = vertices[:, corner]
        end = vertices[:, (corner + 1) % 3]
        start_w = start[:, 2]
        end_w = end[:, 2]
        is_start_kept = start_w > MIN_W
        is_end_kept = end_w > MIN_W
        boxes = boxes.extended(start, is_start_kept)

        is_clipped = is_start_kept != is_end_kept
        share = (MIN_W - start_w) / np.where(is_clipped, end_w - start_w, 1)
        clip_point = start + share[:, None] * (end - start)
        boxes = boxes.extended(clip_point, is_clipped)
    return boxes
