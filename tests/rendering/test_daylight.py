"""Sun and sky obey their geometry, in the open and through windows."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.panoramas import PANORAMA, level_illuminance_lx
from tests.rendering.parts import light_at
from tests.rendering.rectangles import Rectangle, rectangle
from vobench.asset.texture import Procedural
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.scene.light import SUN_RADIUS_RAD, Light, Sky, Sun
from vobench.scene.material import Material, pane_reflectance
from vobench.scene.mesh import quad, two_sided
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing

DIRECT = BakeSettings(spacing_m=0.1, light_rays=16, indirect_spacing_m=1.0, indirect_rays=4, bounces=0)
FINER = replace(DIRECT, spacing_m=0.05)  # the sky's light lies between every other sample
GREY = {"grey": Material(texture=Procedural("plain", 0.5, 0.0, 1.0, 8, 0))}
PANES: dict[str, Material] = {
    **GREY,
    "pane": Material("pane", eta=1.5),
    "hole": Material("pane", eta=1.0),
    "dark": Material("pane", eta=1.0, tint=0.4),
}
FLOOR = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "grey")
SUN = Sun("sun", 80_000.0, (0.0,), (30.0,), (50.0,))
UNIFORM = Sky("sky", 10_000.0, "uniform")
X, Y, Z = np.eye(3)


def floor_light(light: Light, *others: Rectangle, settings: BakeSettings = DIRECT) -> tuple[Array, Array, Array]:
    """Places x, y and illuminance (rows, columns) of the floor's samples."""
    baked = bake(Scene("day", (FLOOR, *others), PANES, (light,)), settings)
    s, t = np.meshgrid(*[np.linspace(0, 1, round(4 / settings.spacing_m) + 1)] * 2)
    upper = (t > s).ravel()
    u, v = np.where(t > s, s, s - t).ravel(), np.where(t > s, t - s, t).ravel()
    light = light_at(baked, baked.direct[0], upper.astype(np.int64), u, v)
    return 4 * s - 2, 4 * t - 2, light.reshape(s.shape)


def test_an_open_floor_gets_the_light_of_a_panorama() -> None:
    _, _, illuminance_lx = floor_light(PANORAMA, settings=replace(DIRECT, light_rays=256))
    assert illuminance_lx.mean() == pytest.approx(level_illuminance_lx(), rel=0.01)


def roof_with_opening(half_m: float, height_m: float, glazing: str | None) -> list[Rectangle]:
    """A wide roof whose middle is open or glazed, seen from below, and walls that let nothing in below it."""
    side, centre = 4.0 - half_m, (4.0 + half_m) / 2
    strips = [rectangle(np.array([0, sign * centre, height_m]), side * Y, 8 * X, "grey") for sign in (-1, 1)] + [
        rectangle(np.array([sign * centre, 0, height_m]), 2 * half_m * Y, side * X, "grey") for sign in (-1, 1)
    ]
    walls = [
        rectangle(np.array([4.0, 0, height_m / 2]), height_m * Z, 8 * Y, "grey"),
        rectangle(np.array([-4.0, 0, height_m / 2]), 8 * Y, height_m * Z, "grey"),
        rectangle(np.array([0, 4.0, height_m / 2]), 8 * X, height_m * Z, "grey"),
        rectangle(np.array([0, -4.0, height_m / 2]), height_m * Z, 8 * X, "grey"),
    ]
    ground = [rectangle(np.array([0, sign * 3.0, 0]), 8 * X, 2 * Y, "grey") for sign in (-1, 1)] + [
        rectangle(np.array([sign * 3.0, 0, 0]), 2 * X, 4 * Y, "grey") for sign in (-1, 1)
    ]
    pane = [rectangle(np.array([0, 0, height_m]), 2 * half_m * Y, 2 * half_m * X, glazing)] if glazing else []
    return [*strips, *walls, *ground, *pane]


def corner_factor(a: Array, b: Array, c: float) -> Array:
    """Share of a level point's sky behind a level a x b rectangle with a corner c above it (Howell, B-3)."""
    A, B = a / np.hypot(a, c), b / np.hypot(b, c)
    return (A * np.arctan(b / np.hypot(a, c)) + B * np.arctan(a / np.hypot(b, c))) / (2 * np.pi)


def opening_factor(x: Array, y: Array, half_m: float, height_m: float) -> Array:
    """Share of the sky of points of the floor that a square opening shows: four signed corners."""
    factor = np.zeros_like(x)
    for sx, u in ((1, half_m - x), (-1, -half_m - x)):
        for sy, v in ((1, half_m - y), (-1, -half_m - y)):
            factor += sx * sy * corner_factor(u, v, height_m)
    return factor


