"""Cells of large planes in which a lamp is proven to be hidden, or not hidden, so that no shadow ray is needed.

All occluding triangles are projected from the lamp onto a plane, and drawn into a grid with a margin for rounding. No
point of a cell that no triangle touches is in shadow. All points of a cell that one triangle covers are in shadow.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.geometry import tangents
from vobench.rendering.lamp import Bits, Lamp
from vobench.rendering.occlusion import Occluders

LEAST_AREA_M2 = 0.5  # of the faces in a plane that is worth a grid
MOST_CELLS = 300_000  # of one grid
LEAST_CELL_M = 0.02
SAME_PLANE_M = 1e-6  # the largest distance of a face's corner from the plane that it is counted to
DIGITS = 6  # of normals and offsets of planes, when faces in the same plane are looked for
# A ray of Embree deviates from its line by less than this share of the largest coordinate, about 40 float32 steps.
RAY_ERROR = 4e-6
NEAR_LAMP = 1e-3  # the share of a ray's length, at the lamp, in which nothing is tested
FLATTEST = 1e-9  # the smallest relative area of a projected triangle that is not taken for a line
GRAZING = 0.02  # the least sine of the elevation of a lamp above a plane, seen from any cell
CONE_ERROR_M = 1e-3  # more than float32 rounds when it is asked whether a point is in a cone
FRAGMENTS_AT_ONCE = 30_000
LARGE = 2000  # cells of a shadow that is drawn alone
# Cells are computed once a plane was shown by so many pixels, and by some more per cell: then rays cost as much.
WORTH_PIXELS = 300_000
WORTH_PIXELS_PER_CELL = 6
FEWEST_LAMPS = 2  # for a single one, to look into the cells takes as long as the rays


@dataclass(frozen=True, slots=True)
class ReceiverPlane:
    """A rectangle of H x W cells in a plane that contains faces of the scene.

    `origin_m` is the corner of the first cell; `u_axis` and `v_axis` are the unit vectors along columns and rows.
    The rectangle is `lift_m` in front of the faces, where their shadow rays start.
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
        shape = (self.width, self.height)
        columns = []
        is_outside = np.zeros(len(points_m), bool)
        for axis, count in zip((self.u_axis, self.v_axis), shape, strict=True):
            scaled = (axis / self.cell_m).astype(np.float32)
            column = points_m @ scaled - np.float32(axis @ self.origin_m / self.cell_m)
            is_outside |= ~((column >= 0) & (column < count))
            columns.append(column.astype(np.int64))
        cell = columns[1] * self.width + columns[0]
        cell[is_outside] = self.height * self.width
        return cell

    def heights_m(self, points_m: Array) -> Array:
        """The heights (...) of points (..., 3) above the plane."""
        return np.asarray((points_m - self.origin_m) @ self.normal)

    def coordinates_m(self, points_m: Array) -> Array:
        """The coordinates (..., 2) of points (..., 3) along columns and rows."""
        axes = np.stack([self.u_axis, self.v_axis], -1)
        return np.asarray((points_m - self.origin_m) @ axes)


def large_planes(
    corners_m: Array, normals: Array, selected: Mask, lift_m: float
) -> tuple[list[ReceiverPlane], Indices]:
    """The planes with a large area of selected faces (F,), and the index (F + 1,) of each face's plane, -1 for none.

    `corners_m` (F, 3, 3) and `normals` (F, 3) are those of all faces.
    """
    face_plane = np.full(len(corners_m) + 1, -1, np.int32)
    faces = np.flatnonzero(selected)
    edges_m = corners_m[faces, 1:] - corners_m[faces, :1]
    areas_m2 = np.linalg.norm(np.cross(edges_m[:, 0], edges_m[:, 1]), axis=1) / 2
    offsets_m = np.einsum("fj,fj->f", normals[faces], corners_m[faces, 0])
    key = np.round(np.column_stack([normals[faces], offsets_m]), DIGITS) + 0.0  # no negative zeros
    _, plane_of = np.unique(key, axis=0, return_inverse=True)
    plane_of = plane_of.reshape(-1)
    planes: list[ReceiverPlane] = []
    for index in np.flatnonzero(np.bincount(plane_of, areas_m2) >= LEAST_AREA_M2):
        members = faces[plane_of == index]
        plane = _plane(corners_m[members], normals[members[0]], lift_m)
        distances_m = np.abs(plane.heights_m(corners_m[members]) + lift_m).max(1)
        face_plane[members[distances_m <= SAME_PLANE_M]] = len(planes)
        planes.append(plane)
    return planes, face_plane


