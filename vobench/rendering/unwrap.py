"""Unwrapping: charts of faces packed into the atlas of the light map."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench import stop
from vobench.errors import RenderError
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Indices, Mask, Rows
from vobench.rendering.atlas import Atlas, doubled_areas_px2
from vobench.scene.triangles import Triangles
from vobench.scene.weld import WELD_M, distinct_rows

TEXELS = 16_000_000  # at most in one map: some 100 bytes each, and 4 more for each light
FINENESS = 4096  # steps a texel: places that are meant to be at the middle of texels are so to the last bit
PADDING = 1  # texels around a chart, besides those that interpolation within it reads
BLOCK = 3  # texels along the side of a block that faces of one lamp share
LEAST_PX2 = 1e-6  # area of a face that axis charts have a place for


@dataclass(slots=True)
class _Charts:
    """Places (F, 3, 2) in texels and charts (F,), -1 for none; and the size of the map that they cover."""

    places: Array
    chart: Indices
    width: int
    height: int


def unwrap(faces: Triangles, spacing_m: Array, lit: Mask) -> Atlas:
    """Charts of the lit faces (F,) with samples every spacing_m (F,), and below them the shared blocks.

    Raises RenderError where the map would be too large.
    """
    _require_room(faces, spacing_m, lit)
    lowest_m = faces.corners_m.reshape(-1, 3).min(0)
    corners_px = (faces.corners_m - lowest_m) / spacing_m[:, None, None]
    charts = _xatlas_charts(corners_px, spacing_m, _parts(faces.thing, spacing_m, np.flatnonzero(lit)))

    has_area = areas_m2(corners_px) > LEAST_PX2
    unplaced = np.flatnonzero(lit & (charts.chart < 0) & has_area)
    if len(unplaced):
        unplaced_px = corners_px[unplaced]
        places, chart, width, height = axis_charts(
            unplaced_px, unplaced_px * spacing_m[unplaced, None, None], faces.thing[unplaced]
        )
        charts.places[unplaced] = places + np.array([0, charts.height])
        charts.chart[unplaced] = chart + charts.chart.max() + 1
        charts.width = max(charts.width, width)
        charts.height = charts.height + height
    thin = np.flatnonzero(lit & (charts.chart < 0))
    _place_thin_faces(faces, charts.places, charts.chart, thin)
    return _with_shared_blocks(charts, faces.lamp + 1)


def _require_room(faces: Triangles, spacing_m: Array, lit: Mask) -> None:
    """Raise RenderError where the map of the lit faces (F,) would be too large."""
    needed = float((areas_m2(faces.corners_m) / spacing_m**2)[lit].sum())
    if needed > TEXELS:
        raise RenderError(
            f"the light map would need {needed / 1e6:.0f} million samples; {TEXELS / 1e6:.0f} million are the most: "
            f"give its largest things {np.sqrt(needed / TEXELS):.1f} times the spacing_m"
        )


def _with_shared_blocks(charts: _Charts, block: Indices) -> Atlas:
    """The atlas of charts, where faces without one have the block (F,) of their lamp, 0 for those of none."""
    height = charts.height + PADDING
    width = max(charts.width, BLOCK)
    blocks_a_row = width // BLOCK
    column = block % blocks_a_row * BLOCK + BLOCK / 2
    row = block // blocks_a_row * BLOCK + BLOCK / 2 + height
    middle = np.stack([column, row], -1)
    has_no_chart = charts.chart < 0
    charts.places[has_no_chart] = middle[has_no_chart, None]
    height += BLOCK * (int(block.max(initial=0)) // blocks_a_row + 1)
    rounded_px = np.rint(charts.places * FINENESS) / FINENESS
    light_px = rounded_px.astype(np.float32)
    return Atlas(light_px, charts.chart, height, width)


def _parts(thing: Indices, spacing_m: Array, faces: Rows) -> list[Rows]:
    """Faces thing by thing, each part with one spacing."""
    if not len(faces):
        return []
    order = faces[np.lexsort((spacing_m[faces], thing[faces]))]
    is_new_thing = np.diff(thing[order]) != 0
    is_new_spacing = np.diff(spacing_m[order]) != 0
    begins_part = is_new_thing | is_new_spacing
    return np.split(order, np.flatnonzero(begins_part) + 1)


def _xatlas_charts(corners_px: Array, spacing_m: Array, parts: Sequence[Rows]) -> _Charts:
    """Charts of the parts of faces with corners (F, 3, 3) in texels; none without xatlas."""
    places = np.zeros((len(corners_px), 3, 2))
    no_chart = np.full(len(corners_px), -1, np.int32)
    charts = _Charts(places, no_chart, 0, 0)
    try:
        import xatlas
    except ImportError:  # Python 3.14 has none yet
        return charts
    atlas = xatlas.Atlas()
    _keep_for_ever(atlas)
    added = []
    for part in parts:
        first, vertex = _welded(corners_px[part] * spacing_m[part, None, None])
        is_whole = (vertex != np.roll(vertex, 1, axis=1)).all(1)
        if is_whole.any():
            vertices_px = corners_px[part].reshape(-1, 3)[first]
            from_lowest_px = (vertices_px - vertices_px.min(0)).astype(np.float32)
            atlas.add_mesh(from_lowest_px, vertex[is_whole].astype(np.uint32))
            added.append(part[is_whole])
    stop.check()

    packing = xatlas.PackOptions()
    packing.texels_per_unit = 1.0
    packing.padding = PADDING
    packing.bilinear = True
    atlas.generate(xatlas.ChartOptions(), packing)
    charts.width = atlas.width
    charts.height = atlas.height
    chart_count = 0
    for nth, part in enumerate(added):
        _, vertex, uv = atlas[nth]
        charts.places[part] = (uv * (atlas.width, atlas.height))[vertex]
        has_place = np.abs(doubled_areas_px2(charts.places[part])) > 1e-9
        chart = _connected(vertex.astype(np.int64))
        charts.chart[part] = np.where(has_place, chart + chart_count, -1)
        chart_count += chart.max() + 1
    return charts


def _keep_for_ever(atlas: object) -> None:
    """Never destroy an atlas of xatlas, which may wait for ever when it is destroyed.

    Its scheduler sets a flag and notifies its threads without holding their lock. A thread that has just looked at the
    flag misses both, and the scheduler joins it in vain. Seen once, in a run of all tests. What is kept is the
    memory of one unwrapped scene and its idle threads; a bake has a process of its own.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(atlas))


