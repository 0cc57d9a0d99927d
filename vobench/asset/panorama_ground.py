"""Ground and ranges of hills of panoramas."""

import numpy as np

from vobench.asset.panorama_canvas import COLUMNS, HAZE_M, ROWS, Albedo, PanoramaCanvas, reflected_cd_m2
from vobench.asset.panorama_noise import Floats
from vobench.asset.picture import noise

ASPHALT: Albedo = (0.075, 0.075, 0.078)
PAVING: Albedo = (0.2, 0.19, 0.175)
LAWN: Albedo = (0.075, 0.1, 0.035)

# The profile of a range of hills: a sum of waves around the horizon, and on the crest noise as of trees.
WAVES = 39
WAVE_EXPONENT = -1.3  # of the amplitude by the number of the wave
LOWEST_CREST = 0.35  # of the rise
TREE_TANGENT = 0.0012
WOODS_CONTRAST = 0.35  # of the logarithm of the luminance
HILL_LIGHT = 0.6  # of the light on level ground: hills face the viewer, and woods have shadows
HILL_FOOT = -0.002  # tangent of the elevation below which the ground is painted


def ground_places(canvas: PanoramaCanvas) -> tuple[Floats, Floats, Floats]:
    """x, y in metres and the length in metres that a row covers, of the rows (ROWS / 2) below the horizon."""
    tangent = canvas.tangent[ROWS // 2 :, None]
    tangent_step = canvas.tangent_step[ROWS // 2 :, None]
    distance_m = canvas.eye_m / -tangent
    footprint_m = distance_m**2 / canvas.eye_m * tangent_step
    x_m = distance_m * np.cos(canvas.azimuth)
    y_m = distance_m * np.sin(canvas.azimuth)
    return x_m, y_m, footprint_m


def paint_ground(canvas: PanoramaCanvas, albedo: Floats) -> None:
    """Fill what is below the horizon with ground of an albedo (ROWS / 2, COLUMNS, 3) in the haze."""
    distance_m = canvas.eye_m / -canvas.tangent[ROWS // 2 :, None, None]
    clear = np.exp(-distance_m / HAZE_M)
    ground_cd_m2 = reflected_cd_m2(albedo, canvas.daylight.level_lx)
    canvas.colour[ROWS // 2 :] = clear * ground_cd_m2 + (1 - clear) * canvas.haze_cd_m2


def paint_hills(canvas: PanoramaCanvas, *, rise: float, distance_m: float, albedo: Albedo) -> None:
    """A range of hills whose crest rises to a tangent of the elevation; woods and fields lie on it."""
    crest = _crest(canvas, rise)
    rows = canvas.rows(-0.01, float(crest.max()))
    tangent = canvas.tangent[rows, None]
    cover = np.clip((crest - tangent) / canvas.tangent_step[rows, None] + 0.5, 0, 1)
    cover *= tangent > HILL_FOOT

    woods = canvas.grain(canvas.azimuth[None, :] * 0.9, tangent * 6)
    tone = np.exp(WOODS_CONTRAST * woods)[..., None]
    light_lx = HILL_LIGHT * canvas.daylight.level_lx
    colour = reflected_cd_m2(albedo, light_lx) * tone
    canvas.paint(rows, np.arange(COLUMNS), colour, cover, distance_m=distance_m)


def _crest(canvas: PanoramaCanvas, rise: float) -> Floats:
    """The tangent (COLUMNS,) of the elevation of a crest, at most `rise` but for the trees on it."""
    wave = np.arange(1, WAVES + 1)
    phase = 2 * np.pi * canvas.rng.random(WAVES)
    amplitude = wave**WAVE_EXPONENT * canvas.rng.standard_normal(WAVES)
    profile = np.cos(wave * canvas.azimuth[:, None] + phase) @ amplitude
    profile = (profile - profile.min()) / np.ptp(profile)

    roughness = noise(canvas.rng, 512, 20, 256, slope=0.8)[0]
    closed = [*roughness, roughness[0]]
    trees = np.interp(canvas.azimuth, np.linspace(-np.pi, np.pi, len(closed)), closed)
    return np.asarray(rise * (LOWEST_CREST + 0.65 * profile) + TREE_TANGENT * trees)
