"""Checks of generated sites: nothing overlaps or floats, a body gets through, something shines."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import scipy

from vobench.asset.site import Footprint, Site, SitePiece, Structure, footprint, overlap_m
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Sky, Sun

TOLERANCE_M = 0.02  # between a piece and the ground
OVERLAP_M = 0.03  # that footprints may share
CELL_M = 0.15  # of the map of the roads
LOW_M = 0.5  # what stands higher is in a rack
FACES = 340_000  # at most


def complaints(site: Site) -> list[str]:
    """What is wrong with a site, in sentences; empty if nothing is."""
    footprints = {piece.name: footprint(piece) for piece in site.pieces}
    found = [*_overlaps(site, footprints), *_loose(site, footprints), *_unlit(site)]
    found += _unreached(site, list(footprints.values()))
    faces = face_count(site)
    if faces > FACES:
        found.append(f"it has {faces} faces, where {FACES} are right")
    return found


def face_count(site: Site) -> int:
    """The number of faces of a site, with its lamps."""
    groups: list[Structure | SitePiece] = [*site.structures, *site.pieces]
    faces = sum(len(part.arrays.faces) for group in groups for part in group.parts)
    return faces + sum(len(light.mesh.faces) for light in site.lights if isinstance(light, AreaLight))


def _overlaps(site: Site, footprints: Mapping[str, Footprint]) -> Iterator[str]:
    """Pieces that enter one another or a wall."""
    names = list(footprints)
    for one, other in _close_pairs(list(footprints.values())):
        first = footprints[names[one]]
        second = footprints[names[other]]
        depth_m = first.overlap_depth_m(second, OVERLAP_M)
        if depth_m:
            yield f"{names[one]} and {names[other]} overlap by {depth_m:.2f} m"
    for name, standing in footprints.items():
        for wall in site.walls:
            depth_m = overlap_m(standing.corners_m, wall)
            if depth_m > OVERLAP_M:
                yield f"{name} reaches {depth_m:.2f} m into a wall"


def _close_pairs(footprints: Sequence[Footprint]) -> list[tuple[int, int]]:
    """The pairs of footprints whose bounding rectangles overlap, each pair once."""
    if not footprints:
        return []
    low_m = np.array([standing.corners_m.min(axis=0) for standing in footprints])
    high_m = np.array([standing.corners_m.max(axis=0) for standing in footprints])
    begins_before = low_m[:, None] < high_m[None]
    ends_after = high_m[:, None] > low_m[None]
    is_close = (begins_before & ends_after).all(axis=2)
    ones, others = np.nonzero(np.triu(is_close, k=1))
    return list(zip(ones.tolist(), others.tolist(), strict=True))


def _loose(site: Site, footprints: Mapping[str, Footprint]) -> Iterator[str]:
    """Pieces that do not stand on the ground or on what supports them."""
    for piece in site.pieces:
        standing = footprints[piece.name]
        if piece.support:
            parent = footprints[piece.support]
            gap_m = standing.low_m - parent.high_m
            is_above = overlap_m(standing.corners_m, parent.corners_m) > 0
            if gap_m > TOLERANCE_M or not is_above:
                yield f"{piece.name} is not on {piece.support} (gap {gap_m:.2f} m)"
            continue
        middle = standing.corners_m.mean(axis=0)
        ground_m = float(site.ground.heights_m(middle[None])[0]) if piece.base_m is None else piece.base_m
        above_m = standing.low_m - ground_m
        if not -piece.sunk_m - TOLERANCE_M <= above_m <= TOLERANCE_M:
            yield f"{piece.name} stands {above_m:.3f} m above the ground"


def _unreached(site: Site, footprints: Sequence[Footprint]) -> Iterator[str]:
    """Stations that a body cannot reach from the first one on the roads."""
    corners_m = np.concatenate([area.corners_m for area in site.roads])
    low_m = corners_m.min(axis=0)
    high_m = corners_m.max(axis=0)
    x = np.arange(low_m[0] - CELL_M, high_m[0] + 2 * CELL_M, CELL_M)
    y = np.arange(low_m[1] - CELL_M, high_m[1] + 2 * CELL_M, CELL_M)
    centres_m = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    is_free = np.zeros(len(centres_m), bool)
    for area in site.roads:
        is_free |= area.contains(centres_m)
    on_ground = [standing.corners_m for standing in footprints if standing.low_m < LOW_M]
    for corners in (*on_ground, *site.blocked, *site.walls):
        is_near = ((centres_m > corners.min(0)) & (centres_m < corners.max(0))).all(axis=1)
        near = np.flatnonzero(is_near & is_free)
        is_free[near[_is_inside(centres_m[near], corners)]] = False
    shape = (len(y), len(x))
    distance_m = scipy.ndimage.distance_transform_edt(is_free.reshape(shape)) * CELL_M
    labels, _ = scipy.ndimage.label(distance_m > site.body_radius_m)
    cells = np.rint((site.stations_m - [x[0], y[0]]) / CELL_M).astype(int)
    found = [int(labels[row, column]) for column, row in cells]
    for number, label in enumerate(found):
        if label == 0 or label != found[0]:
            place = site.stations_m[number].round(1).tolist()
            yield f"a body of radius {site.body_radius_m} m does not get to {place}"


def _is_inside(points_m: Array, polygon_m: Array) -> Array:
    """Whether points (N, 2) are inside a convex polygon, counter-clockwise as from ConvexHull."""
    inside = np.ones(len(points_m), bool)
    for start, end in zip(polygon_m, np.roll(polygon_m, -1, axis=0), strict=True):
        edge = end - start
        to_point = points_m - start
        inside &= edge[0] * to_point[:, 1] - edge[1] * to_point[:, 0] >= 0
    return inside


def _unlit(site: Site) -> Iterator[str]:
    """Whether nothing shines."""
    has_lamp = any(isinstance(light, AreaLight) for light in site.lights)
    has_sky = any(isinstance(light, Sun | Sky) and light.illuminance_lx > 100 for light in site.lights)
    if not has_lamp and not has_sky:
        yield "no lamp is on, and it is dark"
