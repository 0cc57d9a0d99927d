"""Panoramas by seed: the streets, gardens or fields around a scene, under a sky with clouds.

The map of a panorama is painted from far to near. Nothing in it has parallax, so all of it is as seen from one place.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Annotated
from zlib import crc32

import numpy as np
from annotated_types import Ge, Le

from vobench.asset import PANORAMAS
from vobench.asset.panorama_canvas import EYE_M, PanoramaCanvas
from vobench.asset.panorama_city import paint_city
from vobench.asset.panorama_country import paint_country
from vobench.asset.panorama_sky import Sunlight
from vobench.asset.panorama_suburb import paint_suburb
from vobench.scene.light import Sky
from vobench.scene.material import WHITE, Rgb
from vobench.scene.panorama import PanoramaMap
from vobench.setting import NonNegative, OneOf, Positive, settings

LEAST_SKY_LX = 1e-3  # the map is in units of the sky's illuminance, which may be 0 at night

PAINTERS: dict[str, Callable[[PanoramaCanvas], None]] = {
    "city": paint_city,
    "suburb": paint_suburb,
    "country": paint_country,
}


@settings()
class Surroundings:
    """What surrounds a scene.

    height_m: how high the scene's z = 0 is above the ground around. distance_m: how near the first things are.
    sun_lx, sun_colour: of a sun where the sky is brightest.
    """

    kind: Annotated[str, OneOf("panorama", PANORAMAS)]
    seed: Annotated[int, Ge(0)] = 0
    height_m: Annotated[float, Ge(0), Le(300)] = 0.0
    distance_m: Positive = 30.0
    sun_lx: NonNegative = 0.0
    sun_colour: Rgb = WHITE

    def map_under(self, sky: Sky) -> PanoramaMap:
        """The map of the panorama; it takes a second to paint and is cached."""
        x, y, z = (float(part) for part in sky.sun_direction)
        return _painted(self, sky.illuminance_lx, sky.kind, (x, y, z), sky.ground_albedo)


@lru_cache(maxsize=2)  # each takes 42 MB
def _painted(
    surroundings: Surroundings,
    illuminance_lx: float,
    kind: str,
    sun_direction: tuple[float, float, float],
    ground_albedo: float,
) -> PanoramaMap:
    """The map under a sky, whose fields are passed one by one because they are the key of the cache."""
    sky = Sky("sky", max(illuminance_lx, LEAST_SKY_LX), kind, np.array(sun_direction), ground_albedo)
    canvas = PanoramaCanvas(
        sky,
        Sunlight(surroundings.sun_lx, surroundings.sun_colour),
        eye_m=surroundings.height_m + EYE_M,
        nearest_m=surroundings.distance_m,
        rng=np.random.default_rng([surroundings.seed, crc32(surroundings.kind.encode())]),
    )
    paint = PAINTERS[surroundings.kind]
    paint(canvas)
    return canvas.finished()
