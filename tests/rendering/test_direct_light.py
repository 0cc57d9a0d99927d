"""Direct light on open points agrees with photometry, and soft shadows with what many rays tell."""

import numpy as np
import pytest

from tests.rendering.lit_floor import BULB, PANEL, PANEL_M, X, Y, Z, by_inverse_square, open_floor
from tests.rendering.rectangles import rectangle
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats
from vobench.rendering.direct_light import direct_light
from vobench.rendering.light_emitter import emitters
from vobench.rendering.shadow_ray import RayGrid, cast_shadow_rays, unshadowed_light
from vobench.scene.light import Light, Sky, SpotLight, Sun
from vobench.scene.scene import ceiling_light
from vobench.scene.triangles import Thing


def lit_by(light: Light, *more: Thing, side: int = 4) -> tuple[Array, Array]:
    """Points (P, 3) and their illuminance (P,) by the emitters of a light."""
    points, layout, visibility = open_floor(*more)
    cells = np.zeros(len(points), np.int32)
    among = np.ones(len(points), bool)
    total = np.zeros(len(points))
    for emitter in emitters(light, visibility):
        total += direct_light(emitter, points, layout, cells, visibility, side=side, among=among)
    return points.points_m.astype(float), total


def test_a_bulb_lights_by_the_inverse_square_and_the_cosine() -> None:
    points_m, light_lx = lit_by(BULB)
    np.testing.assert_allclose(light_lx, by_inverse_square(points_m, BULB.position_m, 100), rtol=1e-4)


def test_a_spot_is_dark_outside_its_cone() -> None:
    spot = SpotLight("spot", np.array([0.0, 0, 1.0]), -Z, 300.0, 10.0, 20.0)
    points_m, light_lx = lit_by(spot)
    angle_deg = np.rad2deg(np.arctan(np.linalg.norm(points_m[:, :2], axis=1)))
    assert (light_lx[angle_deg > 20.5] == 0).all()
    centre = angle_deg < 9.5
    np.testing.assert_allclose(
        light_lx[centre], by_inverse_square(points_m, spot.position_m, spot.peak_cd)[centre], rtol=1e-3
    )


def test_the_sun_lights_open_ground_by_the_sine_of_its_elevation() -> None:
    _, light_lx = lit_by(Sun("sun", 1000.0, (0.0,), (40.0,), (30.0,)))
    np.testing.assert_allclose(light_lx, 500.0, rtol=2e-3)


def test_the_open_sky_lights_level_ground_by_its_illuminance() -> None:
    _, light_lx = lit_by(Sky("sky", 2000.0, "overcast"), side=12)
    assert light_lx.mean() == pytest.approx(2000.0, rel=0.01)


def test_the_sky_through_a_small_opening_leaves_no_stains() -> None:
    """A lid with a hole of 0.4 x 0.4 m; a point sees the hole as an even source of its area."""
    hole_m = np.array([1.5, 0.0, 1.0])
    half_m = 0.2
    far_m = 400.0
    beside_m = (far_m + half_m) / 2  # from the hole to the middle of a part of the lid
    along_x = 2 * far_m * X
    across_x = (far_m - half_m) * X
    lid = [
        rectangle(hole_m + beside_m * Y, (far_m - half_m) * Y, along_x, "a", "north"),
        rectangle(hole_m - beside_m * Y, (far_m - half_m) * Y, along_x, "a", "south"),
        rectangle(hole_m + beside_m * X, 2 * half_m * Y, across_x, "a", "east"),
        rectangle(hole_m - beside_m * X, 2 * half_m * Y, across_x, "a", "west"),
    ]
    points, layout, visibility = open_floor(*lid, spacing_m=0.025)
    (emitter,) = emitters(Sky("sky", 1000.0), visibility)
    cells = np.zeros(len(points), np.int32)
    among = np.ones(len(points), bool)
    light_lx = direct_light(emitter, points, layout, cells, visibility, side=4, among=among)
    squared_m2 = ((hole_m - points.points_m) ** 2).sum(1)
    area_m2 = (2 * half_m) ** 2
    expected_lx = 1000.0 * area_m2 / (np.pi * squared_m2**2)
    assert light_lx.sum() == pytest.approx(expected_lx.sum(), rel=0.1)
    relative = (light_lx - expected_lx) / expected_lx
    assert np.sqrt(np.mean(relative**2)) < 0.4


