"""The light of places by name and seed: sun, sky and surroundings for a time of day, and the colours of lamps."""

from dataclasses import dataclass

import numpy as np

from vobench.asset.panorama import Surroundings
from vobench.asset.picture import Rng
from vobench.errors import require_known
from vobench.scene.light import Light, Sky, Sun
from vobench.scene.material import LUMINANCE, Rgb

LIGHTINGS = ("day", "evening", "night", "overcast")
SEEDS = 1 << 16  # of panoramas

# Linear RGB of black bodies at some temperatures.
BLACK_BODIES_K = (2700.0, 3000.0, 4000.0, 5000.0, 6500.0)
BLACK_BODIES_RGB = ((1.0, 0.43, 0.13), (1.0, 0.48, 0.18), (1.0, 0.65, 0.39), (1.0, 0.78, 0.62), (1.0, 0.93, 1.0))
NEAR_M = (18.0, 45.0)  # from a window to what is across the street
LAMP_SHARES = {"day": 0.0, "evening": 0.9, "night": 0.95, "overcast": 0.45}  # of rooms whose lamps are on

# The sun. Its illuminance follows Beer's law by the length of the path of its light, 1 / sine of the elevation.
SUN_LX = 62000  # of a surface that faces the sun, outside of the atmosphere: half of the real one, for thin haze
EXTINCTION = 0.22  # optical depth of the atmosphere towards the zenith
REDNESS_DECAY = 9  # of the redness of sun and sky by the sine of the elevation, chosen by eye
SUN_SPREAD_DEG = 60  # to either side of what the sun shines at
HIGH_SUN_DEG = (18, 52)  # elevation by day
LOW_SUN_DEG = (3.5, 11)  # elevation in the evening

# The sky: illuminance of level ground
NIGHT_LOG10_LX = (-1.2, 0.4)  # of a town
OVERCAST_LX = (5000, 15000)

ADAPTED = 0.35  # the share of a lamp's tint that remains after the eye, or white balance, adapted to it


@dataclass(frozen=True, slots=True)
class Daylight:
    """What comes from outside, and how likely a lamp is on."""

    lights: tuple[Light, ...]
    lamp_share: float


def unit_luminance(colour: Rgb) -> Rgb:
    """A colour scaled to a luminance of 1."""
    red, green, blue = (np.array(colour) / (np.array(colour) @ np.array(LUMINANCE))).tolist()
    return red, green, blue


def lamp_colour(temperature_k: float) -> Rgb:
    """The colour of a lamp, of luminance 1, under half adapted eyes."""
    channels = np.array(BLACK_BODIES_RGB)
    pure = [float(np.interp(temperature_k, BLACK_BODIES_K, channels[:, channel])) for channel in range(3)]
    red, green, blue = (ADAPTED * np.array(pure) + (1 - ADAPTED) * np.array([1.0, 0.85, 0.72])).tolist()
    return unit_luminance((red, green, blue))


def level_daylight(
    rng: Rng,
    direction_rng: Rng,
    lighting: str,
    *,
    kinds: tuple[str, ...],
    distance_m: tuple[float, float],
) -> Daylight:
    """The daylight of a place at ground level, on which the sun shines from any side."""
    towards_deg = float(direction_rng.uniform(0, 360))
    return daylight(rng, lighting, towards_deg=towards_deg, height_m=0.0, kinds=kinds, distance_m=distance_m)


def daylight(
    rng: Rng,
    lighting: str,
    *,
    towards_deg: float,
    height_m: float,
    kinds: tuple[str, ...],
    distance_m: tuple[float, float] = NEAR_M,
) -> Daylight:
    """Sun and sky of a lighting, one of LIGHTINGS, with surroundings of one of `kinds`.

    towards_deg: the azimuth of what a sun shines at, such as the largest window; it stands within 60° of that.
    height_m: how high z = 0 is above the ground. distance_m: the range of the distance to the first things around.

    Raises:
        UnknownNameError: there is no such lighting.
    """
    require_known("lighting", lighting, LIGHTINGS)
    kind = str(rng.choice(kinds))
    seed = int(rng.integers(SEEDS))
    first_m = float(rng.uniform(*distance_m))
    azimuth_deg = towards_deg + float(rng.uniform(-SUN_SPREAD_DEG, SUN_SPREAD_DEG))
    elevation_deg = _elevation_deg(rng, lighting)
    sine = float(np.sin(np.deg2rad(elevation_deg)))
    sun_lx = SUN_LX * float(np.exp(-EXTINCTION / sine))
    redness = float(np.exp(-REDNESS_DECAY * sine))
    sun_colour = unit_luminance((1.0, 0.93 - 0.35 * redness, 0.82 - 0.62 * redness))
    sky_lx = _sky_lx(rng, lighting, sine)

    has_sun = lighting in ("day", "evening")
    around = Surroundings(
        kind=kind,
        seed=seed,
        height_m=height_m,
        distance_m=first_m,
        sun_lx=sun_lx if has_sun else 0.0,
        sun_colour=sun_colour,
    )
    sun = Sun("sun", sun_lx, (0.0,), (azimuth_deg,), (elevation_deg,), colour=sun_colour)
    towards = sun.direction(0) if has_sun else np.array([0.0, 0.0, 1.0])
    sky_kind = "overcast" if lighting == "overcast" else "clear"
    sky = Sky("sky", sky_lx, sky_kind, towards, colour=_sky_colour(lighting, redness), panorama=around)
    return Daylight((sun, sky) if has_sun else (sky,), LAMP_SHARES[lighting])


def _elevation_deg(rng: Rng, lighting: str) -> float:
    """Draw the elevation of the sun. A high sun is drawn for all lightings, so that they share what is drawn later."""
    elevation_deg = float(rng.uniform(*HIGH_SUN_DEG))
    if lighting == "evening":
        elevation_deg = float(rng.uniform(*LOW_SUN_DEG))
    return elevation_deg


def _sky_lx(rng: Rng, lighting: str, sine: float) -> float:
    """The illuminance of level ground by the sky, by the sine of the elevation of the sun."""
    night_lx = 10 ** float(rng.uniform(*NIGHT_LOG10_LX))
    overcast_lx = float(rng.uniform(*OVERCAST_LX))
    by_lighting = {
        "day": 9000 + 9000 * sine,
        "evening": 150 + 5000 * sine,
        "night": night_lx,
        "overcast": overcast_lx,
    }
    return by_lighting[lighting]


def _sky_colour(lighting: str, redness: float) -> Rgb:
    """The colour of the sky, of luminance 1; `redness` is that of the sun, 0 when high to 1 at the horizon."""
    if lighting == "night":
        return unit_luminance((0.9, 0.9, 1.1))
    if lighting == "overcast":
        return unit_luminance((0.95, 0.98, 1.05))
    return unit_luminance((0.72 + 0.2 * redness, 0.84, 1.0))
