"""The map of a panorama while it is painted: its columns and rows, haze, and the light outside."""

import numpy as np
import pytest

from vobench.asset.panorama_canvas import (
    COLUMNS,
    HAZE_M,
    ROWS,
    OutdoorLight,
    PanoramaCanvas,
    _runs,
    albedo_of,
    azimuths,
)
from vobench.asset.panorama_sky import Sunlight
from vobench.scene.light import Sky, Sun
from vobench.scene.material import WHITE

SUN = Sun("sun", 20_000.0, (0.0,), (0.0,), (30.0,))
SKY = Sky("sky", 9000.0, "overcast", SUN.direction(0))


@pytest.fixture(scope="module")
def canvas() -> PanoramaCanvas:
    return PanoramaCanvas(SKY, Sunlight(0.0, WHITE), eye_m=2.0, nearest_m=30.0, rng=np.random.default_rng(1))


def test_columns_beyond_the_last_one_go_on_at_the_first() -> None:
    runs = _runs(np.arange(COLUMNS - 3, COLUMNS + 4))
    assert [(run.in_map, run.in_columns) for run in runs] == [
        (slice(COLUMNS - 3, COLUMNS), slice(0, 3)),
        (slice(0, 4), slice(3, 7)),
    ]
    assert [run.in_map for run in _runs(np.arange(-2, 2))] == [slice(COLUMNS - 2, COLUMNS), slice(0, 2)]


def test_azimuths_rise_from_minus_to_plus_180_degrees() -> None:
    azimuth = azimuths(np.arange(COLUMNS))
    assert azimuth[0] == pytest.approx(-azimuth[-1])
    np.testing.assert_allclose(np.diff(azimuth), 2 * np.pi / COLUMNS)


def test_rows_and_columns_contain_what_they_are_asked_for(canvas: PanoramaCanvas) -> None:
    rows = canvas.rows(-0.1, 0.3)
    assert canvas.tangent[rows].max() > 0.3
    assert canvas.tangent[rows].min() < -0.1
    columns = canvas.columns(0.5, 0.6)
    assert azimuths(columns[:1])[0] < 0.5
    assert azimuths(columns[-1:])[0] > 0.6


def test_what_is_far_fades_into_the_haze(canvas: PanoramaCanvas) -> None:
    rows = slice(ROWS - 4, ROWS)
    columns = np.arange(10)
    cover = np.ones((4, 10), np.float32)
    canvas.paint(rows, columns, np.zeros((4, 10, 3)), cover, distance_m=HAZE_M)
    expected = (1 - np.exp(-1)) * canvas.haze_cd_m2[:10]
    np.testing.assert_allclose(canvas.colour[rows, :10], np.broadcast_to(expected, (4, 10, 3)), rtol=1e-5)
    canvas.paint(rows, columns, np.full((4, 10, 3), 7.0), 0 * cover, distance_m=1.0)
    np.testing.assert_allclose(canvas.colour[rows, :10], np.broadcast_to(expected, (4, 10, 3)), rtol=1e-5)


def test_a_uniform_sky_lights_level_ground_by_pi_and_upright_walls_by_half_of_it() -> None:
    uniform = np.ones((ROWS // 2, COLUMNS, 3), np.float32)
    light = OutdoorLight(Sky("sky", np.pi, "overcast", SUN.direction(0), 0.0), Sunlight(0.0, WHITE), uniform)
    np.testing.assert_allclose(light.sky_lx, np.pi, rtol=1e-3)
    np.testing.assert_allclose(light.upright_lx(1.0), np.pi / 2, rtol=2e-2)


def test_the_sun_lights_level_ground_by_its_sine_and_a_wall_that_faces_it_by_its_cosine() -> None:
    dark = np.zeros((ROWS // 2, COLUMNS, 3), np.float32)
    light = OutdoorLight(Sky("sky", 1.0, "clear", SUN.direction(0), 0.0), Sunlight(1000.0, WHITE), dark)
    x, y, z = SUN.direction(0)
    np.testing.assert_allclose(light.level_lx, 1000 * z, rtol=1e-5)
    towards_sun = float(np.arctan2(y, x))
    np.testing.assert_allclose(light.upright_lx(towards_sun), 1000 * np.hypot(x, y), rtol=1e-5)
    assert light.upright_lx(towards_sun + np.pi).max() == pytest.approx(0, abs=1e-6)


def test_albedos_are_linear() -> None:
    assert albedo_of("#ffffff") == pytest.approx((1, 1, 1))
    assert albedo_of("#000000") == (0, 0, 0)
    assert albedo_of("#808080")[0] == pytest.approx(0.2159, abs=1e-3)
