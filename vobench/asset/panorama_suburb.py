"""The suburb of a panorama: houses with gardens and trees on streets around the scene."""

import numpy as np

from vobench.asset.panorama_canvas import PanoramaCanvas
from vobench.asset.panorama_ground import ASPHALT, LAWN, PAVING, ground_places, paint_ground, paint_hills
from vobench.asset.panorama_noise import Floats
from vobench.asset.panorama_scenery import COMPASS, Scenery, random_place

ROAD_TO_FRONT_M = 9  # from the middle of the road to the nearest houses
ROAD_HALF_M = 2.8
PATH_TO_ROAD_M = 3.7  # between the middles
PATH_HALF_M = 0.9

RINGS = 4  # squares of houses around the scene
RING_SPACING_M = 32
HOUSE_SPACING_M = 17.0
HOUSE_SHARE = 0.85  # of the plots
HEDGE_SHARE = 0.6  # of the plots of the two nearest rings
GARDEN_TREES = 4
DISTANT_TREES = 260


def paint_suburb(canvas: PanoramaCanvas) -> None:
    """Paint two ranges of hills, the road and lawns, and houses with hedges and trees."""
    paint_hills(canvas, rise=0.05, distance_m=7000, albedo=(0.05, 0.075, 0.04))
    paint_hills(canvas, rise=0.022, distance_m=2500, albedo=(0.045, 0.07, 0.03))
    paint_ground(canvas, _ground_albedo(canvas))

    scenery = Scenery(canvas)
    for ring in range(RINGS):
        for side in range(len(COMPASS)):
            _add_row_of_houses(canvas, scenery, ring, side)
    for _ in range(DISTANT_TREES):
        place_m = random_place(canvas.rng, canvas.nearest_m + 130, 600)
        scenery.add_tree(place_m, float(canvas.rng.uniform(8, 16)))
    scenery.paint()


def _ground_albedo(canvas: PanoramaCanvas) -> Floats:
    """The ground (ROWS / 2, COLUMNS, 3): a square road around the scene with a path on each side, in a lawn."""
    x_m, y_m, footprint_m = ground_places(canvas)
    across_m = np.maximum(np.abs(x_m), np.abs(y_m))
    to_road_m = np.abs(across_m - (canvas.nearest_m - ROAD_TO_FRONT_M))
    is_road = to_road_m < ROAD_HALF_M
    is_path = np.abs(to_road_m - PATH_TO_ROAD_M) < PATH_HALF_M
    albedo = np.exp(canvas.grass(x_m, y_m, footprint_m))[..., None] * np.array(LAWN, np.float32)
    albedo[is_path] = PAVING
    albedo[is_road] = ASPHALT
    return np.asarray(albedo)


def _add_row_of_houses(canvas: PanoramaCanvas, scenery: Scenery, ring: int, side: int) -> None:
    """Houses along one side of a square around the scene, with hedges and trees between them."""
    rng = canvas.rng
    front_m = canvas.nearest_m + 6 + RING_SPACING_M * ring
    outward = np.array(COMPASS[side], float)
    along = np.array([-outward[1], outward[0]])
    for plot_m in np.arange(-front_m, front_m, HOUSE_SPACING_M):
        along_m = plot_m + rng.uniform(-2, 2)
        if rng.random() < HOUSE_SHARE:
            place_m = outward * front_m + along * along_m
            scenery.add_house(place_m, np.pi / 2 * (side + 1) + rng.normal(0, 0.04))
        if ring < 2 and rng.random() < HEDGE_SHARE:
            start_m = outward * (front_m - 7.5) + along * (along_m - 7)
            scenery.add_hedge(start_m, along, float(rng.uniform(5, 11)))
        for _ in range(GARDEN_TREES):
            garden_m = outward * (front_m + rng.uniform(-8, 14)) + along * (along_m + rng.uniform(6, 11))
            if float(np.hypot(*garden_m)) > canvas.nearest_m - 4:
                scenery.add_tree(garden_m, float(rng.uniform(3.5, 9.5)))
