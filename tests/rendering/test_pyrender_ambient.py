"""Ambient light for pyrender: what an integrating sphere holds, and what open scenes lose."""

import numpy as np
import pytest

from tests.rendering.rectangles import rectangle, room
from vobench.rendering.pyrender_ambient import MOST_REFLECTED, MeanLight, mean_light
from vobench.scene.light import PointLight, Sky, Sun
from vobench.scene.material import Material
from vobench.scene.scene import Scene

BULB = PointLight("bulb", np.array([0.0, 0, 1.5]), 1000.0)
X, Y, Z = np.eye(3)


def closed(albedo: float, *lights: object) -> Scene:
    sides = tuple(room((4, 4, 3), floor="a", wall="a", ceiling="a"))
    return Scene("room", sides, {"a": Material(colour=(albedo,) * 3)}, lights or (BULB,))  # type: ignore[arg-type]


def test_a_closed_room_holds_the_geometric_series_of_its_bounces() -> None:
    area_m2 = 2 * 16 + 4 * 12
    direct_lx = 1000.0 / area_m2
    for albedo in (0.2, 0.5, 0.8):
        light = mean_light(closed(albedo), drawn=[0])
        expected = direct_lx * albedo / (1 - albedo)
        np.testing.assert_allclose(light.illuminance_lx[0], expected, rtol=0.06)


def test_a_light_that_is_not_drawn_counts_with_its_direct_light() -> None:
    drawn, undrawn = (mean_light(closed(0.5), drawn=drawn).illuminance_lx for drawn in ([0], []))
    np.testing.assert_allclose(undrawn, 2 * drawn, rtol=1e-9)


def test_white_rooms_do_not_add_up_without_end() -> None:
    light = mean_light(closed(1.0), drawn=[0])
    assert light.illuminance_lx[0, 0] < 1.05 * 1000 / 80 * MOST_REFLECTED / (1 - MOST_REFLECTED)


def test_the_mean_is_linear_in_levels_and_in_colours() -> None:
    light = MeanLight(np.array([[1.0, 2.0, 3.0], [10.0, 0.0, 0.0]]))
    np.testing.assert_allclose(light.radiance([2.0, 0.5]), np.array([7.0, 4.0, 6.0]) / np.pi)
    np.testing.assert_allclose(light.radiance([0.0, 0.0]), 0)


def test_open_ground_has_the_suns_and_the_skys_light_and_no_bounces() -> None:
    ground = rectangle(0 * Z, 20 * X, 20 * Y, "a", "ground")
    sun = Sun("sun", 1000.0, (0.0,), (0.0,), (30.0,))
    scene = Scene("ground", (ground,), {"a": Material(colour=(0.5,) * 3)}, (sun, Sky("sky", 800.0, "uniform")))
    light = mean_light(scene, drawn=[])
    np.testing.assert_allclose(light.illuminance_lx[0], 500.0, rtol=1e-6)
    np.testing.assert_allclose(light.illuminance_lx[1], 800.0, rtol=1e-3)


def test_a_room_keeps_out_the_sun_and_a_scene_without_bodies_has_no_ambient_light() -> None:
    sun = Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,))
    assert mean_light(closed(0.5, sun), drawn=[]).illuminance_lx.max() == pytest.approx(0, abs=1e-9)
    glass = Scene("glass", (rectangle(0 * Z, X, Y, "g", "g"),), {"g": Material("pane", eta=1.5)}, (BULB,))
    assert (mean_light(glass, drawn=[]).illuminance_lx == 0).all()
