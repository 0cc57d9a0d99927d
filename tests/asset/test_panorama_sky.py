"""Clouds leave the illuminance of a sky as it is, and seeds repeat."""

import numpy as np
import pytest

from vobench.asset.panorama_canvas import _directions, azimuths
from vobench.asset.panorama_noise import Floats
from vobench.asset.panorama_sky import Sunlight, sky_colours
from vobench.scene.light import Sky, Sun
from vobench.scene.material import LUMINANCE, WHITE

ROWS = 40
COLUMNS = 80
SINE = 1 - (np.arange(ROWS) + 0.5) / ROWS
DIRECTIONS = _directions(azimuths(np.arange(COLUMNS), COLUMNS), SINE, np.sqrt(1 - SINE**2))
TOWARDS = Sun("sun", 20_000.0, (0.0,), (0.0,), (30.0,)).direction(0)


def colours(kind: str, seed: int = 0) -> Floats:
    sky = Sky("sky", 9000.0, kind, TOWARDS)  # type: ignore[arg-type]
    return sky_colours(DIRECTIONS, sky, Sunlight(20_000.0, WHITE), np.random.default_rng(seed))


@pytest.mark.parametrize("kind", ["clear", "overcast"])
def test_clouds_leave_the_illuminance_of_level_ground_as_it_is(kind: str) -> None:
    sky = Sky("sky", 9000.0, kind, TOWARDS)  # type: ignore[arg-type]
    bare = sky.standard_cd_m2(DIRECTIONS)
    luminance = colours(kind) @ np.array(LUMINANCE)
    assert (luminance * SINE[:, None]).sum() == pytest.approx((bare * SINE[:, None]).sum(), rel=0.02)
    assert luminance.std() > 0.02 * luminance.mean()


def test_a_seed_repeats_its_clouds_and_another_seed_has_others() -> None:
    np.testing.assert_array_equal(colours("clear", 3), colours("clear", 3))
    assert (colours("clear", 3) != colours("clear", 4)).any()


def test_a_clear_sky_is_blue_and_an_overcast_one_is_grey() -> None:
    clear = colours("clear")[:10]
    blueness = clear[..., 2] / clear[..., 0]
    assert np.quantile(blueness, 0.9) > 1.5, "between the clouds"
    overcast = colours("overcast")
    np.testing.assert_allclose(overcast[..., 0], overcast[..., 2], rtol=1e-5)


def test_a_clear_sky_is_brightest_towards_the_sun() -> None:
    luminance = colours("clear") @ np.array(LUMINANCE)
    row = int(np.abs(SINE - TOWARDS[2]).argmin())
    column = int((DIRECTIONS[row, :, :2] @ TOWARDS[:2]).argmax())
    assert luminance[row, column] > 3 * np.median(luminance)
