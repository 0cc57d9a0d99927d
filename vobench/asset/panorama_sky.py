"""The sky of a panorama: the sky's law, and clouds that leave its illuminance as it is."""

from dataclasses import dataclass

import numpy as np

from vobench.asset.panorama_noise import Floats, sample_tile, smooth_tile
from vobench.asset.picture import Rng, noise
from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE, Rgb

# The colours of a clear sky, of which only the ratios count; chosen by eye from photographs.
CLEAR_ZENITH = np.array([0.38, 0.66, 1.35], np.float32)
CLEAR_HORIZON = np.array([0.86, 0.97, 1.2], np.float32)

# A layer of clouds of one height, seen in perspective.
CLOUD_HEIGHT_M = 1400.0
CLOUD_TILE_M = 9000.0
CLOUD_TILE_PX = 1024
CURVATURE = 0.06  # added to the sine of the elevation: the earth's curve bounds the distance of clouds

# Clouds are where the noise of unit variance exceeds a threshold; their edges are as wide as EDGE.
CLOUD_THRESHOLD = 0.55
CLOUD_EDGE = 0.7
# The luminance of a cloud is that of a diffuse surface that reflects these shares of the light of sky and sun.
CLOUD_SKY_SHARE = 0.55
CLOUD_SUN_SHARE = 0.18
THIN_BRIGHTNESS = 1.35
THICK_DARKENING = 0.5  # thick clouds are darker below
LEAST_CLOUD = 0.9  # of the sky behind
OVERCAST_CONTRAST = 0.16  # of the logarithm of the luminance


@dataclass(frozen=True, slots=True)
class Sunlight:
    """The sun of a panorama: its illuminance of a surface that faces it, and its colour."""

    illuminance_lx: float
    colour: Rgb


def sky_colours(directions: Floats, sky: Sky, sun: Sunlight, rng: Rng) -> Floats:
    """The luminance (r, c, 3) of a sky in directions (r, c, 3) of pixels of one solid angle, in cd/m²."""
    luminance = sky.standard_cd_m2(directions).astype(np.float32)
    sine = directions[..., 2]  # of the elevation
    chroma = _chroma(sky, sine)

    reach_m = CLOUD_HEIGHT_M / (sine + CURVATURE)
    u = directions[..., 0] * reach_m / CLOUD_TILE_M
    v = directions[..., 1] * reach_m / CLOUD_TILE_M
    tile = smooth_tile(noise(rng, CLOUD_TILE_PX, 2, 400, slope=1.65))
    density = sample_tile(tile, u, v)

    if sky.kind == "clear":
        cover = _cloud_cover(density)
        cloud = _cloud_luminance(density, sky, sun)
        cloudy = (1 - cover) * luminance + cover * np.maximum(cloud, LEAST_CLOUD * luminance)
        cloud_chroma = 0.5 + 0.5 * np.array(sun.colour, np.float32)
        chroma = chroma + cover[..., None] * (cloud_chroma - chroma)
    elif sky.kind == "overcast":
        cloudy = luminance * np.exp(OVERCAST_CONTRAST * density)
    else:
        cloudy = luminance

    # The sum of luminance times sine over pixels of one solid angle is the illuminance.
    illuminance = (luminance * sine).sum(dtype=float)
    cloudy_illuminance = (cloudy * sine).sum(dtype=float)
    cloudy = cloudy * np.float32(illuminance / cloudy_illuminance)
    return np.asarray(cloudy[..., None] * chroma)


def _chroma(sky: Sky, sine: Floats) -> Floats:
    """The colour (r, 1, 3) or (1,) of a sky of luminance 1, by the sine (r, c) of the elevation, equal along rows."""
    if sky.kind == "clear":
        sine_of_row = sine[:, :1]
        height = np.sqrt(sine_of_row)[..., None]
        colour = CLEAR_HORIZON + (CLEAR_ZENITH - CLEAR_HORIZON) * height
    else:
        colour = np.ones(3, np.float32)
    luminance = colour @ np.array(LUMINANCE, np.float32)
    return np.asarray(colour / luminance[..., None])


def _cloud_cover(density: Floats) -> Floats:
    """How much of the clear sky clouds cover, with smooth edges."""
    linear = np.clip((density - CLOUD_THRESHOLD) / CLOUD_EDGE, 0, 1)
    return np.asarray(linear * linear * (3 - 2 * linear))


def _cloud_luminance(density: Floats, sky: Sky, sun: Sunlight) -> Floats:
    """The luminance of clouds by their density."""
    thickness = np.clip(density - 1.0, 0, 1.2)
    brightness = THIN_BRIGHTNESS - THICK_DARKENING * thickness
    sky_cd_m2 = CLOUD_SKY_SHARE * sky.illuminance_lx / np.pi
    sun_cd_m2 = CLOUD_SUN_SHARE * sun.illuminance_lx / np.pi
    return np.asarray(brightness * np.float32(sky_cd_m2 + sun_cd_m2))
