"""Tiles of faces that the edge of a sun's shadow crosses: light is sampled finely there, and coarsely elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.geometry import FAR_M, RayCaster, offset_from_surface
from vobench.rendering.unwrap import nearest_axis
from vobench.scene.triangles import Triangles

TILE_SAMPLES = 24  # along the side of a tile, at the spacing of coarse samples
MARGIN_SAMPLES = 2  # around a tile, in which an edge makes it fine
SMALL_M2 = 10.0  # of a thing that is not divided: all of it is fine if any edge crosses it
OUTLINE_SAMPLES = 0.5  # from the outline of a large face, where it may reach behind what adjoins it
LEAST_SIDES = 0.25  # of a tile's side that a face must extend to be divided
LEAST_SHARE = 1e-9  # of a face that a part of it is
GOLDEN = np.array([0.7548776662, 0.5698402910])  # steps of a sequence that fills the unit square: Roberts (2018), R2
IN_PLANE = np.array([[1, 2], [0, 2], [0, 1]])  # the other two axes of each axis


@dataclass(frozen=True, slots=True)
class FaceParts:
    """Faces, some of which are divided: `parent` (T,) is the face that each is, or that it is a part of.

    weights (T, 3, 3): what each corner of the parent counts at each corner of the part.
    """

    parent: Indices
    weights: Array

    @classmethod
    def whole(cls, count: int) -> "FaceParts":
        """Faces that are not divided."""
        return cls(np.arange(count, dtype=np.int32), np.broadcast_to(np.eye(3), (count, 3, 3)))

    def of(self, faces: Triangles) -> Triangles:
        """The table of the parts of the faces of a table."""

        def at_corners(values: Array) -> Array:
            return np.asarray(np.einsum("tij,tjk->tik", self.weights, values[self.parent]))

        return replace(
            faces,
            corners_m=at_corners(faces.corners_m),
            normals=at_corners(faces.normals),
            uv=at_corners(faces.uv),
            plane=faces.plane[self.parent],
            thing=faces.thing[self.parent],
            mover=faces.mover[self.parent],
            lamp=faces.lamp[self.parent],
        )


def sunlit_parts(
    faces: Triangles,
    is_receiver: Mask,
    is_opaque: Mask,
    sun_directions: Sequence[Array],
    spacing_m: Array,
) -> tuple[FaceParts, Mask]:
    """Parts of the faces (F,), and which of these (T,) the edge of a shadow crosses, for suns in some directions.

    Only faces of the mask `is_receiver` (F,) are divided; those of `is_opaque` (F,) cast shadows. `spacing_m` (F,) is
    the distance between coarse samples. A single probe for each coarse sample tells whether it is lit.
    """
    whole = FaceParts.whole(len(faces))
    is_towards = np.zeros(len(faces), bool)
    for direction in sun_directions:
        is_towards |= faces.plane @ direction > 0
    receivers = np.flatnonzero(is_receiver & is_towards)
    if not len(receivers):
        return whole, np.zeros(len(faces), bool)

    thing_m2 = np.bincount(faces.thing, areas_m2(faces.corners_m))
    caster = RayCaster(faces, np.flatnonzero(is_opaque))
    is_sheet = caster.twin[:-1] >= 0
    is_small = (thing_m2[faces.thing] < SMALL_M2) | is_sheet
    probes = _Probes.cast(faces, receivers, spacing_m, caster, sun_directions)

    small_key = 6 * faces.thing.astype(np.int64) + nearest_axis(faces.plane)
    edge_keys = probes.mixed(small_key[probes.face], is_small[probes.face])
    has_edge = is_receiver & is_small & np.isin(faces.thing, edge_keys // 6)

    large = receivers[~is_small[receivers]]
    if not len(large):
        return whole, has_edge
    tiles = _Tiles.around(faces, large, spacing_m)
    is_large_probe = ~is_small[probes.face]
    edge_tiles = tiles.mixed(probes, is_large_probe)
    return _divided(faces, large, tiles, edge_tiles, has_edge)


@dataclass(frozen=True, slots=True)
class _Probes:
    """Points (P, 3) on faces (P,), and whether a sun that they face lights each, or is hidden from it."""

    points_m: Array
    face: Rows
    is_lit: Mask
    is_shaded: Mask

    @classmethod
    def cast(
        cls, faces: Triangles, receivers: Rows, spacing_m: Array, caster: RayCaster, sun_directions: Sequence[Array]
    ) -> "_Probes":
        """Probes as dense as coarse samples, spread evenly over each of the receivers (N,)."""
        count = 1 + (areas_m2(faces.corners_m[receivers]) / spacing_m[receivers] ** 2).astype(np.int64)
        face = np.repeat(receivers, count)
        nth = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
        a, b = (0.5 + np.outer(GOLDEN, nth + 1)) % 1
        first_m, second_m, third_m = faces.corners_m[face].swapaxes(0, 1)
        on_far_edge = second_m - first_m + b[:, None] * (third_m - second_m)
        points_m = first_m + np.sqrt(a)[:, None] * on_far_edge
        origins_m = offset_from_surface(points_m, faces.plane[face]).astype(np.float32)
        is_lit = np.zeros(len(face), bool)
        is_shaded = np.zeros(len(face), bool)
        for direction in sun_directions:
            facing = np.flatnonzero(faces.plane[face] @ direction > 0)
            segments_m = np.broadcast_to((FAR_M * direction).astype(np.float32), (len(facing), 3))
            is_hidden = caster.stops(origins_m[facing], segments_m)
            is_lit[facing[~is_hidden]] = True
            is_shaded[facing[is_hidden]] = True
        return cls(points_m, face, is_lit, is_shaded)

    def mixed(self, keys: Rows, among: Mask) -> Rows:
        """The keys (P,) that probes of the mask `among` (P,) share of which some are lit and some are shaded."""
        return np.intersect1d(keys[among & self.is_lit], keys[among & self.is_shaded])


@dataclass(frozen=True, slots=True)
class _Tiles:
    """Cubes of space in which faces of one thing that look along one axis are in the same tile.

    side_m (F,): the side of the cubes of each face; low (3,) and size (3,): the range of the cubes' numbers.
    """

    faces: Triangles
    side_m: Array
    low: Rows
    size: Rows

    @classmethod
    def around(cls, faces: Triangles, rows: Rows, spacing_m: Array) -> "_Tiles":
        """The tiles of the faces at rows (N,)."""
        side_m = TILE_SAMPLES * spacing_m
        cells = faces.corners_m[rows] / side_m[rows, None, None]
        low = np.floor(cells.min((0, 1))).astype(np.int64) - 1
        size = np.floor(cells.max((0, 1))).astype(np.int64) + 2 - low
        return cls(faces, side_m, low, size)

    def keys(self, face: Rows, cell: Rows) -> Rows:
        """Numbers (P,) of the tiles of faces (P,) in cubes (P, 3)."""
        key = 6 * self.faces.thing[face].astype(np.int64) + nearest_axis(self.faces.plane[face])
        for axis in range(3):
            key = key * self.size[axis] + (cell[:, axis] - self.low[axis])
        return key

    def mixed(self, probes: _Probes, among: Mask) -> Rows:
        """The tiles in which, or in whose margin, some probes are lit and some are shaded."""
        rows = np.flatnonzero(among & ~self._at_outlines(probes))
        face = probes.face[rows]
        place = probes.points_m[rows] / self.side_m[face, None]
        margin = MARGIN_SAMPLES / TILE_SAMPLES
        cell = np.floor(place).astype(np.int64)
        for axis in range(3):
            parts = [(rows, face, place, cell)]
            for step in (-1, 1):
                beyond = np.flatnonzero(np.floor(place[:, axis] + step * margin) == cell[:, axis] + step)
                neighbour = cell[beyond]
                neighbour[:, axis] += step
                parts.append((rows[beyond], face[beyond], place[beyond], neighbour))
            rows, face, place, cell = (np.concatenate(column) for column in zip(*parts, strict=True))
        keys = self.keys(face, cell)
        return np.intersect1d(keys[probes.is_lit[rows]], keys[probes.is_shaded[rows]])

    def _at_outlines(self, probes: _Probes) -> Mask:
        """Which probes (P,) lie at the outline of a face that is larger than a tile.

        There it may reach behind what adjoins it, as does a wall above a ceiling, where the sun lights it unseen.
        """
        rim_m = OUTLINE_SAMPLES / TILE_SAMPLES * self.side_m[probes.face]
        result = np.zeros(len(probes.face), bool)
        for axis in range(3):
            low_m = self.faces.corners_m[:, :, axis].min(1)[probes.face]
            high_m = self.faces.corners_m[:, :, axis].max(1)[probes.face]
            place_m = probes.points_m[:, axis]
            is_at_rim = (place_m < low_m + rim_m) | (place_m > high_m - rim_m)
            result |= is_at_rim & (high_m - low_m > self.side_m[probes.face])
        return result

    def are_among(self, tiles: Rows, parent: Rows, corners_m: Array) -> Mask:
        """Whether any of the tiles that parts (T, 3, 3) of faces (T,) extend over is among the given ones."""
        side_m = self.side_m[parent, None]
        inwards_m = (side_m * MARGIN_SAMPLES / TILE_SAMPLES)[:, :1] / 2
        low_m = corners_m.min(1)
        high_m = corners_m.max(1)
        is_wide = high_m - low_m > 2 * inwards_m
        low = np.floor((low_m + np.where(is_wide, inwards_m, 0)) / side_m).astype(np.int64)
        high = np.floor((high_m - np.where(is_wide, inwards_m, 0)) / side_m).astype(np.int64)
        result = np.zeros(len(parent), bool)
        for corner in np.ndindex(2, 2, 2):
            cell = np.where(np.array(corner, bool), high, low)
            result |= np.isin(self.keys(parent, cell), tiles)
        return result


def _divided(faces: Triangles, large: Rows, tiles: _Tiles, edge_tiles: Rows, has_edge: Mask) -> tuple[FaceParts, Mask]:
    """The faces, of which the large ones (N,) are divided where only some of their tiles have an edge."""
    cut = large[_are_cut(faces, large, tiles.side_m[large])]
    uncut = np.setdiff1d(large, cut)
    parents = [uncut.astype(np.int32)]
    weights = [np.broadcast_to(np.eye(3), (len(uncut), 3, 3))]
    for face in cut:
        for polygon in _polygons(faces.corners_m[face], faces.plane[face], float(tiles.side_m[face])):
            fan = np.stack([np.broadcast_to(polygon[0], polygon[1:-1].shape), polygon[1:-1], polygon[2:]], 1)
            fan = fan[np.abs(np.linalg.det(fan)) > LEAST_SHARE]  # not three corners in a row
            parents.append(np.full(len(fan), face, np.int32))
            weights.append(fan)
    parts = FaceParts(np.concatenate(parents), np.concatenate(weights))
    corners_m = np.einsum("tij,tjk->tik", parts.weights, faces.corners_m[parts.parent])
    is_fine = tiles.are_among(edge_tiles, parts.parent.astype(np.int64), corners_m)

    part_count = np.bincount(parts.parent, minlength=len(faces))
    fine_count = np.bincount(parts.parent, is_fine, len(faces)).astype(np.int64)
    has_edge = has_edge | ((fine_count > 0) & (fine_count == part_count))
    is_divided = (fine_count > 0) & (fine_count < part_count)
    selected = is_divided[parts.parent]
    whole = np.flatnonzero(~is_divided)
    parent = np.concatenate([whole, parts.parent[selected]]).astype(np.int32)
    all_weights = np.concatenate([np.broadcast_to(np.eye(3), (len(whole), 3, 3)), parts.weights[selected]])
    all_fine = np.concatenate([has_edge[whole], is_fine[selected]])
    in_order = np.argsort(parent, kind="stable")
    return FaceParts(parent[in_order], all_weights[in_order]), all_fine[in_order]


def _are_cut(faces: Triangles, rows: Rows, side_m: Array) -> Mask:
    """Whether lines of the grid of tiles (N,) may divide the faces at rows (N,)."""
    place = faces.corners_m[rows] / side_m[:, None, None]
    first_line = np.ceil(place.min(1) + LEAST_SIDES)
    last_line = np.floor(place.max(1) - LEAST_SIDES)
    return np.asarray((first_line <= last_line).any(1))


def _polygons(corners_m: Array, normal: Array, side_m: float) -> list[Floats]:
    """The parts of a triangle (3, 3) in the cells of a grid along the two axes that its normal is farthest from.

    Each is a convex polygon (K, 3) by the weights of the corners.
    """
    polygons: list[Floats] = [np.eye(3)]
    for axis in IN_PLANE[np.abs(normal).argmax()]:
        place = corners_m[:, axis] / side_m
        lowest = place.min() + LEAST_SIDES
        highest = place.max() - LEAST_SIDES
        for line in np.arange(np.ceil(lowest), np.floor(highest) + 1):
            polygons = [part for polygon in polygons for part in _halves(polygon, polygon @ place - line)]
    return polygons


def _halves(polygon: Floats, heights: Floats) -> list[Floats]:
    """The parts of a convex polygon (K, 3) on both sides of a line, by the heights (K,) of its corners over it."""
    if (heights >= 0).all() or (heights <= 0).all():
        return [polygon]
    below = []
    above = []
    for nth, here in enumerate(heights):
        corner = polygon[nth]
        if here <= 0:
            below.append(corner)
        if here >= 0:
            above.append(corner)
        following = (nth + 1) % len(heights)
        there = heights[following]
        if here * there < 0:
            share = here / (here - there)
            crossing = (1 - share) * corner + share * polygon[following]
            below.append(crossing)
            above.append(crossing)
    return [np.array(below), np.array(above)]
