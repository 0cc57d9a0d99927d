"""Distant buildings of panoramas: boxes with pitched or flat roofs, painted from far to near."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.asset.panorama_canvas import COLUMNS, Albedo, PanoramaCanvas, reflected_cd_m2
from vobench.asset.panorama_noise import Floats
from vobench.asset.panorama_wall import DistantFacade, SeenWall, WallPatch, coverage, seen_wall
from vobench.geometry.se3 import Array

ROOF_OVERHANG_M = 0.35
ROOF_NORMAL_Z = 1.2  # of the normal before it is scaled to length 1: a pitch of 40 degrees
ROOF_SKY_SHARE = 0.85  # of the sky's light on level ground
COURSE_CONTRAST = 0.12  # of the logarithm of the luminance
STREET_LIGHT = 0.12  # luminance of a white wall at the ground, by street lamps at night
STREET_LIGHT_HEIGHT_M = 5  # above which e^-1 of it is left

# How high something may be that stands towards the sun.
DEEPEST_M = 8.0  # half of a building's depth, at most
LOWEST_M = 4.0
SUN_CONE_COSINE = np.cos(np.deg2rad(40))
SHADOW_SHARE = 0.75  # of the height at which the sun would be hidden
STEEP_SUN = 0.05  # the horizontal part of the sun's direction below which nothing hides the sun


@dataclass(frozen=True, slots=True)
class DistantBuilding:
    """A box on the ground: its middle (2,), half its sides (2,), yaw, height to the eaves, and its roof's rise."""

    middle_m: tuple[float, float]
    half_m: tuple[float, float]
    yaw_rad: float
    height_m: float
    facade: DistantFacade
    roof_m: float = 0.0
    roof: Albedo = (0.12, 0.06, 0.045)

    @property
    def distance_m(self) -> float:
        """How far its middle is."""
        return float(np.hypot(*self.middle_m))

    def corners_m(self) -> Array:
        """The four corners (4, 2), counter-clockwise."""
        cosine = np.cos(self.yaw_rad)
        sine = np.sin(self.yaw_rad)
        rotation = np.array([[cosine, sine], [-sine, cosine]])  # of rows
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return np.asarray(signs * self.half_m @ rotation + self.middle_m)


@dataclass(frozen=True, slots=True)
class _Side:
    """A wall of a building that faces the viewer.

    is_eaves: the roof slopes up from it; otherwise it has a gable. depth_m: the length of the walls at right angles.
    """

    building: DistantBuilding
    wall: SeenWall
    is_eaves: bool
    depth_m: float

    def paint(self, canvas: PanoramaCanvas, lowest: float = -np.inf) -> None:
        """Paint the wall above a tangent of the elevation, and the roof where it slopes up from the wall."""
        building = self.building
        if not self.is_eaves:
            _paint_wall(canvas, self.wall, building, gable_m=building.roof_m, lowest=lowest)
            return
        if building.roof_m:
            _paint_roof(canvas, self.wall, building, self.depth_m)
        _paint_wall(canvas, self.wall, building, gable_m=0.0, lowest=lowest)


def paint_building(canvas: PanoramaCanvas, building: DistantBuilding) -> None:
    """A building that nothing painted so far hides."""
    for side in _sides(canvas, building):
        side.paint(canvas)


def paint_buildings(canvas: PanoramaCanvas, buildings: Sequence[DistantBuilding]) -> None:
    """Buildings from far to near, without the walls that nearer ones hide."""
    hidden_to = np.full(COLUMNS, -np.inf, np.float32)  # tangent up to which walls so far hide what is behind them
    visible: list[tuple[_Side, float]] = []  # sides from near to far, and up to where all of their columns are hidden
    for building in sorted(buildings, key=lambda building: building.distance_m):
        for side in reversed(_sides(canvas, building)):
            wall = side.wall
            columns = wall.columns % COLUMNS
            eaves = (building.height_m - canvas.eye_m) / wall.distance_m
            ridge = (building.height_m + building.roof_m - canvas.eye_m) / wall.distance_m
            hidden_before = hidden_to[columns]
            if (ridge > hidden_before).any():
                visible.append((side, float(hidden_before.min())))

            # The columns at the ends are covered in part.
            inner = slice(2, len(columns) - 2)
            hidden_to[columns[inner]] = np.maximum(hidden_before, eaves)[inner]
    for side, lowest in reversed(visible):
        side.paint(canvas, lowest)


