"""Unwrapping: the faces of a scene are flattened to charts, which are packed side by side on the light map."""

import ctypes
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

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

MAX_TEXELS = 16_000_000  # of one map; a texel needs about 100 bytes while light is computed, and 4 more for each light
STEPS_PER_TEXEL = 4096  # places are rounded to these steps, so that the middle of a texel is exact in float32
PADDING_PX = 1  # empty texels around a chart, besides those that interpolation within the chart reads
BLOCK_PX = 3  # the side of the block of texels that all faces of one lamp share
MIN_AREA_PX2 = 1e-6  # of a face that gets a place in an axis chart
MIN_XATLAS_AREA_PX2 = 1e-9  # of a place from xatlas, twice its area; smaller ones are not used
IDLE_S = 5.0  # after that time, the threads of xatlas are idle

# The coordinates that remain if one looks along the first, the second or the third axis.
PLANE_AXES = np.array([[1, 2], [0, 2], [0, 1]])


@dataclass(frozen=True, slots=True)
class _Charts:
    """Faces (F,) on a map of some width and height in texels.

    `places_px` (F, 3, 2) are the places of the faces' corners on the map.
    `chart` (F,) is the chart of each face, -1 for a face that has no place yet.
    """

    places_px: Array
    chart: Indices
    width: int
    height: int


def unwrap(faces: Triangles, spacing_m: Array, lit: Mask) -> Atlas:
    """Place the corners of all faces on the light map.

    The lit faces (F,) get charts, in which one texel corresponds to `spacing_m` (F,). All other faces share blocks of
    texels below the charts: one block for each lamp, and one for the rest.
    Raises RenderError if the map would be too large.
    """
    _require_room(faces, spacing_m, lit)
    lowest_m = faces.corners_m.reshape(-1, 3).min(0)
    corners_px = (faces.corners_m - lowest_m) / spacing_m[:, None, None]

    charts = _xatlas_charts(corners_px, spacing_m, _parts(faces.thing, spacing_m, np.flatnonzero(lit)))
    charts = _with_axis_charts(charts, faces, corners_px, spacing_m, lit)
    charts = _with_thin_faces(charts, faces, lit)
    return _with_shared_blocks(charts, block=faces.lamp + 1)


def _require_room(faces: Triangles, spacing_m: Array, lit: Mask) -> None:
    """Raise RenderError if the lit faces (F,) need too many texels."""
    texels = areas_m2(faces.corners_m) / spacing_m**2
    needed = float(texels[lit].sum())
    if needed > MAX_TEXELS:
        raise RenderError(
            f"the light map would need {needed / 1e6:.0f} million samples; {MAX_TEXELS / 1e6:.0f} million are the "
            f"most: give its largest things {np.sqrt(needed / MAX_TEXELS):.1f} times the spacing_m"
        )


def _parts(thing: Indices, spacing_m: Array, rows: Rows) -> list[Rows]:
    """Divide faces into parts. The faces of a part belong to one thing and have one spacing."""
    if not len(rows):
        return []
    order = np.lexsort((spacing_m[rows], thing[rows]))
    sorted_rows = rows[order]
    is_new_thing = np.diff(thing[sorted_rows]) != 0
    is_new_spacing = np.diff(spacing_m[sorted_rows]) != 0
    starts = np.flatnonzero(is_new_thing | is_new_spacing) + 1
    return np.split(sorted_rows, starts)


# Charts of xatlas, which flattens curved surfaces.


def _xatlas_charts(corners_px: Array, spacing_m: Array, parts: Sequence[Rows]) -> _Charts:
    """The charts that xatlas creates for parts of the faces, whose corners are (F, 3, 3).

    Faces that are too thin, and those that xatlas leaves out, have no place. Without xatlas no face has one.
    """
    no_chart = np.full(len(corners_px), -1, np.int32)
    without_charts = _Charts(np.zeros((len(corners_px), 3, 2)), no_chart, width=0, height=0)
    if not parts:
        return without_charts
    try:
        import xatlas
    except ImportError:  # there is no xatlas for Python 3.14 yet
        return without_charts

    atlas = xatlas.Atlas()
    try:
        return _generated_charts(atlas, corners_px, spacing_m, parts)
    finally:
        _IDLE_ATLASES.keep(atlas)


