"""Daylight by name and seed: what shines, how high the sun is, and the colours of lamps."""

import numpy as np
import pytest

from vobench.asset import daylight
from vobench.errors import UnknownNameError
from vobench.scene.light import Sky, Sun
from vobench.scene.material import LUMINANCE


def lights_of(lighting: str, seed: int = 0) -> daylight.Daylight:
    rng = np.random.default_rng(seed)
    return daylight.daylight(rng, lighting, towards_deg=90, height_m=4.0, kinds=("city", "country"))


@pytest.mark.parametrize("lighting", daylight.LIGHTINGS)
def test_a_lighting_has_one_sky_and_by_day_and_in_the_evening_a_sun(lighting: str) -> None:
    for seed in range(20):
        lights = lights_of(lighting, seed).lights
        skies = [light for light in lights if isinstance(light, Sky)]
        suns = [light for light in lights if isinstance(light, Sun)]
        assert [sky.name for sky in skies] == ["sky"]
        assert len(suns) == (lighting in ("day", "evening"))


def test_the_sun_is_low_and_red_in_the_evening_and_stands_before_what_it_shines_at() -> None:
    for seed in range(20):
        (noon,) = (light for light in lights_of("day", seed).lights if isinstance(light, Sun))
        (evening,) = (light for light in lights_of("evening", seed).lights if isinstance(light, Sun))
        assert evening.elevation_deg[0] < 12 < noon.elevation_deg[0]
        assert evening.illuminance_lx < noon.illuminance_lx
        assert evening.colour[0] / evening.colour[2] > noon.colour[0] / noon.colour[2]
        assert abs(noon.azimuth_deg[0] - 90) <= 60


def test_night_is_darker_than_any_other_sky_and_its_lamps_are_mostly_on() -> None:
    sky_lx = {name: lights_of(name).lights[-1].illuminance_lx for name in daylight.LIGHTINGS}  # type: ignore[union-attr]
    assert sky_lx["night"] < 3
    assert min(sky_lx["day"], sky_lx["evening"], sky_lx["overcast"]) > 100
    assert lights_of("night").lamp_share > 0.9
    assert lights_of("day").lamp_share == 0


def test_an_unknown_lighting_is_an_error() -> None:
    with pytest.raises(UnknownNameError, match="overcast"):
        lights_of("overcst")


def test_lamps_have_unit_luminance_and_are_redder_the_colder_the_black_body() -> None:
    ratios = []
    for temperature_k in (2700, 3500, 5000, 6500):
        colour = np.array(daylight.lamp_colour(temperature_k))
        assert colour @ np.array(LUMINANCE) == pytest.approx(1)
        ratios.append(colour[0] / colour[2])
    assert ratios == sorted(ratios, reverse=True)
