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
    azimuth_deg = towards_deg + float(rng.uniform(-60, 60))
    elevation_deg = float(rng.uniform(18, 52))
    if lighting == "evening":
        elevation_deg = float(rng.uniform(3.5, 11))
    sine = float(np.sin(np.deg2rad(elevation_deg)))
    sun_lx = 62000 * float(np.exp(-0.22 / sine))  # Beer's law; attenuated by thin haze
    redness = float(np.exp(-9 * sine))
    sun_colour = unit_luminance((1.0, 0.93 - 0.35 * redness, 0.82 - 0.62 * redness))
    sky_lx = {
        "day": 9000 + 9000 * sine,
        "evening": 150 + 5000 * sine,
        "night": 10 ** float(rng.uniform(-1.2, 0.4)),
        "overcast": float(rng.uniform(5000, 15000)),
    }[lighting]
    has_sun = lighting in ("day", "evening")
    if lighting == "night":
        sky_colour = unit_luminance((0.9, 0.9, 1.1))
    elif lighting == "overcast":
        sky_colour = unit_luminance((0.95, 0.98, 1.05))
    else:
        sky_colour = unit_luminance((0.72 + 0.2 * redness, 0.84, 1.0))

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
    sky = Sky("sky", sky_lx, sky_kind, towards, colour=sky_colour, panorama=around)
    lamp_share = {"day": 0.0, "evening": 0.9, "night": 0.95, "overcast": 0.45}[lighting]
    return Daylight((sun, sky) if has_sun else (sky,), lamp_share)