def _generated_charts(atlas: Any, corners_px: Array, spacing_m: Array, parts: Sequence[Rows]) -> _Charts:
    """The charts that an empty atlas of xatlas creates for parts of the faces, whose corners are (F, 3, 3)."""
    import xatlas

    places_px = np.zeros((len(corners_px), 3, 2))
    chart = np.full(len(corners_px), -1, np.int32)
    added_parts = list[Rows]()
    for part in parts:
        vertices_px, vertex = _indexed_mesh(corners_px[part], spacing_m[part])
        has_three_vertices = (vertex != np.roll(vertex, 1, axis=1)).all(1)
        if has_three_vertices.any():
            atlas.add_mesh(vertices_px, vertex[has_three_vertices].astype(np.uint32))
            added_parts.append(part[has_three_vertices])
    stop.check()
    atlas.generate(xatlas.ChartOptions(), _packing(xatlas))

    chart_count = 0
    for index, part in enumerate(added_parts):
        _, vertex, vertex_uv = atlas[index]
        vertex_px = vertex_uv * (atlas.width, atlas.height)
        places_px[part] = vertex_px[vertex]
        has_area = np.abs(doubled_areas_px2(places_px[part])) > MIN_XATLAS_AREA_PX2
        part_chart = _connected_components(vertex.astype(np.int64))
        chart[part] = np.where(has_area, chart_count + part_chart, -1)
        chart_count += part_chart.max() + 1
    return _Charts(places_px, chart, atlas.width, atlas.height)


def _indexed_mesh(corners_px: Array, spacing_m: Array) -> tuple[NDArray[np.float32], Rows]:
    """The vertices (V, 3) of faces with corners (F, 3, 3), and the vertices (F, 3) of each face.

    The coordinates of the vertices begin at 0, because float32 resolves small numbers better.
    """
    corners_m = corners_px * spacing_m[:, None, None]
    first_corner, vertex = _welded(corners_m)
    vertices_px = corners_px.reshape(-1, 3)[first_corner]
    from_lowest_px = vertices_px - vertices_px.min(0)
    return from_lowest_px.astype(np.float32), vertex


def _packing(xatlas: Any) -> Any:
    """The options of xatlas for charts whose unit of length is already one texel."""
    options = xatlas.PackOptions()
    options.texels_per_unit = 1.0
    options.padding = PADDING_PX
    options.bilinear = True
    return options


class _IdleAtlases:
    """Keeps atlases of xatlas until their threads are idle, because earlier their destructor can wait forever.

    The scheduler of xatlas sets a flag and notifies its threads without holding their lock. A thread that has just read
    the flag misses both, and the scheduler then waits for that thread forever. This happened once, in a run of all
    tests. A thread that has been idle for some time waits for the notification already.
    An atlas of a place takes tens of megabytes, so a process that bakes many places cannot keep them all. Those that
    are kept at the end of the process are never destroyed.
    """

    def __init__(self) -> None:
        self._kept: list[tuple[float, Any]] = []  # when each atlas was kept, and the atlas

    def keep(self, atlas: Any) -> None:
        """Keep an atlas that has been generated, and destroy those that were kept IDLE_S ago."""
        now_s = time.monotonic()
        for since_s, old in self._kept:
            if now_s > since_s + IDLE_S:
                ctypes.pythonapi.Py_DecRef(ctypes.py_object(old))
        self._kept = [kept for kept in self._kept if now_s <= kept[0] + IDLE_S]

        # A reference that is not Python's, so that the end of the process does not destroy it.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(atlas))
        self._kept.append((now_s, atlas))


_IDLE_ATLASES = _IdleAtlases()


# Axis charts: projections of flat or nearly flat surfaces.


