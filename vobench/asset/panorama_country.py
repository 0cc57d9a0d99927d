"""The country of a panorama: fields with hedges and woods before hills, and a few farms."""

import numpy as np

from vobench.asset.panorama_canvas import PanoramaCanvas
from vobench.asset.panorama_ground import LAWN, ground_places, paint_ground, paint_hills
from vobench.asset.panorama_noise import Floats
from vobench.asset.panorama_scenery import Scenery, random_place

FIELD_ALBEDOS = np.array(
    [[0.1, 0.12, 0.04], [0.16, 0.15, 0.06], [0.075, 0.1, 0.035], [0.22, 0.19, 0.1], [0.13, 0.1, 0.07]], np.float32
)
FIELD_M = (95, 140)
FIELD_YAW_RAD = 0.4
FIELD_BLUR_M = 60  # what a pixel may cover before neighbouring fields blend
HEDGE_WARP_M = 8  # how far the edges of fields are from straight lines
PATTERN_FIELDS = 64  # along each axis, after which the pattern of fields repeats
MEADOW_M = 20  # around the scene, beyond the nearest things

ROWS_OF_TREES = 34
NEAR_TREES = 40
FARMS = 6


def paint_country(canvas: PanoramaCanvas) -> None:
    """Paint two ranges of hills, fields, rows of trees, and farms."""
    rng = canvas.rng
    near_m = canvas.nearest_m
    paint_hills(canvas, rise=0.075, distance_m=11000, albedo=(0.05, 0.07, 0.05))
    paint_hills(canvas, rise=0.045, distance_m=5000, albedo=(0.06, 0.085, 0.04))
    paint_ground(canvas, _ground_albedo(canvas))

    scenery = Scenery(canvas)
    for _ in range(ROWS_OF_TREES):
        _add_row_of_trees(canvas, scenery)
    for _ in range(NEAR_TREES):
        scenery.add_tree(random_place(rng, near_m, near_m + 70), float(rng.uniform(7, 14)))
    for _ in range(FARMS):
        scenery.add_house(random_place(rng, near_m + 60, 350), rng.uniform(0, np.pi))
    scenery.paint()


def _ground_albedo(canvas: PanoramaCanvas) -> Floats:
    """The ground (ROWS / 2, COLUMNS, 3): fields in a grid, and a meadow around the scene."""
    x_m, y_m, footprint_m = ground_places(canvas)
    warp_m = HEDGE_WARP_M * canvas.grain(x_m / 900, y_m / 900)
    cosine = np.cos(FIELD_YAW_RAD)
    sine = np.sin(FIELD_YAW_RAD)
    length_m, width_m = FIELD_M
    column = np.floor((x_m * cosine + y_m * sine + warp_m) / length_m).astype(np.int32)
    row = np.floor((y_m * cosine - x_m * sine) / width_m).astype(np.int32)
    kind_of_field = canvas.rng.integers(len(FIELD_ALBEDOS), size=(PATTERN_FIELDS, PATTERN_FIELDS))
    kind = kind_of_field[column % PATTERN_FIELDS, row % PATTERN_FIELDS]
    is_meadow = np.hypot(x_m, y_m) < canvas.nearest_m + MEADOW_M
    field = np.where(is_meadow[..., None], np.array(LAWN, np.float32), FIELD_ALBEDOS[kind])

    # Far away, where pixels cover several fields, their mean is seen.
    mean = FIELD_ALBEDOS.mean(0)
    sharpness = np.clip(FIELD_BLUR_M / footprint_m - 0.5, 0, 1)[..., None]
    texture = np.exp(canvas.grass(x_m, y_m, footprint_m))[..., None]
    albedo = texture * (mean + sharpness * (field - mean))
    return np.asarray(albedo.astype(np.float32))


def _add_row_of_trees(canvas: PanoramaCanvas, scenery: Scenery) -> None:
    """Trees along the edge of a field, more or less across the direction of sight."""
    rng = canvas.rng
    start_m = random_place(rng, canvas.nearest_m + 25, 600)
    direction_of_sight = np.arctan2(start_m[1], start_m[0])
    heading = direction_of_sight + np.pi / 2 + rng.normal(0, 0.35)
    along = np.array([np.cos(heading), np.sin(heading)])
    length_m = rng.uniform(60, 220)
    spacing_m = rng.uniform(3.5, 8)
    for along_m in np.arange(0, length_m, spacing_m):
        place_m = start_m + along * along_m + rng.normal(0, 1.5, 2)
        if float(np.hypot(*place_m)) > canvas.nearest_m:
            scenery.add_tree(place_m, float(rng.uniform(5, 15)))