def _sides(canvas: PanoramaCanvas, building: DistantBuilding) -> list[_Side]:
    """The sides of a building that are turned to the viewer, the farther first."""
    corners_m = building.corners_m()
    has_ridge_along = building.half_m[0] >= building.half_m[1]  # the ridge runs along the longer side
    sides = []
    for number in range(4):
        wall = seen_wall(canvas, corners_m[number], corners_m[(number + 1) % 4])
        if wall is not None:
            is_first_axis = number % 2 == 0
            depth_m = 2 * building.half_m[(number + 1) % 2]
            sides.append(_Side(building, wall, is_first_axis == has_ridge_along, depth_m))
    return sorted(sides, key=lambda side: -side.wall.mean_distance_m)


def _paint_wall(
    canvas: PanoramaCanvas, wall: SeenWall, building: DistantBuilding, *, gable_m: float, lowest: float
) -> None:
    """A wall with its windows, above a tangent of the elevation; its middle is higher than its ends by gable_m."""
    nearest_m = max(float(wall.distance_m.min()), 1.0)
    farthest_m = max(float(wall.distance_m.max()), 1.0)
    rise_m = building.height_m + gable_m - canvas.eye_m
    highest = rise_m / (nearest_m if rise_m > 0 else farthest_m)
    foot = -canvas.eye_m / nearest_m
    rows = canvas.rows(max(foot, lowest), highest)
    if rows.stop <= rows.start:
        return

    east_m = building.middle_m[0]
    patch = WallPatch(canvas, wall, building.facade, rows, eaves_m=building.height_m, texture_offset=east_m)
    colour = patch.masonry(has_bands=gable_m == 0)
    lit_windows = patch.add_windows(colour)
    fading = np.exp(-np.maximum(patch.height_m, 0) / STREET_LIGHT_HEIGHT_M)
    street_light = STREET_LIGHT * building.facade.wall[1] * fading
    lamps = lit_windows + street_light
    canvas.paint(rows, wall.columns, colour, patch.cover(gable_m), distance_m=wall.mean_distance_m, lamps=lamps)


def _paint_roof(canvas: PanoramaCanvas, wall: SeenWall, building: DistantBuilding, depth_m: float) -> None:
    """The slope of a roof above a wall at its eaves; the ridge is half of the depth farther off."""
    ridge_m = building.height_m + building.roof_m
    eaves = (building.height_m - canvas.eye_m) / wall.distance_m
    ridge = (ridge_m - canvas.eye_m) / (wall.distance_m + depth_m / 2)
    if not (ridge > eaves).any():
        return
    rows = canvas.rows(float(eaves.min()), float(ridge.max()))
    tangent = canvas.tangent[rows, None]
    height = coverage(tangent, eaves[None, :], ridge[None, :], canvas.tangent_step[rows, None])
    end_m = wall.length_m + ROOF_OVERHANG_M
    width = coverage(wall.along_m, -ROOF_OVERHANG_M, end_m, wall.along_step_m)[None, :]
    cover = height * width

    courses = canvas.grain(wall.along_m[None, :] / 9 + building.middle_m[1], tangent * 40)
    tone = np.exp(COURSE_CONTRAST * courses)[..., None]
    colour = reflected_cd_m2(building.roof, _roof_light_lx(canvas, wall.normal_azimuth)) * tone
    canvas.paint(rows, wall.columns, colour, cover, distance_m=wall.mean_distance_m)


def _roof_light_lx(canvas: PanoramaCanvas, azimuth: float) -> Floats:
    """Illuminance (3,) of the slope of a roof that faces an azimuth."""
    normal = np.array([np.cos(azimuth), np.sin(azimuth), ROOF_NORMAL_Z])
    normal /= np.linalg.norm(normal)
    daylight = canvas.daylight
    cosine = max(float(normal @ daylight.sun_direction), 0.0)
    return np.asarray(ROOF_SKY_SHARE * daylight.sky_lx + cosine * daylight.sun_lx)


def height_below_sun_m(canvas: PanoramaCanvas, middle_m: Array, height_m: float) -> float:
    """The height of a building or tree, lowered where it would hide the sun from the scene."""
    sun = canvas.daylight.sun_direction
    distance_m = float(np.hypot(*middle_m))
    horizontal = float(np.hypot(sun[0], sun[1]))
    if canvas.sun.illuminance_lx == 0 or horizontal < STEEP_SUN:
        return height_m
    cosine = float(middle_m @ sun[:2]) / (distance_m * horizontal)
    if cosine < SUN_CONE_COSINE:
        return height_m
    nearest_m = max(distance_m - DEEPEST_M, 0.6 * distance_m)
    most_m = canvas.eye_m + SHADOW_SHARE * nearest_m * float(sun[2]) / horizontal
    return max(min(height_m, most_m), LOWEST_M)