def _welded(
    corners_m: Array,
    *also: NDArray[np.int64],
) -> tuple[Rows, Rows]:
    """Of corners (F, 3, 3) the first (V,) of those at one place, and which each is (F, 3); `also` (F,) keeps apart."""
    keys = np.rint(corners_m / WELD_M).astype(np.int64).reshape(-1, 3)
    keys = np.column_stack([keys, *(np.repeat(other, 3) for other in also)])
    first, of = distinct_rows(keys)
    return first, of.reshape(-1, 3)


def _connected(index: Rows) -> Indices:
    """Which of the groups that share vertices each face is in (F,), by its vertices (F, 3)."""
    count = len(index) + int(index.max()) + 1
    links = (np.repeat(np.arange(len(index)), 3), index.ravel() + len(index))
    graph = scipy.sparse.coo_matrix((np.ones(index.size, np.int8), links), (count, count))
    labels = scipy.sparse.csgraph.connected_components(graph, directed=False)[1][: len(index)]
    return np.unique(labels, return_inverse=True)[1].astype(np.int32)


def axis_charts(
    corners_px: Array,
    corners_m: Array,
    thing: Indices,
) -> tuple[Array, Indices, int, int]:
    """Charts of connected faces whose normals are nearest to one axis, seen along it: for what xatlas leaves.

    corners_px (F, 3, 3): in texels. Returns places (F, 3, 2), charts (F,), width and height.
    """
    first_edge = corners_px[:, 1] - corners_px[:, 0]
    second_edge = corners_px[:, 2] - corners_px[:, 0]
    side = nearest_axis(np.cross(first_edge, second_edge))
    chart = _connected(_welded(corners_m, thing.astype(np.int64), side)[1])
    plane_axes = np.array([[1, 2], [0, 2], [0, 1]])[side // 2]  # (F, 2)
    places = np.take_along_axis(corners_px, plane_axes[:, None].repeat(3, 1), 2)

    count = int(chart.max()) + 1
    low = np.full((count, 2), np.inf)
    high = np.full((count, 2), -np.inf)
    for corner in range(3):
        np.minimum.at(low, chart, places[:, corner])
        np.maximum.at(high, chart, places[:, corner])
    size = np.maximum(np.ceil(high - low - 1e-6), 1)
    stretch = size / np.maximum(high - low, 1e-9)
    places = (places - low[chart, None]) * stretch[chart, None]
    padded_size = size.astype(np.int64) + 1 + 2 * PADDING
    box_corner, width, height = _shelves(padded_size)
    return places + box_corner[chart, None] + PADDING + 0.5, chart, width, height


def nearest_axis(vectors: Array) -> Rows:
    """The direction that vectors (N, 3) point along most: 0 and 1 along the first axis and against it, and so on."""
    axis = np.abs(vectors).argmax(1)
    component = np.take_along_axis(vectors, axis[:, None], 1)[:, 0]
    return np.asarray(2 * axis + (component < 0))


def _shelves(sizes: Rows) -> tuple[Rows, int, int]:
    """Corners (N, 2) of boxes (N, 2) in shelves, tallest first, and the width and height of them all."""
    square_side = np.sqrt(sizes.prod(1).sum())
    width = int(max(square_side, sizes[:, 0].max()))
    corners = np.zeros_like(sizes)
    column = 0
    row = 0
    shelf_height = 0
    tallest_first = np.lexsort((np.arange(len(sizes)), -sizes[:, 0], -sizes[:, 1]))
    for index in tallest_first:
        box_width, box_height = sizes[index].tolist()
        if column + box_width > width:
            column = 0
            row = row + shelf_height
            shelf_height = 0
        corners[index] = column, row
        column = column + box_width
        shelf_height = max(shelf_height, box_height)
    return corners, width, row + shelf_height


def _place_thin_faces(
    faces: Triangles,
    places: Array,
    chart: Indices,
    thin: Rows,
) -> None:
    """Give faces that are too thin for a place that of a neighbour's corner."""
    if not len(thin):
        return
    _, vertex = _welded(faces.corners_m, faces.thing.astype(np.int64))
    corner_at = np.full(vertex.max() + 1, -1)
    placed = np.flatnonzero(chart >= 0)
    corner_at[vertex[placed]] = 3 * placed[:, None] + np.arange(3)
    source = corner_at[vertex[thin]].max(1)
    has_source = source >= 0
    places[thin[has_source]] = places.reshape(-1, 2)[source[has_source], None]
    chart[thin[has_source]] = chart[source[has_source] // 3]