def test_the_sky_through_a_pane_behind_slats_leaves_no_stains() -> None:
    pane = rectangle(1.5 * X + Z, Y, Z, "glass", "pane")
    slats = [
        rectangle(1.3 * X + height * Z, 0.05 * Z, 2 * Y, "a", f"slat_{height:.2f}")
        for height in np.arange(0.5, 1.6, 0.1)
    ]
    points, layout, visibility = open_floor(pane, *slats, spacing_m=0.025)
    (emitter,) = (each for each in emitters(Sky("sky", 1000.0), visibility) if each.sky == "pane")
    cells = np.zeros(len(points), np.int32)
    rows = np.arange(len(points))
    light_lx = direct_light(emitter, points, layout, cells, visibility, side=4, among=np.ones(len(points), bool))
    many = cast_shadow_rays(emitter, points, rows, visibility, RayGrid(24, is_spread=True)).light
    assert light_lx.mean() == pytest.approx(many.mean(), rel=0.05)
    far_from_slats = points.points_m[:, 0] < 0.5
    relative = (light_lx - many)[far_from_slats] / many[far_from_slats]
    assert relative.std() < 0.11


def test_a_panel_far_away_is_a_point_with_the_cosine_of_its_face() -> None:
    far = ceiling_light("far", np.array([0.0, 0, 30.0]), (0.4, 0.3), power_lm=5000)
    points_m, light_lx = lit_by(far)
    vectors = np.array([0, 0, 30.0]) - points_m
    cosine = vectors[:, 2] / np.linalg.norm(vectors, axis=1)
    expected = 5000 / np.pi * cosine**2 / (vectors**2).sum(1)
    np.testing.assert_allclose(light_lx, expected, rtol=2e-3)


def test_a_soft_shadow_is_that_of_many_rays_and_takes_a_fraction_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    block = rectangle(PANEL_M - 1.5 * Z, 0.6 * Y, 0.6 * X, "a", "block")
    points, layout, visibility = open_floor(block, spacing_m=0.025)
    (emitter,) = emitters(PANEL, visibility)
    rows = np.arange(len(points))
    exact_lx = cast_shadow_rays(emitter, points, rows, visibility, RayGrid(16, is_spread=True)).light
    sent = []
    transmittance = visibility.transmittance

    def counted(origins_m: Floats, segments_m: Floats) -> Floats:
        sent.append(len(origins_m))
        return transmittance(origins_m, segments_m)

    monkeypatch.setattr(visibility, "transmittance", counted)
    cells = np.arange(len(points), dtype=np.int32)
    light_lx = direct_light(emitter, points, layout, cells, visibility, side=4, among=np.ones(len(points), bool))
    assert sum(sent) < 6 * len(points)
    error = (light_lx - exact_lx) / exact_lx.max()
    assert np.sqrt((error**2).mean()) < 0.015
    assert abs(error.mean()) < 2e-3
    assert np.abs(error).max() < 0.15


@pytest.mark.parametrize("height_m", [0.1, 0.2, 0.3])
def test_the_shadow_of_a_bar_is_sharp_and_has_no_beads(height_m: float) -> None:
    bar = rectangle(np.array([*PANEL_M[:2], height_m]), 0.04 * X, 3 * Y, "a", "bar")
    points, layout, visibility = open_floor(bar, spacing_m=0.025)
    (emitter,) = emitters(PANEL, visibility)
    cells = np.arange(len(points), dtype=np.int32)
    light_lx = direct_light(emitter, points, layout, cells, visibility, side=4, among=np.ones(len(points), bool))
    rows = np.arange(len(points))
    exact_lx = cast_shadow_rays(emitter, points, rows, visibility, RayGrid(24, is_spread=True)).light
    near_shadow = np.abs(points.points_m[:, 0] - PANEL_M[0]) < 0.3
    error = (light_lx - exact_lx)[near_shadow] / exact_lx.max()
    assert error.std() < 0.02
    assert np.abs(error).max() < 0.15


def test_the_unshadowed_light_of_a_panel_is_exact_where_it_is_interpolated() -> None:
    points, layout, visibility = open_floor(spacing_m=0.025)
    (emitter,) = emitters(PANEL, visibility)
    cells = np.zeros(len(points), np.int32)
    light_lx = direct_light(emitter, points, layout, cells, visibility, side=4, among=np.ones(len(points), bool))
    exact_lx, _ = unshadowed_light(emitter, points, np.arange(len(points)), 4)
    np.testing.assert_allclose(light_lx, exact_lx, rtol=3e-3)
