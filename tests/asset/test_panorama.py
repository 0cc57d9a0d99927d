"""Panoramas by seed: what they show, and that the light of the sky stays what it is."""

import numpy as np
import pytest

from vobench.asset import PANORAMAS
from vobench.asset.panorama import Surroundings, _painted
from vobench.asset.panorama_canvas import COLUMNS, ROWS
from vobench.scene.light import Sky, Sun
from vobench.scene.material import LUMINANCE, Map
from vobench.scene.panorama import PanoramaMap

SUN = Sun("sun", 20_000.0, (0.0,), (-70.0,), (42.0,))
SKY = Sky("sky", 9000.0, "clear", SUN.direction(0))
CITY = Surroundings(kind="city", seed=3, height_m=6.0, distance_m=24.0, sun_lx=SUN.illuminance_lx)


def luminance(panorama: PanoramaMap) -> Map:
    return np.asarray(panorama.daylight.astype(np.float32) @ np.array(LUMINANCE, np.float32))


def rows_at(low_deg: float, high_deg: float) -> slice:
    """The rows between two elevations."""
    first = round((1 - np.sin(np.deg2rad(high_deg))) * ROWS / 2)
    end = round((1 - np.sin(np.deg2rad(low_deg))) * ROWS / 2)
    return slice(first, end)


@pytest.fixture(scope="module")
def city() -> PanoramaMap:
    return CITY.map_under(SKY)


def test_a_seed_gives_the_same_bytes_and_another_seed_another_city(city: PanoramaMap) -> None:
    _painted.cache_clear()
    again = CITY.map_under(SKY)
    assert again is not city
    np.testing.assert_array_equal(again.daylight, city.daylight)
    np.testing.assert_array_equal(again.lamps, city.lamps)
    other = Surroundings(kind="city", seed=4, height_m=6.0, distance_m=24.0, sun_lx=SUN.illuminance_lx)
    changed = np.abs(other.map_under(SKY).daylight - city.daylight).max(-1) > 0.01
    assert changed[rows_at(-10, 20)].mean() > 0.5


@pytest.mark.parametrize("kind", PANORAMAS)
def test_level_ground_gets_the_illuminance_of_the_sky(kind: str) -> None:
    panorama = Surroundings(kind=kind, seed=1, distance_m=40.0).map_under(Sky("sky", 9000.0))
    sine = 1 - (np.arange(ROWS // 2) + 0.5) * (2 / ROWS)
    upper = luminance(panorama)[: ROWS // 2]
    illuminance_per_lx = float((upper * sine[:, None]).sum()) * 4 * np.pi / (ROWS * COLUMNS)
    assert illuminance_per_lx == pytest.approx(1, abs=0.005)


def test_clouds_leave_the_light_of_the_sky_as_it_is() -> None:
    """Where nothing hides the sky: more than 60 degrees up, the mean of panorama and formula agree."""
    panorama = Surroundings(kind="country", seed=2).map_under(Sky("sky", 9000.0))
    rows = rows_at(60, 90)
    sine = 1 - (np.arange(rows.start, rows.stop) + 0.5) * (2 / ROWS)
    directions = np.stack([np.sqrt(1 - sine**2), 0 * sine, sine], -1)
    expected = Sky("sky", 1.0).luminance_cd_m2(directions).mean()
    seen = luminance(panorama)[rows]
    assert seen.mean() == pytest.approx(expected, rel=0.1)
    assert seen.std() > 0.03 * seen.mean()


def test_no_seam_shows_behind_the_viewer(city: PanoramaMap) -> None:
    seen = luminance(city)
    steps = np.abs(np.diff(seen, axis=1, append=seen[:, :1])).mean(0)
    assert steps[-1] < 3 * np.median(steps)


def test_walls_that_face_the_sun_are_brighter(city: PanoramaMap) -> None:
    """Walls that are seen away from the sun face it."""
    walls = luminance(city)[rows_at(-6, 3)]
    azimuth = np.deg2rad(360 * ((np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5))
    x, y, _ = SUN.direction(0)
    towards_sun = x * np.cos(azimuth) + y * np.sin(azimuth)
    lit = np.median(walls[:, towards_sun < -0.6])
    shaded = np.median(walls[:, towards_sun > 0.6])
    assert lit > 2 * shaded


def test_nothing_rises_above_the_sun() -> None:
    """The sun must reach the scene: where it stands, the panorama is sky alone."""
    low = Sun("sun", 20_000.0, (0.0,), (30.0,), (20.0,))
    sky = Sky("sky", 9000.0, "clear", low.direction(0))
    panorama = Surroundings(kind="city", seed=3, distance_m=24.0, sun_lx=low.illuminance_lx).map_under(sky)
    around = low.direction(0) + 0.012 * np.random.default_rng(0).standard_normal((200, 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    seen = panorama.seen(around) @ np.array(LUMINANCE)
    expected = sky.luminance_cd_m2(around) / sky.illuminance_lx
    assert (seen > 0.6 * expected).all()


def test_windows_are_lit_at_night_and_the_sky_is_not(city: PanoramaMap) -> None:
    assert city.lamps[rows_at(-5, 20)].max() > 5
    assert city.lamps[rows_at(60, 90)].max() == 0
    lit = (city.lamps[rows_at(-5, 20)] > 5).mean()
    assert 0.002 < lit < 0.1
