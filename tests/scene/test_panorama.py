"""A panorama's map: where its pixels lie, what is between them, and when its lamps are on."""

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE
from vobench.scene.panorama import PanoramaMap, lamp_share

ROWS = 64
COLUMNS = 128


def direction(azimuth_deg: float, sine: float) -> Array:
    azimuth = np.deg2rad(azimuth_deg)
    level = np.sqrt(1 - sine**2)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), sine])


def blank() -> PanoramaMap:
    return PanoramaMap(np.zeros((ROWS, COLUMNS, 3), np.float16), np.zeros((ROWS, COLUMNS), np.float16))


def test_a_pixel_is_seen_in_its_direction() -> None:
    panorama = blank()
    panorama.daylight[10, 96] = (1, 2, 3)
    azimuth_deg = 360 * (96.5 / COLUMNS - 0.5)
    sine = 1 - 2 * 10.5 / ROWS
    np.testing.assert_allclose(panorama.seen(direction(azimuth_deg, sine)), [1, 2, 3], rtol=1e-3)
    assert panorama.seen(direction(azimuth_deg + 360 / COLUMNS, sine)).max() < 1e-3
    assert panorama.seen(direction(azimuth_deg, sine - 2 / ROWS)).max() < 1e-3
    np.testing.assert_allclose(panorama.seen(direction(azimuth_deg, sine - 1 / ROWS)), [0.5, 1, 1.5], rtol=1e-3)


def test_what_is_seen_has_no_step_where_the_azimuth_starts_again() -> None:
    panorama = blank()
    panorama.daylight[:, 0] = 1
    panorama.daylight[:, -1] = 3
    before = panorama.seen(direction(179.999, 0.1))
    after = panorama.seen(direction(-179.999, 0.1))
    np.testing.assert_allclose(before, 2, atol=0.01)
    np.testing.assert_allclose(after, 2, atol=0.01)


def test_a_scene_is_lit_by_the_mean_luminance_of_cells() -> None:
    panorama = blank()
    panorama.daylight[...] = np.random.default_rng(0).random((ROWS, COLUMNS, 3))
    sky = Sky("sky", 1000.0, panorama=panorama)
    directions = np.random.default_rng(1).standard_normal((20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    expected = 1000 * float((panorama.daylight.astype(float) @ LUMINANCE).mean())
    assert sky.luminance_cd_m2(directions).mean() == pytest.approx(expected, rel=2e-3)
    assert panorama.light.shape == (ROWS // 16, COLUMNS // 16)


def test_the_lamps_go_on_as_it_grows_dark() -> None:
    shares = [lamp_share(lx) for lx in (10_000, 400, 300, 200, 40, 0)]
    assert shares[:2] == [0, 0]
    assert shares[-2:] == [1, 1]
    assert shares == sorted(shares)
    assert 0 < shares[2] < shares[3] < 1
