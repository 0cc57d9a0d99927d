"""Distant buildings and walls: where they are seen, and how high they may be."""

import numpy as np
import pytest

from vobench.asset.panorama_building import DistantBuilding, height_below_sun_m
from vobench.asset.panorama_canvas import PanoramaCanvas, azimuths
from vobench.asset.panorama_sky import Sunlight
from vobench.asset.panorama_wall import DistantFacade, coverage, seen_wall
from vobench.scene.light import Sky, Sun
from vobench.scene.material import WHITE

SUN = Sun("sun", 20_000.0, (0.0,), (0.0,), (30.0,))
GREY = DistantFacade((0.5, 0.5, 0.5), (0.5, 0.5, 0.5))


@pytest.fixture(scope="module")
def canvas() -> PanoramaCanvas:
    sky = Sky("sky", 9000.0, "overcast", SUN.direction(0))
    return PanoramaCanvas(sky, Sunlight(20_000.0, WHITE), eye_m=2.0, nearest_m=30.0, rng=np.random.default_rng(1))


def test_pixels_of_a_band_add_up_to_its_width() -> None:
    step = np.full(200, 0.1)
    values = np.arange(200) * 0.1
    assert (coverage(values, 3.33, 7.91, step) * step).sum() == pytest.approx(4.58)


def test_a_wall_is_seen_from_its_front_only_and_nearest_where_it_is_faced(canvas: PanoramaCanvas) -> None:
    right_m = np.array([20.0, -5.0])
    left_m = np.array([20.0, 5.0])
    front = seen_wall(canvas, left_m, right_m)
    assert front is not None
    assert seen_wall(canvas, right_m, left_m) is None
    assert front.distance_m.min() == pytest.approx(20, rel=1e-3)
    expected_m = 20 / np.cos(azimuths(front.columns))
    np.testing.assert_allclose(front.distance_m, expected_m, rtol=1e-5)
    np.testing.assert_allclose(front.along_m, 5 - 20 * np.tan(azimuths(front.columns)), atol=1e-4)


def test_corners_are_counter_clockwise_and_as_far_from_the_middle_at_any_yaw() -> None:
    for yaw_rad in (0.0, 0.7, 2.9):
        corners_m = DistantBuilding((3.0, 4.0), (2.0, 1.0), yaw_rad, 9.0, GREY).corners_m()
        following = np.roll(corners_m, -1, axis=0)
        area_m2 = (corners_m[:, 0] * following[:, 1] - corners_m[:, 1] * following[:, 0]).sum() / 2
        assert area_m2 == pytest.approx(8.0)
        np.testing.assert_allclose(np.linalg.norm(corners_m - [3, 4], axis=1), np.sqrt(5))


def test_only_what_stands_towards_the_sun_is_lowered(canvas: PanoramaCanvas) -> None:
    x, y, z = SUN.direction(0)
    towards_m = 50 * np.array([x, y]) / np.hypot(x, y)
    lowered_m = height_below_sun_m(canvas, towards_m, 60.0)
    assert lowered_m < canvas.eye_m + 50 * z / np.hypot(x, y)
    assert height_below_sun_m(canvas, -towards_m, 60.0) == 60.0
    assert height_below_sun_m(canvas, towards_m, 5.0) == 5.0