def _plane(corners_m: Array, normal: Array, lift_m: float) -> ReceiverPlane:
    """The rectangle around faces (F, 3, 3) that lie in one plane."""
    u_axes, v_axes = tangents(normal[None])
    u_axis = u_axes[0]
    v_axis = v_axes[0]
    points_m = corners_m.reshape(-1, 3)
    in_plane_m = points_m @ np.stack([u_axis, v_axis], -1)
    low_m = in_plane_m.min(0)
    size_m = np.ptp(in_plane_m, axis=0)
    cell_m = max(LEAST_CELL_M, float(np.sqrt(np.prod(size_m) / MOST_CELLS)))
    width, height = (np.ceil(size_m / cell_m).astype(int) + 1).tolist()
    above_m = normal @ points_m[0] + lift_m
    origin_m = low_m[0] * u_axis + low_m[1] * v_axis + above_m * normal
    return ReceiverPlane(origin_m, u_axis, v_axis, normal, cell_m, height, width)


@dataclass(frozen=True, slots=True)
class ShadowCells:
    """The known shadows in the cells of a plane: `decided` and `hidden` (H·W + 1,) have a bit for each lamp.

    The last cell stands for all points outside the grid, where nothing is decided.
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
    heights_m = plane.heights_m(occluders.corners_m)
    rows = np.flatnonzero(heights_m.max(1) > -error_m)
    scene = _Projected(plane, plane.coordinates_m(occluders.corners_m[rows]), heights_m[rows])
    for nth, lamp in enumerate(lamps):
        source = _source(plane, lamp)
        if source is None:
            continue
        is_solid = occluders.is_whole[rows] & (heights_m[rows].min(1) > error_m)
        is_other = ~_within(lamp, occluders.corners_m[rows])
        touched, covered = scene.drawn(source, is_other, is_solid, error_m)
        inside, outside = _cone(plane, lamp)
        bit = np.uint32(1 << nth)
        decided[:count][(inside & (covered | ~touched)) | outside] |= bit
        hidden[:count][inside & covered] |= bit
    return ShadowCells(plane, decided, hidden)


def _within(lamp: Lamp, corners_m: Array) -> Mask:
    """Which triangles (T, 3, 3) are in the sphere of a lamp, so that they cannot hide it."""
    if lamp.center_m is None or lamp.radius_m == 0:
        return np.zeros(len(corners_m), bool)
    distances_m = np.linalg.norm(corners_m - lamp.center_m, axis=2).max(1)
    return np.asarray(distances_m <= lamp.radius_m * (1 + 1e-9))


@dataclass(frozen=True, slots=True)
class _Source:
    """The homogeneous projection from a lamp onto a plane: (u, v, h) becomes (u - a h, v - b h, 1 - g h).

    For the sun, g is 0. `sine` is the least sine of the lamp's elevation, seen from any cell. Where 1 - g h is less
    than `end`, a triangle may be beyond the end of a shadow ray.
    """

    a: float
    b: float
    g: float
    sine: float
    end: float


def _source(plane: ReceiverPlane, lamp: Lamp) -> _Source | None:
    """The projection from a lamp onto a plane; None if the lamp is behind the plane, or too flat above it."""
    if lamp.center_m is None:
        sun_u = float(plane.u_axis @ lamp.axis)
        sun_v = float(plane.v_axis @ lamp.axis)
        elevation_sine = float(plane.normal @ lamp.axis)
        if elevation_sine <= GRAZING:
            return None
        return _Source(sun_u / elevation_sine, sun_v / elevation_sine, 0.0, elevation_sine, 0.0)
    u, v = plane.coordinates_m(lamp.center_m)
    h = float(plane.heights_m(lamp.center_m))
    far_u = max(abs(u), abs(u - plane.width * plane.cell_m))
    far_v = max(abs(v), abs(v - plane.height * plane.cell_m))
    sine = h / float(np.sqrt(far_u**2 + far_v**2 + h**2))
    is_clear = h - lamp.radius_m > 0.05 and sine > GRAZING
    end = lamp.radius_m / h + 2 * NEAR_LAMP
    return _Source(float(u / h), float(v / h), 1 / h, sine, end) if is_clear else None


def _cone(plane: ReceiverPlane, lamp: Lamp) -> tuple[Mask, Mask]:
    """The cells (H·W,) in which a lamp shines everywhere, and those in which it shines nowhere."""
    count = plane.height * plane.width
    if lamp.center_m is None or lamp.min_cosine < -1:
        return np.ones(count, bool), np.zeros(count, bool)
    row, column = np.divmod(np.arange(count), plane.width)
    middles_m = (
        plane.origin_m
        + (column[:, None] + 0.5) * plane.cell_m * plane.u_axis
        + (row[:, None] + 0.5) * plane.cell_m * plane.v_axis
    )
    vectors_m = middles_m - lamp.center_m
    # The steepest change of the clearance is 1 + cosine per metre; the corners are half a diagonal from the middle.
    clearance_m = vectors_m @ lamp.axis - lamp.min_cosine * np.linalg.norm(vectors_m, axis=1)
    margin_m = (1 + abs(lamp.min_cosine)) * 0.71 * plane.cell_m + CONE_ERROR_M
    return clearance_m > margin_m, clearance_m < -margin_m


@dataclass(frozen=True, slots=True)
class _Projected:
    """Triangles (T, 3) in the coordinates of a plane: (T, 3, 2) along it and heights (T, 3) above it."""

    plane: ReceiverPlane
    along_m: Array
    heights_m: Array

    def drawn(self, source: _Source, selected: Mask, is_solid: Mask, error_m: float) -> tuple[Mask, Mask]:
        """The cells (H·W,) that the shadow of any selected triangle touches, and those that a solid one covers."""
        plane = self.plane
        touched = np.zeros(plane.height * plane.width, bool)
        covered = np.zeros(plane.height * plane.width, bool)
        x = self.along_m[..., 0] - source.a * self.heights_m
        y = self.along_m[..., 1] - source.b * self.heights_m
        w = 1 - source.g * self.heights_m
        nearness = np.clip(w.min(1), NEAR_LAMP, 1)
        margin_m = error_m / (nearness * source.sine)  # (T,), how far rounding moves a shadow's border
        width_m = plane.width * plane.cell_m
        height_m = plane.height * plane.cell_m
        is_met = selected & (w.max(1) > 0)
        is_met &= (x + margin_m[:, None] * w).max(1) >= 0
        is_met &= (y + margin_m[:, None] * w).max(1) >= 0
        is_met &= (x - (width_m + margin_m[:, None]) * w).min(1) <= 0
        is_met &= (y - (height_m + margin_m[:, None]) * w).min(1) <= 0
        rows = np.flatnonzero(is_met)
        vertices = np.stack([x[rows], y[rows], w[rows]], -1)
        shadows = _Shadows.of(vertices, margin_m[rows], (is_solid & (w.min(1) > source.end))[rows])
        counts = shadows.cell_counts(plane)
        shadows.take(np.flatnonzero(counts > LARGE)).draw_large(plane, touched, covered)
        small = np.flatnonzero((counts > 0) & (counts <= LARGE))
        for chunk in _chunks(counts[small]):
            shadows.take(small[chunk]).draw(plane, touched, covered)
        return touched, covered


def _chunks(counts: Rows) -> Iterator[slice]:
    """Consecutive slices of shadows that have about FRAGMENTS_AT_ONCE cells each."""
    ends = np.cumsum(counts)
    start = 0
    while start < len(counts):
        before = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, before + FRAGMENTS_AT_ONCE, side="right")))
        yield slice(start, stop)
        start = stop


@dataclass(frozen=True, slots=True)
class _Shadows:
    """Projected triangles (T,): the lines of their edges, and what surrounds them.

    `lines` (3, 3, T): the coefficients of u, v and 1 in the signed distance from each edge in metres, positive inside.
    `low_m` and `high_m` (T, 2) are their bounding boxes. `is_flat` (T,): seen edge-on; then all lines are the same.
    """

    lines: Array
    low_m: Array
    high_m: Array
    margin_m: Array
    is_flat: Mask
    is_solid: Mask

    @classmethod
    def of(cls, vertices: Array, margin_m: Array, is_solid: Mask) -> "_Shadows":
        """Shadows of triangles with homogeneous vertices (T, 3, 3)."""
        lines = np.cross(np.roll(vertices, -1, axis=1), np.roll(vertices, -2, axis=1))
        determinant = np.einsum("ti,ti->t", vertices[:, 0], lines[:, 0])
        lengths = np.linalg.norm(lines[..., :2], axis=2)
        scale = np.linalg.norm(vertices, axis=2).max(1) * np.linalg.norm(lines, axis=2).max(1)
        is_flat = np.abs(determinant) <= FLATTEST * scale
        longest = lengths.argmax(1)
        rows = np.flatnonzero(is_flat)
        lines[rows] = lines[rows, longest[rows]][:, None]
        lengths[rows] = lengths[rows, longest[rows]][:, None]
        sign = np.where(determinant < 0, -1.0, 1.0)
        lines *= (sign[:, None] / np.maximum(lengths, 1e-300))[..., None]
        low_m, high_m = _boxes(vertices)
        low_m -= margin_m[:, None]
        high_m += margin_m[:, None]
        return cls(
            np.ascontiguousarray(lines.transpose(2, 1, 0)), low_m, high_m, margin_m, is_flat, is_solid & ~is_flat
        )

    def take(self, rows: Rows) -> "_Shadows":
        """Some of the shadows."""
        return _Shadows(
            self.lines[:, :, rows],
            self.low_m[rows],
            self.high_m[rows],
            self.margin_m[rows],
            self.is_flat[rows],
            self.is_solid[rows],
        )

    def _ranges(self, plane: ReceiverPlane) -> tuple[Rows, Rows]:
        """The first cell and the number of cells (T, 2) of the bounding boxes, along columns and rows."""
        shape = np.array([plane.width, plane.height])
        first = np.clip(np.floor(self.low_m / plane.cell_m), 0, shape).astype(np.int64)
        last = np.clip(np.floor(self.high_m / plane.cell_m), -1, shape - 1).astype(np.int64)
        return first, np.maximum(last - first + 1, 0)

    def cell_counts(self, plane: ReceiverPlane) -> Rows:
        """The number of cells (T,) of each bounding box."""
        _, count = self._ranges(plane)
        return np.asarray(count.prod(1))

    def draw(self, plane: ReceiverPlane, touched: Mask, covered: Mask) -> None:
        """Mark the cells (H·W,) that shadows touch, and those that one of them covers."""
        first, count = self._ranges(plane)
        cells = count.prod(1)
        shadow = np.repeat(np.arange(len(cells)), cells)
        nth = np.arange(len(shadow)) - np.repeat(np.cumsum(cells) - cells, cells)
        row, column = np.divmod(nth, count[shadow, 0])
        row += first[shadow, 1]
        column += first[shadow, 0]
        u_m = (column + 0.5) * plane.cell_m
        v_m = (row + 0.5) * plane.cell_m
        is_touched, is_covered = self._meets(shadow, u_m, v_m, plane.cell_m)
        cell = row * plane.width + column
        touched[cell[is_touched]] = True
        covered[cell[is_covered]] = True

    def draw_large(self, plane: ReceiverPlane, touched: Mask, covered: Mask) -> None:
        """The same as `draw`, shadow by shadow, which costs less where each has many cells."""
        touched_grid = touched.reshape(plane.height, plane.width)
        covered_grid = covered.reshape(plane.height, plane.width)
        first, count = self._ranges(plane)
        for shadow, (column, row) in enumerate(first.tolist()):
            columns = np.arange(column, column + count[shadow, 0])
            rows = np.arange(row, row + count[shadow, 1])
            u_m = (columns + 0.5) * plane.cell_m
            v_m = (rows[:, None] + 0.5) * plane.cell_m
            is_touched, is_covered = self._meets(shadow, u_m, v_m, plane.cell_m)
            part = (slice(row, row + len(rows)), slice(column, column + len(columns)))
            touched_grid[part] |= is_touched
            covered_grid[part] |= is_covered

    def _meets(self, shadow: Rows | int, u_m: Array, v_m: Array, cell_m: float) -> tuple[Mask, Mask]:
        """Whether shadows touch, and whether they cover, the cells with these middles; all arguments broadcast."""
        is_flat = self.is_flat[shadow]
        is_touched: Mask = np.ones(1, bool)
        is_covered = self.is_solid[shadow]
        for edge in range(3):
            a, b, c = (self.lines[axis, edge][shadow] for axis in range(3))
            distance_m = (a * u_m + c) + b * v_m
            reach_m = (np.abs(a) + np.abs(b)) * (cell_m / 2) + self.margin_m[shadow]
            is_covered = is_covered & (distance_m >= reach_m)
            if np.any(is_flat):
                distance_m = np.where(is_flat, -np.abs(distance_m), distance_m)
            is_touched = is_touched & (distance_m >= -reach_m)
        return is_touched, is_covered


def _boxes(vertices: Array) -> tuple[Array, Array]:
    """The bounding boxes (T, 2) of triangles with homogeneous vertices (T, 3, 3), cut off where w is NEAR_LAMP / 2."""
    low_m = np.full((len(vertices), 2), np.inf)
    high_m = np.full((len(vertices), 2), -np.inf)
    for corner in range(3):
        start = vertices[:, corner]
        end = vertices[:, (corner + 1) % 3]
        step_w = end[:, 2] - start[:, 2]
        crosses = (start[:, 2] > NEAR_LAMP / 2) != (end[:, 2] > NEAR_LAMP / 2)
        share = (NEAR_LAMP / 2 - start[:, 2]) / np.where(crosses, step_w, 1)
        cut = start + share[:, None] * (end - start)
        for points, is_point in ((start, start[:, 2] > NEAR_LAMP / 2), (cut, crosses)):
            w = np.where(is_point, points[:, 2], 1.0)
            projected_m = points[:, :2] / w[:, None]
            low_m = np.where(is_point[:, None], np.minimum(low_m, projected_m), low_m)
            high_m = np.where(is_point[:, None], np.maximum(high_m, projected_m), high_m)
    return low_m, high_m


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
        self._shown = np.zeros(len(planes), np.int64)
        cells = np.array([plane.height * plane.width for plane in planes], np.int64)
        self._worth = WORTH_PIXELS + WORTH_PIXELS_PER_CELL * cells
        self._cells: dict[int, ShadowCells] = {}

    def shown(self, face: Indices) -> Rows:
        """How many of the pixels (R,) with these faces show each plane (P,)."""
        return np.bincount(self._face_plane[face] + 1, minlength=len(self._planes) + 1)[1:]

    def learn(self, shown: Rows) -> None:
        """Count the pixels (P,) that have shown each plane, and compute the cells of those shown often."""
        if len(self._lamps) < FEWEST_LAMPS:
            return
        self._shown += shown
        for index in np.flatnonzero(self._shown >= self._worth).tolist():
            if index not in self._cells:
                self._cells[index] = shadow_cells(self._planes[index], self._lamps, self._occluders)

    def bits(self, face: Indices, starts_m: Floats) -> tuple[Bits, Bits]:
        """The lamps that are decided and those that are hidden (R,), where shadow rays start (R, 3) from faces (R,)."""
        decided = np.zeros(len(face), np.uint32)
        hidden = np.zeros(len(face), np.uint32)
        plane_of = self._face_plane[face]
        for index, cells in self._cells.items():
            pixels = np.flatnonzero(plane_of == index)
            cell = cells.plane.cell(starts_m[pixels])
            decided[pixels] = cells.decided[cell]
            hidden[pixels] = cells.hidden[cell]
        return decided, hidden
