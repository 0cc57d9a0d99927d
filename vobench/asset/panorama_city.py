"""The city of a panorama: blocks with shops and trees along straight streets, and towers farther off."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from vobench.asset.panorama_building import DistantBuilding, height_below_sun_m, paint_building, paint_buildings
from vobench.asset.panorama_canvas import Albedo, PanoramaCanvas
from vobench.asset.panorama_ground import ASPHALT, PAVING, ground_places, paint_ground, paint_hills
from vobench.asset.panorama_noise import Floats, fade_pattern
from vobench.asset.panorama_scenery import COMPASS, one_albedo
from vobench.asset.panorama_tree import DistantTrees
from vobench.asset.panorama_wall import DistantFacade
from vobench.asset.picture import Rng
from vobench.geometry.se3 import Array

CITY_WALLS = ("#6b3b2d", "#774d3b", "#7a6a59", "#6b655b", "#574639", "#837559", "#5b5652", "#743f31", "#5f6265")
CITY_TRIMS = ("#aaa396", "#8f897f", "#4a4642", "#b5aea2", "#6b5a4c")
CITY_TOWERS = ("#6d747c", "#8b8f92", "#5c6268", "#9a948a")
CARS = ("#b8bcc0", "#2b2e33", "#7a1f1f", "#27445c", "#d8d8d4", "#4a5a50", "#8a8f94")
CAR_GLASS: Albedo = (0.05, 0.055, 0.06)

STREET_M = 14.0
SIDEWALK_M = 3.5  # along the blocks across the street
OWN_SIDEWALK_M = 1.0
LINE_ALBEDO = 0.35  # what the dashes in the middle of the road add
DASH_M = 3
BLOCK_HALF_M = 38.0
BUILDING_DEPTH_M = 12.0
NARROWEST_M = 8  # a building; what is left of a row goes to the last one
TOWERS = 90

# Trees and parked cars along the streets around the scene's block.
PARKING_SPACING_M = 5.6
CAR_TO_FRONT_M = 4.6
TREE_TO_FRONT_M = 2.6
CAR_SHARE = 0.55
TREE_SHARE = 0.4


def paint_city(canvas: PanoramaCanvas) -> None:
    """Paint the hills behind the city, its streets, buildings, trees and cars."""
    paint_hills(canvas, rise=0.03, distance_m=9000, albedo=(0.06, 0.08, 0.05))
    paint_ground(canvas, _street_albedo(canvas))
    towers = [_tower(canvas) for _ in range(TOWERS)]
    paint_buildings(canvas, [*towers, *_blocks(canvas)])
    _paint_street_side(canvas)


def _street_albedo(canvas: PanoramaCanvas) -> Floats:
    """The ground (ROWS / 2, COLUMNS, 3): a square of streets around the scene with dashes, and pavement besides."""
    front_m = canvas.nearest_m  # of the blocks across the street
    x_m, y_m, footprint_m = ground_places(canvas)
    across_m = np.maximum(np.abs(x_m), np.abs(y_m))
    is_paving = (across_m > front_m - SIDEWALK_M) | (across_m < front_m - STREET_M + OWN_SIDEWALK_M)
    texture = np.exp(0.4 * canvas.grass(x_m, y_m, footprint_m))[..., None]
    albedo = np.where(is_paving[..., None], PAVING, ASPHALT).astype(np.float32) * texture

    road_m = STREET_M - SIDEWALK_M - OWN_SIDEWALK_M
    to_line_m = np.abs(across_m - (front_m - SIDEWALK_M - road_m / 2))
    is_dash = ((x_m + y_m) % (2 * DASH_M) < DASH_M) & (to_line_m < 0.08)
    albedo += LINE_ALBEDO * fade_pattern(is_dash.astype(np.float32), footprint_m, 0.15)[..., None]
    return np.asarray(albedo.astype(np.float32))


def _tower(canvas: PanoramaCanvas) -> DistantBuilding:
    rng = canvas.rng
    azimuth = rng.uniform(-np.pi, np.pi)
    distance_m = rng.uniform(350, 2200)
    middle_m = distance_m * np.array([np.cos(azimuth), np.sin(azimuth)])
    drawn_height_m = float(rng.uniform(25, 45) + 70 * rng.random() ** 3)
    half_length_m = float(rng.uniform(9, 22))
    half_width_m = float(rng.uniform(9, 16))
    facade = DistantFacade(
        wall=one_albedo(rng, CITY_TOWERS),
        trim=one_albedo(rng, CITY_TRIMS),
        storey_m=3.6,
        bay_m=3.0,
        window_m=2.5,
        sill_m=0.7,
        head_m=3.2,
        lit_share=0.3,
    )
    return DistantBuilding(
        middle_m=(float(middle_m[0]), float(middle_m[1])),
        half_m=(half_length_m, half_width_m),
        yaw_rad=0.0,
        height_m=height_below_sun_m(canvas, middle_m, drawn_height_m),
        facade=facade,
    )


@dataclass(frozen=True, slots=True)
class _Span:
    """The place of a block along one axis: its middle and half its width."""

    middle_m: float
    half_m: float


def _blocks(canvas: PanoramaCanvas) -> list[DistantBuilding]:
    """The buildings of all blocks but the scene's own. They are higher where they are farther away."""
    buildings = []
    spans = _block_spans(canvas.nearest_m)
    for east, north in product(spans, spans):
        distance_m = max(abs(east.middle_m), abs(north.middle_m))
        if distance_m:
            height_m = float(canvas.rng.uniform(15, 20)) + 0.03 * distance_m
            middle_m = np.array([east.middle_m, north.middle_m])
            half_m = np.array([east.half_m, north.half_m])
            buildings += _block(canvas, middle_m, half_m, height_m)
    return buildings


