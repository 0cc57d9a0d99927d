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

BODY_HEIGHT_M = 2.0  # what is higher than this above the lowest point of a piece is in nobody's way


@dataclass(frozen=True, slots=True)
class Built:
    """A part of the ground or of a building: its name, its parts, and the distance between samples of its light."""

    name: str
    parts: tuple[Part, ...]
    spacing_m: float


@dataclass(frozen=True, slots=True)
class SitePiece:
    """Something that stands on the ground, or on the piece named by `support`; parts in the frame of the place.

    base_m: the height of the deck of a rack on which it stands instead.
    sunk_m: how far it may reach into the ground, such as the trunk of a tree on a slope.
    """

    name: str
    parts: tuple[Part, ...]
    spacing_m: float
    support: str = ""
    sunk_m: float = 0.01
    base_m: float | None = None


@dataclass(frozen=True, slots=True)
class Footprint:
    """The convex hull (N, 2) of what a piece has within the height of a body, and its lowest and highest z."""

    corners_m: Array
    low_m: float
    high_m: float

    def meets(self, other: "Footprint", tolerance_m: float) -> float:
        """How far two pieces enter each other, if that is more than a tolerance; 0 otherwise."""
        is_beside = self.high_m > other.low_m + tolerance_m and other.high_m > self.low_m + tolerance_m
        is_near = (self.corners_m.min(0) < other.corners_m.max(0)).all()
        is_near &= (self.corners_m.max(0) > other.corners_m.min(0)).all()
        if not (is_beside and is_near):
            return 0.0
        depth_m = overlap_m(self.corners_m, other.corners_m)
        return depth_m if depth_m > tolerance_m else 0.0


def footprint(piece: SitePiece) -> Footprint:
    """The footprint of a piece."""
    vertices_m = np.concatenate([part.arrays.vertices_m for part in piece.parts])
    low_m = float(vertices_m[:, 2].min())
    near_m = vertices_m[vertices_m[:, 2] < low_m + BODY_HEIGHT_M, :2]
    hull = ConvexHull(near_m)
    return Footprint(near_m[hull.vertices], low_m, float(vertices_m[:, 2].max()))


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
            inside &= edge[0] * to_point[:, 1] - edge[1] * to_point[:, 0] >= -1e-9
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

    roads: the areas in which a body has to get from the first to the last of the `stations_m` (N, 2), with its middle
    `body_radius_m` away from everything. walls: footprints (4, 2) that nothing may enter. blocked: footprints (4, 2) of
    racks, which pieces may enter and bodies may not.
    """

    built: tuple[Built, ...]
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
        groups: list[Built | SitePiece] = [*self.built, *self.pieces]
        instances: list[Instance] = [(group.name, group.parts) for group in groups]
        made, materials = things(instances)
        spacing_m = {group.name: group.spacing_m for group in groups}
        spaced = [replace(thing, spacing_m=spacing_m[thing.name]) for thing in made]
        return GeneratedPlace(tuple(spaced), materials, self.lights)


def polygon_area_m2(corners_m: Array) -> float:
    """The area of a polygon (N, 2) by the shoelace formula."""
    following = np.roll(corners_m, -1, axis=0)
    cross = corners_m[:, 0] * following[:, 1] - corners_m[:, 1] * following[:, 0]
    return abs(float(cross.sum())) / 2


def overlap_m(one_m: Array, other_m: Array) -> float:
    """How far two convex polygons (N, 2) enter each other, by the separating axis theorem; negative if they do not."""
    least_m = np.inf
    for polygon in (one_m, other_m):
        edges = np.roll(polygon, -1, axis=0) - polygon
        lengths = np.linalg.norm(edges, axis=1)
        for edge in edges[lengths > 1e-9]:
            normal = np.array([edge[1], -edge[0]]) / np.linalg.norm(edge)
            first = one_m @ normal
            second = other_m @ normal
            depth_m = min(first.max(), second.max()) - max(first.min(), second.min())
            least_m = min(least_m, float(depth_m))
    return least_m


def has_overlap(polygons_m: Sequence[Array], tolerance_m: float) -> bool:
    """Whether any two of several convex polygons enter each other by more than a tolerance."""
    lows = np.array([polygon.min(axis=0) for polygon in polygons_m])
    highs = np.array([polygon.max(axis=0) for polygon in polygons_m])
    for first in range(len(polygons_m)):
        is_near = ((lows[first] < highs) & (highs[first] > lows)).all(axis=1)
        for second in np.flatnonzero(is_near).tolist():
            if second > first and overlap_m(polygons_m[first], polygons_m[second]) > tolerance_m:
                return True
    return False
