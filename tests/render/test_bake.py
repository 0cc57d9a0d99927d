"""Baked light obeys photometry: inverse square, cosines, superposition, shadow and conservation of energy."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene, BakeSettings, bake
from vobench.scene.scene import AreaLight, Scene, Surface, box, ceiling_light, rectangle, room
from vobench.scene.texture import Texture

DIRECT = BakeSettings(spacing_m=0.1, light_rays=16, indirect_spacing_m=1.0, indirect_rays=1, bounces=0)
GREY = {"grey": Texture("plain", 0.5, 0.0, 1.0, 8, 0)}
FLOOR = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "grey")
LAMP = ceiling_light("lamp", np.array([0.3, -0.2, 2.0]), (0.04, 0.06), power_lm=1000)


def scene(*lamps: AreaLight, surfaces: tuple[Surface, ...] = (FLOOR,)) -> Scene:
    return Scene("test", surfaces, GREY, lamps)


def floor_light(baked: BakedScene) -> tuple[Array, Array, Array]:
    """Places x, y and illuminance (rows, columns) on the first surface."""
    patch = baked.layout.patches[0]
    points = baked.scene.surfaces[0].at(*patch.fractions())
    return points[..., 0], points[..., 1], baked.illuminance[patch.window].astype(float)


@pytest.mark.parametrize("height_m", [1.0, 2.0, 4.0])
def test_light_of_a_small_lamp_falls_with_the_square_of_distance_and_both_cosines(height_m: float) -> None:
    lamp = ceiling_light("lamp", np.array([0.3, -0.2, height_m]), (0.04, 0.06), power_lm=1000)
    x, y, light = floor_light(bake(scene(lamp), DIRECT))
    squared = (x - 0.3) ** 2 + (y + 0.2) ** 2 + height_m**2
    # A Lambertian panel sends power / π along its normal.
    expected = 1000 / np.pi * (height_m**2 / squared) / squared
    np.testing.assert_allclose(light, expected, rtol=0.02)
    assert (light / expected).mean() == pytest.approx(1, abs=0.001)


def test_a_wide_panel_right_above_gives_the_light_of_its_solid_angle() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 0.5]), (1.0, 1.0), power_lm=1000)
    x, y, light = floor_light(bake(scene(lamp), replace(DIRECT, light_rays=1024)))
    # Form factor of a square from below its middle: four corners with a = b = 0.5, c = 0.5 (Howell, B-4).
    factor = 4 / (2 * np.pi) * 2 / np.sqrt(2) * np.arctan(1 / np.sqrt(2))
    middle = np.unravel_index(np.argmin(x**2 + y**2), x.shape)
    assert light[middle] == pytest.approx(1000 * factor, rel=0.005)


def test_twice_the_power_is_exactly_twice_the_light() -> None:
    settings = replace(DIRECT, indirect_spacing_m=0.3, indirect_rays=16, bounces=2)
    closed = tuple(room((3, 3, 2.5), floor="grey", wall="grey", ceiling="grey"))
    once, twice = (
        bake(scene(replace(LAMP, power_lm=power), surfaces=closed), settings).illuminance for power in (700.0, 1400.0)
    )
    np.testing.assert_array_equal(twice, 2 * once)


def test_the_light_of_two_lamps_is_the_sum_of_each() -> None:
    other = ceiling_light("other", np.array([-1.0, 1.0, 1.5]), (0.3, 0.3), power_lm=500)
    both, first, second = (floor_light(bake(scene(*lamps), DIRECT))[2] for lamps in ((LAMP, other), (LAMP,), (other,)))
    np.testing.assert_allclose(both, first + second, rtol=0.03)
    assert both.mean() == pytest.approx((first + second).mean(), rel=0.001)


def test_behind_a_box_there_is_no_direct_light_and_beside_it_all_of_it() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.0]), (0.2, 0.2), power_lm=1000)
    blocker = box(np.array([0, 0, 1.0]), (0.8, 0.8, 0.1), yaw_deg=0, material="grey")
    x, y, shaded = floor_light(bake(scene(lamp, surfaces=(FLOOR, *blocker)), DIRECT))
    open_light = floor_light(bake(scene(lamp), DIRECT))[2]
    far = np.maximum(np.abs(x), np.abs(y))
    # From the lamp's rims past the box's: the box's top is 0.95 m below the lamp, its underside 1.05 m.
    umbra, lit = 0.1 + (0.4 - 0.1) / 1.05 * 2.0, -0.1 + (0.4 + 0.1) / 0.95 * 2.0
    np.testing.assert_array_equal(shaded[far < umbra - 0.01], 0)
    share = shaded / open_light
    np.testing.assert_allclose(share[far > lit + 0.01], 1, atol=0.03)
    half_lit = share[np.abs(far - (umbra + lit) / 2) < 0.06]
    assert 0.2 < half_lit.mean() < 0.7


def test_half_shadows_are_smooth() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.0]), (0.2, 0.2), power_lm=1000)
    blocker = box(np.array([0, 0, 1.0]), (0.8, 0.8, 0.1), yaw_deg=0, material="grey")
    shaded, fine = (
        floor_light(bake(scene(lamp, surfaces=(FLOOR, *blocker)), replace(DIRECT, spacing_m=0.03, light_rays=rays)))[2]
        for rays in (16, 400)
    )
    open_light = floor_light(bake(scene(lamp), replace(DIRECT, spacing_m=0.03)))[2]
    half = (fine > 0) & (fine < 0.97 * open_light)
    # Sixteen rays alone would leave a grain of 5 %.
    assert np.sqrt(np.mean(((shaded - fine) / open_light)[half] ** 2)) < 0.03


def test_nothing_shines_through_the_corners_of_a_closed_box() -> None:
    lamp = ceiling_light("lamp", np.array([0.5, 0.4, 2.0]), (0.2, 0.2), power_lm=1000)
    crate = box(np.array([0, 0, 0.5]), (1.0, 1.0, 1.0), yaw_deg=0, material="grey")
    x, y, light = floor_light(bake(scene(lamp, surfaces=(FLOOR, *crate)), DIRECT))
    np.testing.assert_array_equal(light[np.maximum(np.abs(x), np.abs(y)) < 0.49], 0)


def flux_lm(baked: BakedScene) -> float:
    """Light that arrives on all surfaces but the lamps' panels: trapezoids over each patch."""
    total = 0.0
    for surface, patch in zip(baked.scene.surfaces, baked.layout.patches, strict=False):
        weights = np.outer(*(_trapezoid(n) for n in (patch.rows, patch.columns)))
        total += float((weights * baked.illuminance[patch.window]).sum() * np.prod(surface.size_m))
    return total


