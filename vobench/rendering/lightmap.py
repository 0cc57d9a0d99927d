"""The light map: where each face's light is kept, and the texels it is computed at."""

import ctypes
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench import stop
from vobench.errors import RenderError
from vobench.geometry.se3 import Array
from vobench.rendering.geometry import Floats, Indices, Mask, RayCaster, Visibility, face_materials, lengths, off, take
from vobench.scene.material import Material, fresnel
from vobench.scene.mesh import WELD_M, Triangles, areas_m2, distinct, unit

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Places = NDArray[np.int64]
TEXELS = 16_000_000  # at most in one map: some 100 bytes each, and 4 more for each light
FINENESS = 4096  # steps a texel: places that are meant to be amid texels are so to the last bit
PADDING = 1  # texels around a chart, besides those that interpolation within it reads


@dataclass(frozen=True, slots=True)
class Atlas:
    """Places of faces' corners on the map in texels, light_px (F, 3, 2), row 0 first; chart (F,) that each is in.

    Faces that keep no light of their own have chart -1: those of one lamp share a block of 3 x 3 texels, and all
    others one that stays dark. A chart's outermost texels have their middles on its outline's box.
    """

    light_px: Floats
    chart: Indices
    height: int
    width: int

    @property
    def light_uv(self) -> Floats:
        """The places (F, 3, 2) float32 in [0, 1]."""
        return (self.light_px / (self.width, self.height)).astype(np.float32)

    def index(self, places_px: Floats) -> Places:
        """The flat index (R,) of the texel at places (R, 2)."""
        column, row = np.floor(places_px).astype(np.int64).T
        return np.asarray(np.clip(row, 0, self.height - 1) * self.width + np.clip(column, 0, self.width - 1))

    def read(self, light: Floats, face: Indices, u: Floats, v: Floats) -> Floats:
        """What a picture shows (R, ...) of a map (H, W, ...) at places of faces: between the four nearest texels."""
        a, b, c = self.light_px[face].astype(float).swapaxes(0, 1)
        first, share = np.divmod(a + u[:, None] * (b - a) + v[:, None] * (c - a) - 0.5, 1)
        flat = light.reshape(self.height * self.width, -1)
        total = np.zeros((len(share), flat.shape[1]))
        for right, below in ((0, 0), (1, 0), (0, 1), (1, 1)):
            weight = np.abs(1 - right - share[:, 0]) * np.abs(1 - below - share[:, 1])
            total += weight[:, None] * flat[self.index(first + np.array([right, below]))]
        return total.reshape(len(share), *light.shape[2:])

    def block(self, face: int) -> tuple[slice, slice]:
        """The texels that a lamp's faces share."""
        column, row = np.floor(self.light_px[face, 0]).astype(int)
        return slice(row - 1, row + 2), slice(column - 1, column + 2)