def test_open_ground_has_the_suns_illuminance_times_the_cosine() -> None:
    light = floor_light(SUN)[2]
    np.testing.assert_allclose(light, 80_000 * np.sin(np.deg2rad(50)), rtol=1e-5)


def test_open_ground_has_the_skys_illuminance() -> None:
    for kind in ("uniform", "overcast", "clear"):
        light = floor_light(Sky("sky", 10_000.0, kind, SUN.direction(0)))[2]
        assert light.mean() == pytest.approx(10_000, rel=0.005)
        assert light.std() < 300


def test_a_suns_shadow_has_an_edge_as_wide_as_the_disc_looks_from_there() -> None:
    sun = replace(SUN, azimuth_deg=(0.0,), elevation_deg=(90.0,))
    height = 20.0
    blocker = rectangle(np.array([2.0, 0, height]), 4 * Y, 4 * X, "grey")
    x, y, light = floor_light(sun, blocker, settings=replace(DIRECT, spacing_m=0.02, light_rays=64))
    share = light[np.abs(y) < 0.5] / 80_000
    place = x[np.abs(y) < 0.5]
    half = height * np.tan(SUN_RADIUS_RAD)
    np.testing.assert_allclose(share[place < -half - 0.03], 1, atol=1e-3)
    np.testing.assert_allclose(share[place > half + 0.03], 0, atol=1e-3)
    # The part of a disc left of a chord at s.
    inside = np.abs(place) < 0.9 * half
    s = -place[inside] / half
    visible = 0.5 + (s * np.sqrt(1 - s**2) + np.arcsin(s)) / np.pi
    assert np.abs(share[inside] - visible).mean() < 0.03


@pytest.mark.parametrize(("glazing", "passes"), [("hole", 1.0), ("dark", 0.4)])
def test_through_an_opening_a_uniform_sky_gives_its_configuration_factor(glazing: str, passes: float) -> None:
    x, y, light = floor_light(UNIFORM, *roof_with_opening(0.75, 2.0, glazing), settings=FINER)
    expected = 10_000 * passes * opening_factor(x, y, 0.75, 2.0)
    # Daylight is smoothed, which shows where samples as coarse as these end.
    np.testing.assert_allclose(light[3:-3, 3:-3], expected[3:-3, 3:-3], rtol=0.02)
    assert light.mean() == pytest.approx(expected.mean(), rel=0.002)


def test_a_pane_and_its_back_let_in_what_one_pane_does() -> None:
    roof, level = roof_with_opening(0.75, 2.0, None), quad([-0.75, -0.75, 2.0], 1.5 * Y, 1.5 * X)
    lit = []
    for mesh in (level, two_sided(level)):
        pane = Thing("pane", mesh, "pane")
        baked = bake(Scene("day", (FLOOR, *roof, pane), PANES, (UNIFORM,)), DIRECT)
        lit.append(baked.direct[0].mean())
    assert lit[1] == pytest.approx(lit[0], rel=1e-3)
    assert lit[0] > 0


def test_an_opening_without_a_pane_lets_in_the_same_light() -> None:
    settings = replace(DIRECT, light_rays=256, spacing_m=0.4)
    x, y, light = floor_light(UNIFORM, *roof_with_opening(0.75, 2.0, None), settings=settings)
    assert light.mean() == pytest.approx(10_000 * opening_factor(x, y, 0.75, 2.0).mean(), rel=0.02)


def test_panes_behind_one_another_multiply_and_count_no_light_twice() -> None:
    roof = roof_with_opening(0.75, 2.0, "dark")
    second = rectangle(np.array([0, 0, 1.8]), 8 * Y, 8 * X, "dark")
    x, y, light = floor_light(UNIFORM, *roof, second, settings=FINER)
    expected = 10_000 * 0.4**2 * opening_factor(x, y, 0.75, 2.0)
    assert light.mean() == pytest.approx(expected.mean(), rel=0.01)
    np.testing.assert_allclose(light, expected, rtol=0.15)


def test_a_pane_takes_from_sunlight_what_it_mirrors_at_that_angle() -> None:
    pane = rectangle(np.array([0, 0, 1.0]), 20 * X, 20 * Y, "pane")
    cosine = np.sin(np.deg2rad(50))
    light = floor_light(SUN, pane)[2]
    expected = 80_000 * cosine * (1 - pane_reflectance(np.array(cosine), 1.5))
    np.testing.assert_allclose(light, expected, rtol=1e-3)


def test_a_pane_shades_nothing_and_a_wall_everything() -> None:
    for material, share in (("hole", 1.0), ("grey", 0.0)):
        cover = rectangle(np.array([0, 0, 1.0]), 20 * Y, 20 * X, material)
        np.testing.assert_allclose(floor_light(SUN, cover)[2], share * 80_000 * np.sin(np.deg2rad(50)), rtol=1e-4)