def _with_axis_charts(charts: _Charts, faces: Triangles, corners_px: Array, spacing_m: Array, lit: Mask) -> _Charts:
    """Add axis charts, below the other charts, for the lit faces (F,) that have an area but no place yet."""
    has_area = areas_m2(corners_px) > MIN_AREA_PX2
    rows = np.flatnonzero(lit & (charts.chart < 0) & has_area)
    if not len(rows):
        return charts

    row_corners_px = corners_px[rows]
    row_corners_m = row_corners_px * spacing_m[rows, None, None]
    added = _axis_charts(row_corners_px, row_corners_m, faces.thing[rows])

    places_px = charts.places_px.copy()
    places_px[rows] = added.places_px + np.array([0, charts.height])
    chart = charts.chart.copy()
    chart[rows] = added.chart + charts.chart.max() + 1
    return _Charts(
        places_px,
        chart,
        width=max(charts.width, added.width),
        height=charts.height + added.height,
    )


def _axis_charts(corners_px: Array, corners_m: Array, thing: Indices) -> _Charts:
    """The charts of faces with corners (F, 3, 3), by projection along the coordinate axes.

    A chart contains connected faces of one thing (F,) whose normals are nearest to the same axis direction.
    """
    first_edge = corners_px[:, 1] - corners_px[:, 0]
    second_edge = corners_px[:, 2] - corners_px[:, 0]
    side = nearest_axis(np.cross(first_edge, second_edge))
    _, vertex = _welded(corners_m, thing.astype(np.int64), side)
    chart = _connected_components(vertex)

    # (F, 3, 2): the two coordinates across the axis of the face, for each of its corners
    plane_axes = PLANE_AXES[side // 2]
    projected_px = np.take_along_axis(corners_px, plane_axes[:, None].repeat(3, 1), 2)

    chart_count = int(chart.max()) + 1
    low_px = np.full((chart_count, 2), np.inf)
    high_px = np.full((chart_count, 2), -np.inf)
    for corner in range(3):
        np.minimum.at(low_px, chart, projected_px[:, corner])
        np.maximum.at(high_px, chart, projected_px[:, corner])

    # A chart is stretched to whole texels, so that its outermost samples are on its outline.
    extent_px = high_px - low_px
    size_px = np.maximum(np.ceil(extent_px - 1e-6), 1)
    stretch = size_px / np.maximum(extent_px, 1e-9)
    in_chart_px = (projected_px - low_px[chart, None]) * stretch[chart, None]

    samples = size_px.astype(np.int64) + 1  # along each side, one at both ends
    box_corners_px, width, height = _packed_in_shelves(samples + 2 * PADDING_PX)
    places_px = in_chart_px + box_corners_px[chart, None] + PADDING_PX + 0.5
    return _Charts(places_px, chart, width, height)


def nearest_axis(vectors: Array) -> Rows:
    """The axis direction (N,) that is nearest to each vector (N, 3).

    0 is along the first axis, 1 is against it, 2 and 3 are along and against the second axis, 4 and 5 the third.
    """
    axis = np.abs(vectors).argmax(1)
    component = np.take_along_axis(vectors, axis[:, None], 1)[:, 0]
    return np.asarray(2 * axis + (component < 0))


def _packed_in_shelves(sizes: Rows) -> tuple[Rows, int, int]:
    """Pack boxes with sizes (N, 2) in shelves, the tallest first: one row of boxes after another.

    Returns the lowest corners (N, 2) of the boxes, and the width and the height of all shelves together.
    """
    square_side = np.sqrt(sizes.prod(1).sum())
    width = int(max(square_side, sizes[:, 0].max()))
    corners = np.zeros_like(sizes)
    column = 0
    row = 0
    shelf_height = 0
    # Boxes of one height are sorted by their width, and equal boxes by their index.
    tallest_first = np.lexsort((np.arange(len(sizes)), -sizes[:, 0], -sizes[:, 1]))
    for index in tallest_first:
        box_width, box_height = sizes[index].tolist()
        if column + box_width > width:
            column = 0
            row += shelf_height
            shelf_height = 0
        corners[index] = column, row
        column += box_width
        shelf_height = max(shelf_height, box_height)
    return corners, width, row + shelf_height


# Faces without a chart of their own.


def _with_thin_faces(charts: _Charts, faces: Triangles, lit: Mask) -> _Charts:
    """Place the lit faces (F,) that are too thin for a chart on one point: a corner that they share with a placed face.

    A thin face without such a neighbour is not placed.
    """
    thin = np.flatnonzero(lit & (charts.chart < 0))
    if not len(thin):
        return charts

    # A corner is identified by its index in the flat list of the corners of all faces: 3 * face + corner.
    _, vertex = _welded(faces.corners_m, faces.thing.astype(np.int64))
    placed = np.flatnonzero(charts.chart >= 0)
    placed_corner = np.full(vertex.max() + 1, -1)  # (V,): a corner of a placed face at each vertex
    placed_corner[vertex[placed]] = 3 * placed[:, None] + np.arange(3)

    corner = placed_corner[vertex[thin]].max(1)  # (N,), -1 for none
    has_neighbour = corner >= 0
    rows = thin[has_neighbour]
    corner = corner[has_neighbour]
    places_px = charts.places_px.copy()
    places_px[rows] = charts.places_px.reshape(-1, 2)[corner, None]
    chart = charts.chart.copy()
    chart[rows] = charts.chart[corner // 3]
    return replace(charts, places_px=places_px, chart=chart)


def _with_shared_blocks(charts: _Charts, block: Indices) -> Atlas:
    """The atlas of all faces. Faces without a chart are placed at the middle of their block (F,), below the charts."""
    blocks_top = charts.height + PADDING_PX
    width = max(charts.width, BLOCK_PX)
    blocks_per_row = width // BLOCK_PX
    column = block % blocks_per_row * BLOCK_PX + BLOCK_PX / 2
    row = block // blocks_per_row * BLOCK_PX + BLOCK_PX / 2 + blocks_top
    middle_px = np.stack([column, row], -1)
    block_rows = int(block.max(initial=0)) // blocks_per_row + 1
    height = blocks_top + BLOCK_PX * block_rows

    has_no_chart = (charts.chart < 0)[:, None, None]
    places_px = np.where(has_no_chart, middle_px[:, None], charts.places_px)
    rounded_px = np.rint(places_px * STEPS_PER_TEXEL) / STEPS_PER_TEXEL
    return Atlas(rounded_px.astype(np.float32), charts.chart, height, width)


# Connected faces.


def _welded(corners_m: Array, *labels: NDArray[np.int64]) -> tuple[Rows, Rows]:
    """Merge corners (F, 3, 3) at the same position to vertices.

    Corners of faces with different labels (F,) are not merged.
    Returns the first corner (V,) of each vertex in the flat list of corners, and the vertices (F, 3) of each face.
    """
    cells = np.rint(corners_m / WELD_M).astype(np.int64).reshape(-1, 3)
    corner_labels = [np.repeat(label, 3) for label in labels]
    keys = np.column_stack([cells, *corner_labels])
    first_corner, vertex = distinct_rows(keys)
    return first_corner, vertex.reshape(-1, 3)


def _connected_components(vertex: Rows) -> Indices:
    """The component (F,) of each face, from 0, by its vertices (F, 3). Faces that share a vertex are connected."""
    # The nodes of the graph are the faces, followed by the vertices. Its edges lead from faces to their vertices.
    face_count = len(vertex)
    node_count = face_count + int(vertex.max()) + 1
    face_nodes = np.repeat(np.arange(face_count), 3)
    vertex_nodes = face_count + vertex.ravel()
    edges = np.ones(vertex.size, np.int8)
    graph = scipy.sparse.coo_matrix((edges, (face_nodes, vertex_nodes)), (node_count, node_count))

    _, node_component = scipy.sparse.csgraph.connected_components(graph, directed=False)
    # Components of unused vertices are removed from the numbering.
    _, component = np.unique(node_component[:face_count], return_inverse=True)
    return component.astype(np.int32)