def unwrap(faces: Triangles, spacing_m: Array, lit: Mask) -> Atlas:
    """Charts of the lit faces (F,) with samples every spacing_m (F,), and below them the shared blocks.

    Raises RenderError where the map would be too large.
    """
    needed = float((areas_m2(faces.corners_m) / spacing_m**2)[lit].sum())
    if needed > TEXELS:
        raise RenderError(
            f"the light map would need {needed / 1e6:.0f} million samples; {TEXELS / 1e6:.0f} million are the most: "
            f"give its largest things {np.sqrt(needed / TEXELS):.1f} times the spacing_m"
        )
    px = (faces.corners_m - faces.corners_m.reshape(-1, 3).min(0)) / spacing_m[:, None, None]
    places, chart, width, height = _by_xatlas(px, spacing_m, _parts(faces.thing, spacing_m, np.flatnonzero(lit)))
    left = np.flatnonzero(lit & (chart < 0) & (areas_m2(px) > 1e-6))
    if len(left):
        more, own, wide, high = axis_charts(px[left], px[left] * spacing_m[left, None, None], faces.thing[left])
        places[left] = more + np.array([0, height])
        chart[left] = own + chart.max() + 1
        width = max(width, wide)
        height = height + high
    _settle(faces, places, chart, np.flatnonzero(lit & (chart < 0)))
    height += PADDING
    width = max(width, 3)
    block = faces.lamp + 1
    shared = np.stack([block % (width // 3) * 3 + 1.5, block // (width // 3) * 3 + 1.5 + height], -1)
    places[chart < 0] = shared[chart < 0, None]
    height += 3 * (int(block.max(initial=0)) // (width // 3) + 1)
    return Atlas((np.rint(places * FINENESS) / FINENESS).astype(np.float32), chart, height, width)


def _parts(thing: Indices, spacing_m: Array, some: Places) -> list[Places]:
    """Some faces thing by thing, each with one spacing."""
    order = some[np.lexsort((spacing_m[some], thing[some]))]
    new = (np.diff(thing[order]) != 0) | (np.diff(spacing_m[order]) != 0)
    return np.split(order, np.flatnonzero(new) + 1) if len(order) else []


def _by_xatlas(px: Array, spacing_m: Array, parts: Sequence[Places]) -> tuple[Array, Indices, int, int]:
    """Places (F, 3, 2) and charts (F,) of parts, -1 for none, the map's width and height; nothing without xatlas."""
    places = np.zeros((len(px), 3, 2))
    chart = np.full(len(px), -1, np.int32)
    try:
        import xatlas
    except ImportError:  # Python 3.14 has none yet
        return places, chart, 0, 0
    atlas = xatlas.Atlas()
    _keep_for_ever(atlas)
    packing = xatlas.PackOptions()
    added = []
    count = 0
    packing.texels_per_unit = 1.0
    packing.padding = PADDING
    packing.bilinear = True
    for part in parts:
        first, of = _welded(px[part] * spacing_m[part, None, None])
        whole = (of != np.roll(of, 1, axis=1)).all(1)
        if whole.any():
            vertices = px[part].reshape(-1, 3)[first]
            atlas.add_mesh((vertices - vertices.min(0)).astype(np.float32), of[whole].astype(np.uint32))
            added.append(part[whole])
    stop.check()
    atlas.generate(xatlas.ChartOptions(), packing)
    for nth, part in enumerate(added):
        _, index, uv = atlas[nth]
        places[part] = (uv * (atlas.width, atlas.height))[index]
        has_place = np.abs(turns_px2(places[part])) > 1e-9
        own = _connected(index.astype(np.int64))
        chart[part] = np.where(has_place, own + count, -1)
        count += own.max() + 1
    return places, chart, atlas.width, atlas.height


def _keep_for_ever(atlas: object) -> None:
    """Never destroy an atlas of xatlas, which may wait for ever when it is destroyed.

    Its scheduler sets a flag and notifies its threads without holding their lock. A thread that has just looked at the
    flag misses both, and the scheduler joins it in vain. Seen once, in a run of all tests. What is kept is the
    memory of one unwrapped scene and its idle threads; a bake has a process of its own.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(atlas))


def _welded(corners_m: Array, *also: NDArray[np.int64]) -> tuple[Places, Places]:
    """Of corners (F, 3, 3) the first (V,) of those at one place, and which each is (F, 3); `also` (F,) keeps apart."""
    keys = np.rint(corners_m / WELD_M).astype(np.int64).reshape(-1, 3)
    keys = np.column_stack([keys, *(np.repeat(other, 3) for other in also)])
    first, of = distinct(keys)
    return first, of.reshape(-1, 3)


def _connected(index: Places) -> Indices:
    """Which of the groups that share vertices each face is in (F,), by its vertices (F, 3)."""
    count = len(index) + int(index.max()) + 1
    links = (np.repeat(np.arange(len(index)), 3), index.ravel() + len(index))
    graph = scipy.sparse.coo_matrix((np.ones(index.size, np.int8), links), (count, count))
    labels = scipy.sparse.csgraph.connected_components(graph, directed=False)[1][: len(index)]
    return np.unique(labels, return_inverse=True)[1].astype(np.int32)


def axis_charts(px: Array, corners_m: Array, thing: Indices) -> tuple[Array, Indices, int, int]:
    """Charts of connected faces that look the same of six ways, seen from there: for what xatlas leaves.

    px (F, 3, 3): corners in texels. Returns places (F, 3, 2), charts (F,), width and height.
    """
    side = side_of(np.cross(px[:, 1] - px[:, 0], px[:, 2] - px[:, 0]))
    chart = _connected(_welded(corners_m, thing.astype(np.int64), side)[1])
    axes = np.array([[1, 2], [0, 2], [0, 1]])[side // 2]
    flat = np.take_along_axis(px, axes[:, None].repeat(3, 1), 2)
    count = int(chart.max()) + 1
    low = np.full((count, 2), np.inf)
    high = np.full((count, 2), -np.inf)
    for nth in range(3):
        np.minimum.at(low, chart, flat[:, nth])
        np.maximum.at(high, chart, flat[:, nth])
    size = np.maximum(np.ceil(high - low - 1e-6), 1)
    flat = (flat - low[chart, None]) * (size / np.maximum(high - low, 1e-9))[chart, None]
    corner, width, height = _shelves(size.astype(np.int64) + 1 + 2 * PADDING)
    return flat + corner[chart, None] + PADDING + 0.5, chart, width, height


def side_of(vectors: Array) -> Places:
    """Which of six ways vectors (N, 3) point most: 0 and 1 along the first axis and against it, and so on."""
    axis = np.abs(vectors).argmax(1)
    return np.asarray(2 * axis + (np.take_along_axis(vectors, axis[:, None], 1)[:, 0] < 0))


def _shelves(sizes: Places) -> tuple[Places, int, int]:
    """Corners (N, 2) of boxes (N, 2) in shelves, tallest first, and the width and height of them all."""
    width = int(max(np.sqrt(sizes.prod(1).sum()), sizes[:, 0].max()))
    corners = np.zeros_like(sizes)
    column = 0
    row = 0
    shelf = 0
    for index in np.lexsort((np.arange(len(sizes)), -sizes[:, 0], -sizes[:, 1])):
        wide, high = sizes[index].tolist()
        if column + wide > width:
            column = 0
            row = row + shelf
            shelf = 0
        corners[index] = column, row
        column = column + wide
        shelf = max(shelf, high)
    return corners, width, row + shelf


def turns_px2(places: Array) -> Array:
    """Twice the areas (F,) of triangles (F, 3, 2), negative where they run clockwise."""
    (a, b), (c, d) = (places[:, i].T - places[:, 0].T for i in (1, 2))
    return np.asarray(a * d - b * c)


def _settle(faces: Triangles, places: Array, chart: Indices, lost: Places) -> None:
    """Give faces too thin for a place that of a neighbour's corner."""
    if not len(lost):
        return
    _, of = _welded(faces.corners_m, faces.thing.astype(np.int64))
    found = np.full(of.max() + 1, -1)
    good = np.flatnonzero(chart >= 0)
    found[of[good]] = 3 * good[:, None] + np.arange(3)
    source = found[of[lost]].max(1)
    has = source >= 0
    places[lost[has]] = places.reshape(-1, 2)[source[has], None]
    chart[lost[has]] = chart[source[has] // 3]


CLAIMED_PX = 0.7072  # half a texel's diagonal: every place of a face is nearest to a texel that counts as its own
READ_PX = 1.4143  # from a face, texels that interpolation on it can read
PAIRS = 1 << 14  # of faces and texels at once: their arrays fit the processor's cache


@dataclass(frozen=True, slots=True)
class Owners:
    """For each texel (H·W,) the nearest face on the map within READ_PX, -1 for none, u and v there, and how far."""

    face: Indices
    uv: Floats
    apart_px: Floats


def owners(atlas: Atlas) -> Owners:
    """Lay the faces that have charts over the texels."""
    count = atlas.height * atlas.width
    result = Owners(np.full(count, -1, np.int32), np.zeros((count, 2), np.float32), np.full(count, READ_PX, np.float32))
    corners = atlas.light_px.astype(float)
    low = np.maximum(np.ceil(corners.min(1) - READ_PX - 0.5), 0).astype(np.int64)
    high = np.minimum(np.floor(corners.max(1) + READ_PX - 0.5) + 1, (atlas.width, atlas.height)).astype(np.int64)
    size = np.where(((atlas.chart >= 0) & (turns_px2(corners) != 0))[:, None], high - low, 0)
    ends = np.cumsum(size.prod(1))
    last = int(ends[-1]) if len(ends) else 0
    cuts = np.unique(np.searchsorted(ends, np.arange(PAIRS, last + PAIRS, PAIRS)) + 1)
    for some in np.split(np.arange(len(corners)), cuts):
        stop.check()
        counts = size[some].prod(1)
        which = np.repeat(some, counts)
        nth = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
        row = low[which, 1] + nth // size[which, 0]
        column = low[which, 0] + nth % size[which, 0]
        uv, apart = _nearest_on(corners[which], np.stack([column, row], -1) + 0.5)
        texel = row * atlas.width + column
        order = np.flatnonzero(apart < result.apart_px[texel])
        order = order[np.argsort(-apart[order], kind="stable")]  # of several the last one counts
        texel = texel[order]
        result.face[texel] = which[order]
        result.uv[texel] = uv[order]
        result.apart_px[texel] = apart[order]
    return result


def _nearest_on(corners: Array, points: Array) -> tuple[Array, Array]:
    """The nearest places of triangles (N, 3, 2) to points (N, 2): weights (N, 2) of corners two and three, distance.

    What is farther than READ_PX from the line of an edge is infinitely far.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    ways = points[:, None] - corners
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    across = edges[..., 0] * ways[..., 1] - edges[..., 1] * ways[..., 0]
    inwards = across * np.sign(area)[:, None]
    squared = np.einsum("nij,nij->ni", edges, edges)
    inside = (inwards >= 0).all(1) & (area != 0)
    is_near = ((inwards > 0) | (inwards**2 <= READ_PX**2 * squared)).all(1)
    # The first edge lies across from the third corner.
    weights = np.roll(across, -1, axis=1) / np.where(area == 0, 1, area)[:, None]
    apart = np.where(inside, 0, np.inf)
    some = np.flatnonzero(is_near & ~inside)
    weights[some], apart[some] = _nearest_on_edges(edges[some], ways[some], squared[some])
    return weights[:, 1:], apart


def _nearest_on_edges(edges: Array, ways: Array, squared: Array) -> tuple[Array, Array]:
    """Weights (N, 3) of corners, and distance, of the nearest places on edges (N, 3, 2) to points."""
    along = np.clip(np.einsum("nij,nij->ni", ways, edges) / np.maximum(squared, 1e-12), 0, 1)
    apart = np.linalg.norm(ways - along[..., None] * edges, axis=-1)
    nearest = apart.argmin(1)
    each = np.arange(len(edges))
    weights = np.zeros((len(edges), 3))
    weights[each, nearest] = 1 - along[each, nearest]
    weights[each, (nearest + 1) % 3] = along[each, nearest]
    return weights, apart[each, nearest]


T = TypeVar("T")
TILTS = ((0.0, 0.0), (1.0, 0.4), (-1.0, -0.3), (0.3, -1.0), (-0.4, 1.0))  # of rays that search a way out
CHUNK = 1 << 14  # points at once: their arrays fit the processor's cache
PULLED_M = 1e-3  # points at a chart's rim lie so far inwards, where they see past the neighbour
FACING = 0.1  # cosine to its flat face from which a normal of the shape counts
# of faces that touch: cosine to an axis, how deep in the thing they are looked for
ALIGNED = 0.999
CONTACT_M = 4e-4
STRAIGHT = np.cos(np.deg2rad(1.5))  # between texels that lie in one plane


@dataclass(frozen=True, slots=True)
class Texels:
    """P points: position, normal of the shape and of the flat face, steps to the next along u and v, all (P, 3).

    A step is 0 where the texel lies at a rim. index (P,) is flat in the map, face (P,) in the table, uv (P, 2) its
    place there; eta (P,) of the coat, 0 for none; dither (P, 2) in [0, 1) turns each point's pattern of rays.
    """

    points_m: Floats
    normals: Floats
    planes: Floats
    step_u_m: Floats
    step_v_m: Floats
    index: Places
    face: Indices
    uv: Floats
    eta: Floats
    dither: Floats

    def __len__(self) -> int:
        return len(self.index)

    take = take

    def entering(self, cosine: Floats) -> Floats:
        """Share (..., P) of light that arrives at a cosine (..., P) and passes the coat, 1 where there is none."""
        share = np.ones(cosine.shape, np.float32)
        coated = np.flatnonzero(self.eta)
        share[..., coated] -= fresnel(cosine[..., coated], self.eta[coated]).astype(np.float32)
        return share

    def cosine(self, way: Floats) -> Floats:
        """Cosine (..., P) of the angle between each normal and a way (..., P, 3), 0 from behind the face."""
        before = np.einsum("...ij,ij->...i", way, self.planes) > 0
        return np.asarray(before * np.einsum("...ij,ij->...i", way, self.normals) / lengths(way))


@dataclass(frozen=True, slots=True)
class Layout:
    """How P points lie on a map of a height and width.

    source (H·W,) is the point that each texel takes its value from, P for none: texels beside a face are read by
    interpolation, and those inside things have the light of the nearest of their chart, so that no darkness reaches
    out. beside (4, P) are the points left, right, above and below in the same chart, the point itself for none.
    few (P,): every other point along rows and columns, and those that have none of these beside them; weights (P, P)
    make all points' values of theirs.
    """

    height: int
    width: int
    source: Indices
    beside: Indices
    few: Mask
    weights: "csr_array"

    def filled(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values (P, ...) as a map (H, W, ...)."""
        padded = np.concatenate([values, np.zeros((1, *values.shape[1:]), values.dtype)])
        return padded[self.source].reshape(self.height, self.width, *values.shape[1:])

    def near(self, marked: Mask, *, steps: int) -> Mask:
        """Points (P,) that some texels' steps lead to from a marked one."""
        for _ in range(steps):
            marked = np.logical_or.reduce([marked, *(marked[other] for other in self.beside)])
        return marked

    def between(self, values: Floats) -> Floats:
        """Values (P,) known at the few points, at all of them."""
        return np.asarray(self.weights @ values)

    def blurred(self, values: Floats) -> Floats:
        """Values (P,) smoothed by about one texel, each chart by itself."""
        left, right, above, below = self.beside
        for _ in range(2):
            values = (2 * values + values[left] + values[right]) / 4
            values = (2 * values + values[above] + values[below]) / 4
        return values


def texels(
    faces: Triangles,
    materials: Mapping[str, Material],
    atlas: Atlas,
    own: Owners,
    *,
    among: Mask,
    seed: int,
    visibility: Visibility | None = None,
) -> tuple[Texels, Layout]:
    """The points of some faces (F,) that light can show on; with a visibility those that lie in no thing."""
    index = np.flatnonzero((own.face >= 0) & (own.apart_px <= CLAIMED_PX) & among[own.face])
    beside = _beside(index, atlas, own)
    etas = np.array([m.eta if m and m.is_coated else 0.0 for m in face_materials(faces, materials)], np.float32)
    dither = np.random.default_rng([seed, 1]).random((atlas.height * atlas.width, 2), dtype=np.float32)
    face = own.face[index]
    vectors = np.empty((5, len(index), 3), np.float32)

    def place(part: slice) -> None:
        on = face[part]
        uv = own.uv[index[part]]
        rim = beside[:, part] == np.arange(len(index))[part]
        weights = np.column_stack([1 - uv.sum(1), uv])
        planes = faces.plane[on]
        steps = _steps(faces.corners_m[on], atlas.light_px[on].astype(float))
        points = off(np.einsum("ni,nij->nj", weights, faces.corners_m[on]) + _inwards(steps, rim), planes)
        normals = unit(np.einsum("ni,nij->nj", weights, faces.normals[on]))
        normals = np.where(np.einsum("ij,ij->i", normals, planes)[:, None] > FACING, normals, planes)
        vectors[:, part] = points, normals, planes, *steps

    in_chunks(place, len(index))
    p, n, g, u, v = vectors
    every = Texels(p, n, g, u, v, index, face, own.uv[index], etas[faces.thing[face]], dither[index])
    inside = np.zeros(len(index), bool)
    if visibility is not None:
        inside = chunked(lambda part: _buried(every.take(part), visibility), len(every)) | _covered(every, visibility)
    return _kept(every, atlas, own, beside, kept=~inside, visibility=visibility)


def _inwards(steps: tuple[Array, Array], missing: Mask) -> Array:
    """How far points (P, 3) move from a chart's rim, where neighbours (4, P) on four sides are missing."""
    ways = [(missing[2 * i] * 1.0 - missing[2 * i + 1])[:, None] * unit(step) for i, step in enumerate(steps)]
    return np.asarray(PULLED_M * (ways[0] + ways[1]))


def _beside(index: Places, atlas: Atlas, own: Owners) -> Indices:
    """The points (4, P) left, right, above and below of those at flat places (P,) in the same chart, else itself."""
    point = np.full(atlas.height * atlas.width, -1, np.int32)
    point[index] = np.arange(len(index))
    chart = atlas.chart[own.face[index]]
    column = index % atlas.width
    found = np.empty((4, len(index)), np.int32)
    for nth, step in enumerate((-1, 1, -atlas.width, atlas.width)):
        other = point[np.clip(index + step, 0, len(point) - 1)]
        adjoins = np.abs(column[other] - column) == 1 if nth < 2 else np.abs(index[other] - index) == atlas.width
        found[nth] = np.where((other >= 0) & (chart[other] == chart) & adjoins, other, np.arange(len(index)))
    return found


def _steps(corners_m: Array, places: Array) -> tuple[Array, Array]:
    """What one texel along u and v is (P, 3) on faces with corners (P, 3, 3) and places (P, 3, 2)."""
    (a, b), (c, d) = (places[:, i].T - places[:, 0].T for i in (1, 2))
    area = turns_px2(places)
    area = np.where(np.abs(area) < 1e-9, np.inf, area)[:, None]
    first, second = (corners_m[:, i] - corners_m[:, 0] for i in (1, 2))
    return (d[:, None] * first - b[:, None] * second) / area, (a[:, None] * second - c[:, None] * first) / area


def _buried(points: Texels, visibility: Visibility) -> Mask:
    """Which points (P,) see only backs of faces, as does the floor under a crate."""
    inside = np.ones(len(points), bool)
    for a, b in TILTS:
        some = np.flatnonzero(inside)
        p = points.take(some)
        u_axis, v_axis = tangents(p.planes)
        along = a * u_axis + b * v_axis + p.planes
        face = visibility.opaque.nearest(p.points_m, along)
        behind = np.einsum("ij,ij->i", along, visibility.normals[face]) > 0
        inside[some] = (face >= 0) & behind & (visibility.faces.lamp[face] < 0)
    return inside


def _covered(points: Texels, visibility: Visibility) -> Mask:
    """Which points (P,) lie on a face that looks the other way, as does the bottom of a crate on the floor.

    Only where both look along an axis. Raised off their face they are beyond the other, outside in the sky for all
    that rays tell.
    """
    covered = np.zeros(len(points), bool)
    solid = visibility.opaque.solid
    for axis, sign in np.ndindex(3, 2):
        along = 2 * sign - 1
        some = np.flatnonzero(along * points.planes[:, axis] > ALIGNED)
        others = solid[along * visibility.faces.plane[solid, axis] < -ALIGNED]
        if len(some) and len(others):
            caster = RayCaster(visibility.faces, others)
            p = points.points_m[some]
            way = points.planes[some] * CONTACT_M
            covered[some] = caster.stops(p - way, way)
    return covered


def _kept(
    points: Texels, atlas: Atlas, own: Owners, beside: Indices, *, kept: Mask, visibility: Visibility | None
) -> tuple[Texels, Layout]:
    """Those of the points that are kept (P,), and how they fill the map."""
    number = np.where(kept, np.cumsum(kept) - 1, -1)
    takes = np.append(number[_takes(beside, kept)], -1)
    place = np.full(atlas.height * atlas.width, len(points))
    place[points.index] = np.arange(len(points))
    # A texel beside a face reads the one that the nearest place of the face lies in.
    read = np.flatnonzero((own.face >= 0) & (place == len(points)))
    weights = np.column_stack([1 - own.uv[read].sum(1), own.uv[read]])
    place[read] = place[atlas.index(np.einsum("ni,nij->nj", weights, atlas.light_px[own.face[read]]))]
    source = takes[place]
    few = points.take(kept)
    near = number[beside[:, kept]]
    near = np.where(near < 0, np.arange(len(few)), near).astype(np.int32)
    straight = (near != np.arange(len(few))) & (np.einsum("nij,ij->ni", few.planes[near], few.planes) > STRAIGHT)
    for first, second in ((0, 1), (2, 3)):
        if visibility is None:
            break
        # A texel that reaches behind a thin wall has its light from its middle alone.
        hidden = chunked(partial(_hidden, few.points_m, near[second], visibility), len(few))
        straight[second] &= ~hidden
        straight[first] &= ~hidden[near[first]]
    few.step_u_m[~straight[:2].all(0)] = 0
    few.step_v_m[~straight[2:].all(0)] = 0
    every_other = _few(few.index, near, atlas.width)
    source = np.where(source < 0, len(few), source).astype(np.int32)
    layout = Layout(atlas.height, atlas.width, source, near, every_other, _weights(every_other, near))
    return few, layout


def _weights(few: Mask, beside: Indices) -> "csr_array":
    """Weights (P, P) that make all points' values of the few's: along rows first, then along columns."""
    known = few
    result = scipy.sparse.diags_array(few.astype(np.float32), format="csr")
    for sides in (beside[:2], beside[2:]):
        weight = known[sides[0]].astype(np.float32) + known[sides[1]]
        own, new = (np.flatnonzero(some).astype(np.int32) for some in (known, ~known & (weight > 0)))
        pairs = [(new[known[side[new]]], side) for side in sides]
        rows = np.concatenate([own, *(one for one, _ in pairs)])
        columns = np.concatenate([own, *(side[one] for one, side in pairs)])
        shares = np.where(known[rows], np.float32(1), 1 / np.maximum(weight[rows], 1))
        step = scipy.sparse.csr_array((shares.astype(np.float32), (rows, columns)), (len(known), len(known)))
        result = step @ result
        known = known | (weight > 0)
    return result


def _hidden(points_m: Floats, others: Indices, visibility: Visibility, part: slice) -> Mask:
    return visibility.opaque.occluded(points_m[part], points_m[others[part]])


def _few(index: Places, beside: Indices, width: int) -> Mask:
    """Every other point along rows and columns, and at rims those that would have one neighbour's value alone."""
    at_rim = beside == np.arange(len(index))
    along_row = (index % width % 2 == 0) | at_rim[:2].any(0)
    few = along_row & ((index // width % 2 == 0) | at_rim[2:].any(0))
    known = few
    for first, second in (beside[:2], beside[2:]):
        known = known | known[first] | known[second]
    return np.asarray(few | ~known)


def _takes(beside: Indices, kept: Mask) -> Places:
    """For each point (P,) itself where it is kept, else the nearest kept one by steps within its chart, or itself."""
    takes = np.arange(len(kept))
    open_ = np.flatnonzero(~kept)
    known = kept.copy()
    while len(open_):
        found = [np.where(known[other], takes[other], -1) for other in beside[:, open_]]
        best = np.max(found, axis=0)
        done = best >= 0
        if not done.any():
            break
        takes[open_[done]] = best[done]
        known[open_[done]] = True
        open_ = open_[~done]
    return takes


def tangents(normals: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (P, 3) each, square to the normals and to each other."""
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]).astype(normals.dtype)
    u = np.cross(helper, normals)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(normals, u)


def in_chunks(
    work: Callable[[slice], T], count: int, *, chunk: int = CHUNK, done: Callable[[float], object] | None = None
) -> list[T]:
    """What `work` gives for each slice of `count` things, in order, on all cores; `done` is called with shares."""
    slices = [slice(start, min(start + chunk, count)) for start in range(0, count, chunk)]

    def checked(part: slice) -> T:
        stop.check()
        return work(part)

    if len(slices) == 1:
        return [checked(slices[0])]
    results = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for result in pool.map(checked, slices):
            results.append(result)
            if done:
                done(len(results) / len(slices))
    return results


def chunked(work: Callable[[slice], NDArray[Any]], count: int) -> NDArray[Any]:
    """What `work` gives for slices of `count` things, one after the other (count, ...), on all cores."""
    return np.concatenate(in_chunks(work, count) or [work(slice(0, 0))])
