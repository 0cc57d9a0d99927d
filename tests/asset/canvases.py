"""Canvases of panoramas under an overcast sky, for tests of what is painted on them."""

from copy import copy
from functools import cache

import numpy as np

from vobench.asset.panorama_canvas import PanoramaCanvas
from vobench.asset.panorama_sky import Sunlight
from vobench.scene.light import Sky, Sun
from vobench.scene.material import WHITE

SUN = Sun("sun", 20_000.0, (0.0,), (0.0,), (30.0,))
NEAREST_M = 30.0


@cache
def _empty() -> PanoramaCanvas:
    sky = Sky("sky", 9000.0, "overcast", SUN.direction(0))
    light = Sunlight(20_000.0, WHITE)
    return PanoramaCanvas(sky, light, eye_m=2.0, nearest_m=NEAREST_M, rng=np.random.default_rng(1))


def canvas(seed: int = 1) -> PanoramaCanvas:
    """A canvas that may be painted on, with a random generator of its own."""
    copied = copy(_empty())
    copied.colour = copied.colour.copy()
    copied.lamps = copied.lamps.copy()
    copied.rng = np.random.default_rng(seed)
    return copied
