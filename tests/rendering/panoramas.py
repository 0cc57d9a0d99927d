"""A panorama whose luminance is a formula."""

import numpy as np

from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE
from vobench.scene.panorama import PanoramaMap

ROWS = 256
COLUMNS = 512


def waves() -> PanoramaMap:
    """A panorama in smooth waves, without a step at azimuth 180 degrees; its lamps are 7 cd/m²."""
    azimuth = 2 * np.pi * (np.arange(COLUMNS) + 0.5) / COLUMNS
    sine = 1 - 2 * (np.arange(ROWS) + 0.5) / ROWS
    level = 1 + 0.4 * np.cos(5 * azimuth) + 0.3 * np.sin(3 * np.pi * sine)[:, None]
    daylight = level[..., None] * [0.3, 0.2, 0.1]
    return PanoramaMap(daylight.astype(np.float16), np.full((ROWS, COLUMNS), 7.0, np.float16))


PANORAMA = Sky("sky", 1000.0, panorama=waves())


def level_illuminance_lx() -> float:
    """The illuminance of level ground by PANORAMA."""
    luminance = 1000 * waves().daylight.astype(float) @ LUMINANCE
    sine = 1 - 2 * (np.arange(ROWS) + 0.5) / ROWS
    return float((luminance * np.maximum(sine, 0)[:, None]).sum() * 4 * np.pi / luminance.size)