def _block_spans(front_m: float) -> list[_Span]:
    """The blocks along one axis in a grid of streets; the scene is in the one at 0."""
    own_half_m = max(front_m - STREET_M, 0.5 * front_m)
    first_m = front_m + BLOCK_HALF_M
    second_m = first_m + 2 * BLOCK_HALF_M + STREET_M
    return [
        _Span(-second_m, BLOCK_HALF_M),
        _Span(-first_m, BLOCK_HALF_M),
        _Span(0.0, own_half_m),
        _Span(first_m, BLOCK_HALF_M),
        _Span(second_m, BLOCK_HALF_M),
    ]


def _block(canvas: PanoramaCanvas, middle_m: Array, half_m: Array, height_m: float) -> list[DistantBuilding]:
    """A block of the city: rows of buildings along the four sides of a court."""
    buildings = []
    for x, y in COMPASS:
        along = np.array([x, y], float)
        outward = np.array([y, -x], float)
        half_length_m = float(np.abs(along) @ half_m)
        half_depth_m = float(np.abs(outward) @ half_m)
        start_m = middle_m - half_length_m * along + half_depth_m * outward
        buildings += _row_of_buildings(canvas, start_m, along, 2 * half_length_m, height_m)
    return buildings


def _row_of_buildings(
    canvas: PanoramaCanvas, start_m: Array, along: Array, length_m: float, height_m: float
) -> list[DistantBuilding]:
    """Buildings side by side from a point on; the street is to the right of `along`."""
    rng = canvas.rng
    inward = np.array([-along[1], along[0]])
    yaw_rad = float(np.arctan2(along[1], along[0]))
    buildings = []
    built_m = 0.0
    while built_m < length_m - 1:
        left_m = length_m - built_m
        width_m = min(float(rng.uniform(10, 24)), left_m)
        if left_m - width_m < NARROWEST_M:
            width_m = left_m
        middle_m = start_m + (built_m + width_m / 2) * along + BUILDING_DEPTH_M / 2 * inward
        drawn_height_m = height_m * float(rng.uniform(0.75, 1.35))
        building = DistantBuilding(
            middle_m=(float(middle_m[0]), float(middle_m[1])),
            half_m=(width_m / 2, BUILDING_DEPTH_M / 2),
            yaw_rad=yaw_rad,
            height_m=height_below_sun_m(canvas, middle_m, drawn_height_m),
            facade=_city_facade(rng),
        )
        buildings.append(building)
        built_m += width_m
    return buildings


def _city_facade(rng: Rng) -> DistantFacade:
    return DistantFacade(
        wall=one_albedo(rng, CITY_WALLS),
        trim=one_albedo(rng, CITY_TRIMS),
        storey_m=float(rng.uniform(3.1, 3.7)),
        bay_m=float(rng.uniform(2.2, 3.4)),
        window_m=float(rng.uniform(1.0, 1.5)),
        has_shops=bool(rng.random() < 0.6),
        lit_share=float(rng.uniform(0.12, 0.4)),
    )


@dataclass(frozen=True, slots=True)
class _StreetItem:
    """A tree or a parked car at the side of a street; yaw_rad of a car."""

    kind: str
    place_m: Array
    yaw_rad: float

    @property
    def distance_m(self) -> float:
        return float(np.hypot(*self.place_m))


def _paint_street_side(canvas: PanoramaCanvas) -> None:
    """Trees and parked cars along the four streets around the scene's own block."""
    trees = DistantTrees(canvas)
    items = _street_items(canvas)
    items.sort(key=lambda item: -item.distance_m)
    for item in items:
        if item.kind == "tree":
            height_m = height_below_sun_m(canvas, item.place_m, float(canvas.rng.uniform(6, 10)))
            azimuth = float(np.arctan2(item.place_m[1], item.place_m[0]))
            trees.paint(azimuth, item.distance_m, height_m)
        else:
            _paint_car(canvas, item.place_m, item.yaw_rad)


def _street_items(canvas: PanoramaCanvas) -> list[_StreetItem]:
    rng = canvas.rng
    front_m = canvas.nearest_m
    items = []
    for side, (x, y) in enumerate(COMPASS):
        outward = np.array([x, y])
        along = np.array([-y, x])
        yaw_rad = np.pi / 2 * (side + 1)
        for slot_m in np.arange(-front_m - 8, front_m + 8, PARKING_SPACING_M):
            along_m = slot_m + rng.uniform(-0.6, 0.6)
            car_m = outward * (front_m - CAR_TO_FRONT_M) + along * along_m
            tree_m = outward * (front_m - TREE_TO_FRONT_M) + along * along_m
            if rng.random() < CAR_SHARE:
                items.append(_StreetItem("car", car_m, yaw_rad))
            if rng.random() < TREE_SHARE:
                items.append(_StreetItem("tree", tree_m, yaw_rad))
    return items


def _paint_car(canvas: PanoramaCanvas, place_m: Array, yaw_rad: float) -> None:
    """A parked car: a cabin of glass, and before it a body."""
    paint = one_albedo(canvas.rng, CARS)
    middle_m = (float(place_m[0]), float(place_m[1]))
    glass = DistantFacade(CAR_GLASS, paint, storey_m=9.0, bay_m=9.0, window_m=0.0)
    body = DistantFacade(paint, paint, storey_m=9.0, bay_m=9.0, window_m=0.0)
    paint_building(canvas, DistantBuilding(middle_m, (1.25, 0.72), yaw_rad, 1.42, glass))
    paint_building(canvas, DistantBuilding(middle_m, (2.1, 0.86), yaw_rad, 0.86, body))
