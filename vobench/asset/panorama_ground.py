"""Paints the ground and ranges of hills into panoramas."""

import numpy as np

from vobench.asset.panorama_canvas import COLUMNS, HAZE_M, ROWS, Albedo, PanoramaCanvas, reflected_cd_m2
from vobench.asset.panorama_noise import Floats
from vobench.asset.picture import noise

ASPHALT: Albedo = (0.075, 0.075, 0.078)
PAVING: Albedo = (0.2, 0.19, 0.175)
LAWN: Albedo = (0.075, 0.1, 0.035)

# The crest of a range of hills is a sum of sine waves around the horizon, plus noise that looks like trees.
WAVES = 39
WAVE_EXPONENT = -1.3  # the amplitude of wave n is proportional to n to this power
LOWEST_CREST = 0.35  # the lowest point of the crest relative to the highest
TREE_TANGENT = 0.0012  # the standard deviation of the noise, as the tangent of an elevation
WOODS_CONTRAST = 0.35  # the standard deviation of the logarithm of the luminance
# Tiles of noise for each radian of azimuth and for each unit of the tangent of the elevation.
WOODS_TILES_PER_RAD = 0.9
WOODS_TILES_PER_TANGENT = 6
HILL_LIGHT = 0.6  # illuminance relative to level ground: slopes face the viewer, and woods cast shadows
HILL_BOTTOM_TANGENT = -0.01  # the tangent of the elevation of the lowest row that is computed
HILL_FOOT_TANGENT = -0.002  # hills are painted only above this tangent of the elevation


def ground_places(canvas: PanoramaCanvas) -> tuple[Floats, Floats, Floats]:
    """The ground point of each pixel below the horizon, and the length of ground that a row of pixels covers.

    Returns x_m (ROWS / 2, COLUMNS), y_m (ROWS / 2, COLUMNS) and footprint_m (ROWS / 2, 1).
    """
    tangent = canvas.tangent[ROWS // 2 :, None]
    tangent_step = canvas.tangent_step[ROWS // 2 :, None]
    distance_m = canvas.eye_m / -tangent
    # The derivative of eye / tangent is eye / tangent², which is distance² / eye.
    metres_per_tangent = distance_m**2 / canvas.eye_m
    footprint_m = metres_per_tangent * tangent_step
    x_m = distance_m * np.cos(canvas.azimuth)
    y_m = distance_m * np.sin(canvas.azimuth)
    return x_m, y_m, footprint_m


def paint_ground(canvas: PanoramaCanvas, albedo: Floats) -> None:
    """Paint ground with an albedo (ROWS / 2, COLUMNS, 3) below the horizon. It fades into haze with the distance."""
    distance_m = canvas.eye_m / -canvas.tangent[ROWS // 2 :, None, None]
    transmittance = np.exp(-distance_m / HAZE_M)
    ground_cd_m2 = reflected_cd_m2(albedo, canvas.daylight.level_lx)
    canvas.colour[ROWS // 2 :] = transmittance * ground_cd_m2 + (1 - transmittance) * canvas.haze_cd_m2


def paint_hills(canvas: PanoramaCanvas, *, rise: float, distance_m: float, albedo: Albedo) -> None:
    """Paint a range of hills with woods and fields.

    `rise` is the tangent of the elevation of the highest point, not including trees.
    `distance_m` is the distance of the hills, which determines how hazy they are.
    `albedo` is their mean albedo.
    """
    crest = _crest(canvas, rise)
    rows = canvas.rows(HILL_BOTTOM_TANGENT, float(crest.max()))
    tangent = canvas.tangent[rows, None]
    rows_below_crest = (crest - tangent) / canvas.tangent_step[rows, None]
    coverage = np.clip(rows_below_crest + 0.5, 0, 1)  # the share of each pixel that is below the crest
    coverage *= tangent > HILL_FOOT_TANGENT

    woods = canvas.grain(canvas.azimuth[None, :] * WOODS_TILES_PER_RAD, tangent * WOODS_TILES_PER_TANGENT)
    tone = np.exp(WOODS_CONTRAST * woods)[..., None]
    light_lx = HILL_LIGHT * canvas.daylight.level_lx
    colour = reflected_cd_m2(albedo, light_lx) * tone
    canvas.paint(rows, np.arange(COLUMNS), colour, coverage, distance_m=distance_m)


def _crest(canvas: PanoramaCanvas, rise: float) -> Floats:
    """The tangent (COLUMNS,) of the elevation of a crest. It is at most `rise`, not including the trees."""
    wave = np.arange(1, WAVES + 1)
    phase = 2 * np.pi * canvas.rng.random(WAVES)
    amplitude = wave**WAVE_EXPONENT * canvas.rng.standard_normal(WAVES)
    angle_rad = wave * canvas.azimuth[:, None] + phase  # (COLUMNS, WAVES)
    wave_sum = np.cos(angle_rad) @ amplitude
    profile = (wave_sum - wave_sum.min()) / np.ptp(wave_sum)  # from 0 to 1

    # A row of the noise goes once around the horizon. Its first sample is repeated at the end, where both are the same.
    tree_heights = noise(canvas.rng, 512, 20, 256, slope=0.8)[0]
    closed_tree_heights = [*tree_heights, tree_heights[0]]
    sample_azimuth = np.linspace(-np.pi, np.pi, len(closed_tree_heights))
    trees = np.interp(canvas.azimuth, sample_azimuth, closed_tree_heights)

    relative_height = LOWEST_CREST + (1 - LOWEST_CREST) * profile
    hills = rise * relative_height
    return np.asarray(hills + TREE_TANGENT * trees)
