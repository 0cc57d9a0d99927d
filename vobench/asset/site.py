"""Sites: places that are no floor plan, such as streets, halls and parks: ground, buildings, pieces and lights."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.spatial import ConvexHull

from vobench.asset.furniture import Part
from vobench.asset.room import Instance, things
from vobench.geometry.se3 import Array
from vobench.scene.generated_place import GeneratedPlace
from vobench.scene.light import Light

BODY_HEIGHT_M = 2.0  # a body passes below what is higher than this above the lowest point of a piece
ON_EDGE_M2 = 1e-9  # a point counts as inside an area if it is outside by this cross product with an edge
LEAST_EDGE_M = 1e-9  # shorter edges of polygons have no direction


@dataclass(frozen=True, slots=True)
class Structure:
    """A part of the ground or of a building.

    `parts` are in the frame of the place.
    `spacing_m` is the distance between samples of its light.
    """

    name: str
    parts: tuple[Part, ...]
    spacing_m: float


@dataclass(frozen=True, slots=True)
class SitePiece:
    """Something that stands on the ground, on the deck of a rack, or on another piece.

    `parts` are in the frame of the place.
    `spacing_m` is the distance between samples of its light.
    `support` names the piece on which it stands; empty if there is none.
    `sunk_m` is how far it may reach into the ground, as the trunk of a tree on a slope does.
    `base_m` is the height of the deck on which it stands; None if it stands on the ground or on a piece.
    """

    name: str
    parts: tuple[Part, ...]
    spacing_m: float
    support: str = ""
    sunk_m: float = 0.01
    base_m: float | None = None


@dataclass(frozen=True, slots=True)
class Footprint:
    """The ground that a piece occupies.

    `corners_m` (N, 2) is the convex hull of what the piece has within the height of a body.
    `low_m` and `high_m` are its lowest and its highest z.
    """

    corners_m: Array
    low_m: float
    high_m: float

    def overlap_depth_m(self, other: "Footprint", tolerance_m: float) -> float:
        """The depth by which two pieces overlap, if it is more than a tolerance; 0 otherwise."""
        is_above = self.low_m + tolerance_m >= other.high_m
        is_below = self.high_m <= other.low_m + tolerance_m
        if is_above or is_below or not self._has_overlapping_box(other):
            return 0.0
        depth_m = overlap_m(self.corners_m, other.corners_m)
        return depth_m if depth_m > tolerance_m else 0.0

    def _has_overlapping_box(self, other: "Footprint") -> bool:
        """Whether the bounding rectangles along the axes overlap, which is quick to see."""
        begins_before = self.corners_m.min(0) < other.corners_m.max(0)
        ends_after = self.corners_m.max(0) > other.corners_m.min(0)
        return bool(begins_before.all() and ends_after.all())


def footprint(piece: SitePiece) -> Footprint:
    """The footprint of a piece."""
    vertices_m = np.concatenate([part.arrays.vertices_m for part in piece.parts])
    low_m = float(vertices_m[:, 2].min())
    is_in_the_way = vertices_m[:, 2] < low_m + BODY_HEIGHT_M
    points_m = vertices_m[is_in_the_way, :2]
    hull = ConvexHull(points_m)
    return Footprint(points_m[hull.vertices], low_m, float(vertices_m[:, 2].max()))


class Terrain(Protocol):
    """The ground of a site."""

    def heights_m(self, points_m: Array) -> Array:
        """The height (N,) of the ground at points (N, 2); NaN where nothing can stand."""


@dataclass(frozen=True, slots=True)
class Area:
    """A level convex polygon (N, 2) of the ground, counter-clockwise."""

    corners_m: Array
    height_m: float

    def contains(self, points_m: Array) -> Array:
        """Whether points (N, 2) lie inside."""
        inside = np.ones(len(points_m), bool)
        for start, end in zip(self.corners_m, np.roll(self.corners_m, -1, axis=0), strict=True):
            edge = end - start
            to_point = points_m - start
            cross_m2 = edge[0] * to_point[:, 1] - edge[1] * to_point[:, 0]
            inside &= cross_m2 >= -ON_EDGE_M2
        return inside


@dataclass(frozen=True, slots=True)
class LevelAreas:
    """A ground of level areas. Where they overlap, the first one counts."""

    areas: tuple[Area, ...]

    def heights_m(self, points_m: Array) -> Array:
        """The height (N,) of the ground at points (N, 2); NaN outside of all areas."""
        heights_m = np.full(len(points_m), np.nan)
        for area in self.areas:
            is_new = np.isnan(heights_m) & area.contains(points_m)
            heights_m[is_new] = area.height_m
        return heights_m


@dataclass(frozen=True, slots=True)
class Site:
    """A place outdoors or in a large hall.

    `roads` are the areas in which a body has to get from the first to the last of the `stations_m` (N, 2).
    `body_radius_m` is how far the middle of the body stays away from everything.
    `walls` are footprints (4, 2) that nothing may enter.
    `blocked` are footprints (4, 2) of racks, which pieces may enter and bodies may not.
    """

    structures: tuple[Structure, ...]
    pieces: tuple[SitePiece, ...]
    lights: tuple[Light, ...]
    ground: Terrain
    roads: tuple[Area, ...]
    stations_m: Array
    body_radius_m: float
    walls: tuple[Array, ...] = ()
    blocked: tuple[Array, ...] = ()

    @property
    def area_m2(self) -> float:
        """The area of the roads."""
        return sum(polygon_area_m2(area.corners_m) for area in self.roads)

    def place(self) -> GeneratedPlace:
        """The things, materials and lights of the site."""
        groups: list[Structure | SitePiece] = [*self.structures, *self.pieces]
        instances: list[Instance] = [(group.name, group.parts) for group in groups]
        unspaced, materials = things(instances)
        spacing_m = {group.name: group.spacing_m for group in groups}
        spaced = [replace(thing, spacing_m=spacing_m[thing.name]) for thing in unspaced]
        return GeneratedPlace(tuple(spaced), materials, self.lights)


def polygon_area_m2(corners_m: Array) -> float:
    """The area of a polygon (N, 2) by the shoelace formula."""
    following = np.roll(corners_m, -1, axis=0)
    cross = corners_m[:, 0] * following[:, 1] - corners_m[:, 1] * following[:, 0]
    return abs(float(cross.sum())) / 2


def overlap_m(one_m: Array, other_m: Array) -> float:
    """The depth by which two convex polygons (N, 2) overlap, by the separating axis theorem; negative if they do not.

    It is the shortest distance by which one of them has to be moved so that they only touch.
    """
    least_m = np.inf
    for polygon in (one_m, other_m):
        edges = np.roll(polygon, -1, axis=0) - polygon
        lengths = np.linalg.norm(edges, axis=1)
        for edge in edges[lengths > LEAST_EDGE_M]:
            normal = np.array([edge[1], -edge[0]]) / np.linalg.norm(edge)
            one_along_m = one_m @ normal
            other_along_m = other_m @ normal
            begin_m = max(one_along_m.min(), other_along_m.min())
            end_m = min(one_along_m.max(), other_along_m.max())
            depth_m = end_m - begin_m
            least_m = min(least_m, float(depth_m))
    return least_m


def has_overlap(polygons_m: Sequence[Array], tolerance_m: float) -> bool:
    """Whether any two of several convex polygons overlap by more than a tolerance."""
    low_corners_m = np.array([polygon.min(axis=0) for polygon in polygons_m])
    high_corners_m = np.array([polygon.max(axis=0) for polygon in polygons_m])
    for first in range(len(polygons_m)):
        # Only polygons with overlapping bounding rectangles are compared, each pair once.
        begins_before = low_corners_m[first] < high_corners_m
        ends_after = high_corners_m[first] > low_corners_m
        candidates = np.flatnonzero((begins_before & ends_after).all(axis=1))
        for second in candidates[candidates > first].tolist():
            if overlap_m(polygons_m[first], polygons_m[second]) > tolerance_m:
                return True
    return False
