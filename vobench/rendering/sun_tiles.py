"""Tiles of faces that the edge of a sun's shadow crosses. Light is sampled finely in them, and coarsely elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Mask, Rows
from vobench.rendering.face_parts import FaceParts, divided
from vobench.rendering.geometry import FAR_M, RayCaster, offset_from_surface
from vobench.rendering.unwrap import nearest_axis
from vobench.scene.triangles import Triangles

TILE_SAMPLES = 24  # the side of a tile, in distances between coarse samples
MARGIN_SAMPLES = 2  # the margin around a tile, in the same unit: an edge in it makes the tile fine
SMALL_M2 = 10.0  # things with a smaller area are not divided: all of such a thing is fine if an edge crosses it
OUTLINE_SAMPLES = 0.5  # the width of the outline of a large face, whose probes do not count, in the same unit
GOLDEN = np.array([0.7548776662, 0.5698402910])  # steps of a sequence that fills the unit square: Roberts (2018), R2


def sunlit_parts(
    faces: Triangles,
    is_receiver: Mask,
    is_opaque: Mask,
    sun_directions: Sequence[Array],
    spacing_m: Array,
) -> tuple[FaceParts, Mask]:
    """Parts of faces (F,), and whether the edge of a sun's shadow crosses each part (T,).

    Only the faces in the mask `is_receiver` (F,) are divided. Those in `is_opaque` (F,) cast shadows.
    `sun_directions` are unit vectors to the sun, at several times.
    `spacing_m` (F,) is the distance between coarse samples. One ray for each of them finds whether the sun lights it.
    """
    is_facing = np.zeros(len(faces), bool)
    for direction in sun_directions:
        is_facing |= faces.plane @ direction > 0
    receivers = np.flatnonzero(is_receiver & is_facing)
    if not len(receivers):
        return FaceParts.whole(len(faces)), np.zeros(len(faces), bool)

    caster = RayCaster(faces, np.flatnonzero(is_opaque))
    probes = _cast_probes(faces, receivers, spacing_m, caster, sun_directions)
    thing_m2 = np.bincount(faces.thing, areas_m2(faces.corners_m))
    is_sheet = caster.twin[:-1] >= 0
    is_small = (thing_m2[faces.thing] < SMALL_M2) | is_sheet
    has_edge = is_receiver & is_small & np.isin(faces.thing, _small_things_with_edges(faces, probes, is_small))

    large = receivers[~is_small[receivers]]
    if not len(large):
        return FaceParts.whole(len(faces)), has_edge
    tiles = _tiles_around(faces, large, spacing_m)
    edge_tiles = tiles.with_edges(probes, ~is_small[probes.face])
    parts = divided(faces, large, tiles.side_m)
    is_fine = tiles.touch(edge_tiles, parts.parent.astype(np.int64), parts.at_corners(faces.corners_m))
    return _simplified(parts, is_fine, has_edge)


def _simplified(parts: FaceParts, is_fine: Mask, has_edge: Mask) -> tuple[FaceParts, Mask]:
    """Parts of all faces, and whether each is fine. Faces whose parts are all fine or all coarse are not divided.

    `parts` and `is_fine` (T,) are those of the large faces, `has_edge` (F,) is whether a small face is fine.
    """
    face_count = len(has_edge)
    part_count = np.bincount(parts.parent, minlength=face_count)
    fine_count = np.bincount(parts.parent, is_fine, face_count).astype(np.int64)
    is_mixed = (fine_count > 0) & (fine_count < part_count)
    is_fine_face = has_edge | ((fine_count > 0) & (fine_count == part_count))

    simplified, former = parts.with_whole(~is_mixed)
    return simplified, np.where(former < 0, is_fine_face[simplified.parent], is_fine[former])


@dataclass(frozen=True, slots=True)
class _Probes:
    """Points (P, 3) on faces (P,), and whether a sun lights each, and whether a sun that it faces is hidden from it.

    With several directions of the sun, both can be true.
    """

    points_m: Array
    face: Rows
    is_lit: Mask
    is_shaded: Mask

    def mixed(self, keys: Rows, rows: Rows) -> Rows:
        """The keys (K,) that belong both to lit and to shaded ones of the probes at rows (K,)."""
        return np.intersect1d(keys[self.is_lit[rows]], keys[self.is_shaded[rows]])


def _cast_probes(
    faces: Triangles, receivers: Rows, spacing_m: Array, caster: RayCaster, sun_directions: Sequence[Array]
) -> _Probes:
    """Probes that are distributed evenly over the receivers (N,), as densely as coarse samples."""
    count = 1 + (areas_m2(faces.corners_m[receivers]) / spacing_m[receivers] ** 2).astype(np.int64)
    face = np.repeat(receivers, count)
    first_of_face = np.repeat(np.cumsum(count) - count, count)
    number = np.arange(len(face)) - first_of_face  # of a probe on its face
    a, b = (0.5 + np.outer(GOLDEN, number + 1)) % 1
    first_m, second_m, third_m = faces.corners_m[face].swapaxes(0, 1)
    to_far_edge_m = second_m - first_m + b[:, None] * (third_m - second_m)
    points_m = first_m + np.sqrt(a)[:, None] * to_far_edge_m

    origins_m = offset_from_surface(points_m, faces.plane[face]).astype(np.float32)
    is_lit = np.zeros(len(face), bool)
    is_shaded = np.zeros(len(face), bool)
    for direction in sun_directions:
        facing = np.flatnonzero(faces.plane[face] @ direction > 0)
        segment_m = (FAR_M * direction).astype(np.float32)
        segments_m = np.broadcast_to(segment_m, (len(facing), 3))
        is_hidden = caster.stops(origins_m[facing], segments_m)
        is_lit[facing[~is_hidden]] = True
        is_shaded[facing[is_hidden]] = True
    return _Probes(points_m, face, is_lit, is_shaded)


def _small_things_with_edges(faces: Triangles, probes: _Probes, is_small: Mask) -> Rows:
    """The small things of which a side has lit and shaded probes. A side has the faces nearest to one axis direction.

    `is_small` (F,) are the faces of small things.
    """
    rows = np.flatnonzero(is_small[probes.face])
    side = _side_key(faces, probes.face[rows])
    return probes.mixed(side, rows) // 6


def _side_key(faces: Triangles, face: Rows) -> Rows:
    """A number (P,) for the thing of each face (P,) and the axis direction that is nearest to its normal."""
    return 6 * faces.thing[face].astype(np.int64) + nearest_axis(faces.plane[face])


@dataclass(frozen=True, slots=True)
class _Tiles:
    """A grid of cubes. Faces of one side of a thing that are in the same cube are in the same tile.

    `side_m` (F,) is the side of the cubes, which depends on the face.
    `lowest` (3,) is the lowest index of a cube on each axis, `size` (3,) is the number of indices.
    """

    faces: Triangles
    side_m: Array
    lowest: Rows
    size: Rows

    def keys(self, face: Rows, cube: Rows) -> Rows:
        """The numbers (P,) of the tiles of faces (P,) in cubes (P, 3)."""
        key = _side_key(self.faces, face)
        for axis in range(3):
            key = key * self.size[axis] + (cube[:, axis] - self.lowest[axis])
        return key

    def with_edges(self, probes: _Probes, is_included: Mask) -> Rows:
        """The tiles that have both lit and shaded probes, including those in their margins.

        Only the probes in a mask (P,) are considered, and not those at the outline of their face.
        """
        rows = np.flatnonzero(is_included & ~self._at_outlines(probes))
        place = probes.points_m[rows] / self.side_m[probes.face[rows], None]
        cube = np.floor(place).astype(np.int64)
        margin = MARGIN_SAMPLES / TILE_SAMPLES
        # A probe in the margin of a neighbouring tile counts there, too. Each axis can add neighbours of neighbours.
        for axis in range(3):
            all_rows = [rows]
            all_places = [place]
            all_cubes = [cube]
            for step in (-1, 1):
                shifted = np.floor(place[:, axis] + step * margin)
                in_margin = np.flatnonzero(shifted == cube[:, axis] + step)
                neighbour = cube[in_margin]
                neighbour[:, axis] += step
                all_rows.append(rows[in_margin])
                all_places.append(place[in_margin])
                all_cubes.append(neighbour)
            rows = np.concatenate(all_rows)
            place = np.concatenate(all_places)
            cube = np.concatenate(all_cubes)
        return probes.mixed(self.keys(probes.face[rows], cube), rows)

    def _at_outlines(self, probes: _Probes) -> Mask:
        """Whether each probe (P,) is at the outline of a face that is larger than a tile.

        There, the face can extend behind a neighbour, as a wall does above a ceiling, and the sun can light it unseen.
        """
        outline_m = OUTLINE_SAMPLES / TILE_SAMPLES * self.side_m[probes.face]
        is_at_outline = np.zeros(len(probes.face), bool)
        for axis in range(3):
            low_m = self.faces.corners_m[:, :, axis].min(1)[probes.face]
            high_m = self.faces.corners_m[:, :, axis].max(1)[probes.face]
            place_m = probes.points_m[:, axis]
            is_at_end = (place_m < low_m + outline_m) | (place_m > high_m - outline_m)
            is_long = high_m - low_m > self.side_m[probes.face]
            is_at_outline |= is_at_end & is_long
        return is_at_outline

    def touch(self, tiles: Rows, parent: Rows, corners_m: Array) -> Mask:
        """Whether each part (T, 3, 3) of a face (T,) extends over any of the given tiles."""
        side_m = self.side_m[parent, None]
        # A part may extend a little into a neighbouring tile, in which it does not count.
        ignored_m = side_m * MARGIN_SAMPLES / TILE_SAMPLES / 2
        low_m = corners_m.min(1)
        high_m = corners_m.max(1)
        is_wide = high_m - low_m > 2 * ignored_m
        shrink_m = np.where(is_wide, ignored_m, 0)
        low_cube = np.floor((low_m + shrink_m) / side_m).astype(np.int64)
        high_cube = np.floor((high_m - shrink_m) / side_m).astype(np.int64)
        result = np.zeros(len(parent), bool)
        for is_high in np.ndindex(2, 2, 2):
            cube = np.where(np.array(is_high, bool), high_cube, low_cube)
            result |= np.isin(self.keys(parent, cube), tiles)
        return result


def _tiles_around(faces: Triangles, rows: Rows, spacing_m: Array) -> _Tiles:
    """The tiles of the faces at rows (N,)."""
    side_m = TILE_SAMPLES * spacing_m
    place = faces.corners_m[rows] / side_m[rows, None, None]
    lowest = np.floor(place.min((0, 1))).astype(np.int64) - 1
    highest = np.floor(place.max((0, 1))).astype(np.int64) + 1
    return _Tiles(faces, side_m, lowest, size=highest + 1 - lowest)
