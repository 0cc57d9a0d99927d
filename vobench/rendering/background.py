"""The skies behind a scene, with the values that their shaders need."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.scene.light import SKIES, Light, Sky
from vobench.scene.panorama import PanoramaMap, lamp_share

ZENITH = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class StandardSky:
    """A sky of the ISO standard. The fields (4,) are the uniforms of the shader `background`, which explains them."""

    gradation: Array
    scatter: Array
    sun: Array
    colour: Array


@dataclass(frozen=True, slots=True)
class PanoramaSky:
    """A sky with a panorama, which is found by its index among the skies.

    `illuminance_lx` is that of a horizontal plane, `lamp_share` the share of the panorama's lamps that are on.
    """

    index: int
    illuminance_lx: float
    lamp_share: float


class Background:
    """The skies among a scene's lights. `panoramas` maps the index of a sky to its panorama, if it has one."""

    def __init__(self, lights: Sequence[Light]) -> None:
        self._skies = [light for light in lights if isinstance(light, Sky)]
        self._nominal = [_standard_sky(sky) for sky in self._skies]
        self.panoramas = dict[int, PanoramaMap]()
        for index, sky in enumerate(self._skies):
            if sky.panorama is not None:
                self.panoramas[index] = sky.panorama.map_under(sky)

    def skies(self, start_ns: int, end_ns: int) -> list[StandardSky | PanoramaSky]:
        """All skies, with their mean levels over an interval."""
        skies: list[StandardSky | PanoramaSky] = []
        for index, (sky, nominal) in enumerate(zip(self._skies, self._nominal, strict=True)):
            level = sky.level.mean(start_ns, end_ns)
            if index in self.panoramas:
                illuminance_lx = level * sky.illuminance_lx
                skies.append(PanoramaSky(index, illuminance_lx, lamp_share(illuminance_lx)))
            else:
                gradation = nominal.gradation * [1, 1, level, level]
                skies.append(StandardSky(gradation, nominal.scatter, nominal.sun, nominal.colour))
        return skies

    def mean_cd_m2(self, start_ns: int, end_ns: int) -> Array:
        """The luminance (3,) of an evenly bright sky with the illuminance of all skies together, over an interval."""
        total_cd_m2 = np.zeros(3)
        for sky in self._skies:
            illuminance_lx = sky.level.mean(start_ns, end_ns) * sky.illuminance_lx
            total_cd_m2 += illuminance_lx / np.pi * np.array(sky.colour)
        return total_cd_m2


def even_sky(luminance_cd_m2: Array) -> StandardSky:
    """A background with the same luminance (3,) in every direction."""
    none = np.zeros(4)
    return StandardSky(
        gradation=np.array([0.0, 0.0, 1.0, 1.0]),
        scatter=none,
        sun=none,
        colour=np.array([*luminance_cd_m2, 0.0]),
    )


def _standard_sky(sky: Sky) -> StandardSky:
    """A sky at level 1. Source: ISO 15469:2004, eqs 1 to 7; the luminance at the zenith gives the scale."""
    a, b, c, d, e = SKIES[sky.kind]
    scatter_across = np.exp(d * np.pi / 2)  # of a direction at a right angle to the sun
    sun_zenith_cosine = np.clip(ZENITH @ sky.sun_direction, -1, 1)
    sun_zenith_rad = np.arccos(sun_zenith_cosine)
    zenith_gradation = 1 + a * np.exp(b)
    zenith_scatter = 1 + c * (np.exp(d * sun_zenith_rad) - scatter_across) + e * np.cos(sun_zenith_rad) ** 2
    zenith_cd_m2, ground_cd_m2 = sky.standard_cd_m2(np.stack([ZENITH, -ZENITH]))
    return StandardSky(
        gradation=np.array([a, b, zenith_cd_m2 / (zenith_gradation * zenith_scatter), ground_cd_m2]),
        scatter=np.array([c, d, e, scatter_across]),
        sun=np.array([*sky.sun_direction, 0.0]),
        colour=np.array([*sky.colour, 0.0]),
    )
