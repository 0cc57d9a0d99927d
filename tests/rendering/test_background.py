"""The uniforms of the skies give the luminance of the scene's skies."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.panoramas import PANORAMA
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.background import Background, PanoramaSky, StandardSky
from vobench.scene.light import NS_PER_S, SKIES, Sky, Steady, Switched
from vobench.scene.panorama import DARK_LX, DUSK_LX

SUN_DIRECTION = np.array([0.48, 0.6, 0.64])
DIRECTIONS = unit(np.random.default_rng(0).normal(size=(200, 3)))


def shader_luminance(sky: StandardSky, directions: Array) -> Array:
    """The formula of the shader `background`, without the colour."""
    cosine = directions @ sky.sun[:3]
    c, d, e, scatter_across = sky.scatter
    a, b, scale, ground = sky.gradation
    indicatrix = 1 + c * (np.exp(d * np.arccos(cosine)) - scatter_across) + e * cosine**2
    gradation = 1 + a * np.exp(b / np.maximum(directions[:, 2], 1e-3))
    return np.where(directions[:, 2] < 0, ground, scale * indicatrix * gradation)


@pytest.mark.parametrize("kind", SKIES)
def test_the_shader_formula_gives_the_luminance_of_the_sky_in_every_direction(kind: str) -> None:
    sky = Sky("sky", 5000.0, kind, SUN_DIRECTION, colour=(0.9, 1.0, 1.1))
    (uniforms,) = Background([sky]).skies(0, 0)
    assert isinstance(uniforms, StandardSky)
    np.testing.assert_allclose(shader_luminance(uniforms, DIRECTIONS), sky.standard_cd_m2(DIRECTIONS), rtol=1e-9)
    assert uniforms.colour.tolist() == [0.9, 1.0, 1.1, 0.0]


def test_sky_and_ground_are_proportional_to_the_mean_level_of_the_interval() -> None:
    steady = Sky("sky", 5000.0, "clear", SUN_DIRECTION)
    half_on = replace(steady, level=Switched((0.5,)))
    (full,) = Background([steady]).skies(0, NS_PER_S)
    (half,) = Background([half_on]).skies(0, NS_PER_S)
    ratio = shader_luminance(half, DIRECTIONS) / shader_luminance(full, DIRECTIONS)
    np.testing.assert_allclose(ratio, half_on.level.mean(0, NS_PER_S), rtol=1e-9)
    assert 0 < ratio[0] < 1


def test_a_panorama_has_the_index_of_its_sky_and_lamps_that_turn_on_as_it_gets_dark() -> None:
    def panorama_sky(level: float) -> PanoramaSky:
        lights = [Sky("plain", 1.0), replace(PANORAMA, level=Steady(level))]
        return Background(lights).skies(0, 0)[1]

    assert panorama_sky(0.5).index == 1
    assert panorama_sky(0.5).illuminance_lx == 0.5 * PANORAMA.illuminance_lx
    assert panorama_sky(DUSK_LX / PANORAMA.illuminance_lx).lamp_share == 0
    assert panorama_sky(DARK_LX / PANORAMA.illuminance_lx).lamp_share == 1
