"""What is seen where nothing stands: the skies, each as the numbers its formula needs on the graphics side."""

from collections.abc import Sequence

import numpy as np

from vobench.geometry.se3 import Array
from vobench.scene.light import SKIES, Light, Sky

ZENITH = np.array([0.0, 0.0, 1.0])


class Background:
    """The skies among a scene's lights."""

    def __init__(self, lights: Sequence[Light]) -> None:
        self.skies = [light for light in lights if isinstance(light, Sky)]
        self._nominal = np.array([_coefficients(sky) for sky in self.skies]).reshape(-1, 3, 4)

    def coefficients(self, start_ns: int, end_ns: int) -> Array:
        """(S, 3, 4): `gradation`, `scatter` and `sun` of the shader, with the mean level over an interval."""
        now = self._nominal.copy()
        levels = [sky.level.mean(start_ns, end_ns) for sky in self.skies]
        now[:, 0, 2:] *= np.reshape(levels, (-1, 1))
        return now


def _coefficients(sky: Sky) -> Array:
    """Source: ISO 15469:2004, eqs 1 to 7; the scale follows from the luminance at the zenith."""
    a, b, c, d, e = SKIES[sky.kind]
    across = np.exp(d * np.pi / 2)
    chi = np.arccos(np.clip(ZENITH @ sky.sun_direction, -1, 1))
    relative = (1 + a * np.exp(b)) * (1 + c * (np.exp(d * chi) - across) + e * np.cos(chi) ** 2)
    zenith, ground = sky.luminance_cd_m2(np.stack([ZENITH, -ZENITH]))
    return np.array([[a, b, zenith / relative, ground], [c, d, e, across], [*sky.sun_direction, 0]])