def _trapezoid(count: int) -> Array:
    weights = np.full(count, 1 / (count - 1))
    weights[[0, -1]] /= 2
    return weights


@pytest.mark.parametrize("bounces", [0, 1, 3, 12])
def test_a_closed_room_keeps_its_light_and_each_bounce_returns_the_albedos_share(bounces: int) -> None:
    settings = BakeSettings(
        spacing_m=0.05, light_rays=16, indirect_spacing_m=0.15, indirect_rays=64, bounces=bounces, seed=1
    )
    # The panel itself swallows what falls on it, so it is small.
    lamp = ceiling_light("lamp", np.array([0.3, -0.2, 1.5]), (0.1, 0.1), power_lm=1000)
    closed = tuple(room((3, 2.5, 2.5), floor="grey", wall="grey", ceiling="grey"))
    arriving = flux_lm(bake(scene(lamp, surfaces=closed), settings))
    # Ulbricht's integrating sphere: every surface returns its albedo of what it gets, whatever the shape.
    expected = 1000 * sum(0.5**n for n in range(bounces + 1))
    assert arriving == pytest.approx(expected, rel=0.01)


def test_a_bake_is_the_same_bytes_twice_and_another_seed_changes_only_noise() -> None:
    settings = replace(DIRECT, light_rays=4, indirect_spacing_m=0.3, indirect_rays=16, bounces=2)
    closed = tuple(room((3, 3, 2.5), floor="grey", wall="grey", ceiling="grey"))
    first, again, other = (
        bake(scene(LAMP, surfaces=closed), replace(settings, seed=seed)).illuminance for seed in (0, 0, 1)
    )
    assert first.tobytes() == again.tobytes()
    assert not np.array_equal(first, other)
    assert other.mean() == pytest.approx(first.mean(), rel=0.01)


def test_a_lamps_panel_shows_its_own_luminance() -> None:
    baked = bake(scene(LAMP), DIRECT)
    panel = baked.illuminance[baked.layout.patches[-1].window]
    np.testing.assert_allclose(panel, np.pi * LAMP.luminance_cd_m2, rtol=1e-6)
