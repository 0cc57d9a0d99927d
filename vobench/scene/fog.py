"""Fog: the share of light that it lets through along a ray, and the light that it adds."""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from vobench.geometry.se3 import Array
from vobench.setting import settings

CONTRAST_THRESHOLD = 0.02  # Koschmieder (1924): what has less contrast is not visible


@settings()
class Fog:
    """Homogeneous fog. At the distance `visibility_m` it leaves 2 % of the contrast of a black thing.

    `airlight` says which light the fog scatters towards the camera: the mean luminance of the scene's surfaces
    (`light`), or that of an evenly bright sky with the illuminance of the scene's sky (`sky`).
    """

    visibility_m: Annotated[float, Ge(1), Le(1e5)]
    airlight: Literal["light", "sky"] = "light"

    @property
    def extinction_per_m(self) -> float:
        """The extinction coefficient beta, by which light decreases along a ray."""
        return float(-np.log(CONTRAST_THRESHOLD) / self.visibility_m)

    def transmittance(self, distance_m: Array) -> Array:
        """The share of light that passes along rays of a length in metres, exp(-beta d) (Bouguer's law)."""
        return np.exp(-self.extinction_per_m * distance_m)
