"""Shadow rays bring the light of the places that they reach, and there are as many as an emitter's width needs."""

import numpy as np
import pytest

from tests.rendering.lit_floor import BULB, PANEL, PANEL_M, X, Y, Z, open_floor
from tests.rendering.rectangles import rectangle
from vobench.rendering.light_emitter import emitters
from vobench.rendering.shadow_ray import RayGrid, cast_shadow_rays, first_sides, reachable, unshadowed_light
from vobench.rendering.sobol_pattern import SobolPattern
from vobench.scene.light import Light
from vobench.scene.scene import ceiling_light


def test_a_roof_blocks_all_light_and_the_unshadowed_light_stays() -> None:
    roof = rectangle(Z, 6 * Y, 6 * X, "a", "roof")
    points, _, visibility = open_floor(roof)
    (emitter,) = emitters(BULB, visibility)
    rows = np.arange(len(points))
    arrived = cast_shadow_rays(emitter, points, rows, visibility, RayGrid(1))
    assert (arrived.light == 0).all()
    assert (arrived.clear_share == 0).all()
    np.testing.assert_allclose(arrived.unshadowed, unshadowed_light(emitter, points, rows, 1)[0])
    assert (arrived.unshadowed > 0).all()


def test_a_half_hidden_panel_lets_half_of_the_rays_pass() -> None:
    half = rectangle(PANEL_M - 0.05 * Z - 10 * X, 20 * Y, 20 * X, "a", "half")
    points, _, visibility = open_floor(half)
    (emitter,) = emitters(PANEL, visibility)
    below = np.flatnonzero(np.linalg.norm(points.points_m[:, :2] - PANEL_M[:2], axis=1) < 0.1)
    pattern = SobolPattern(64, 1, points.dither[:1])
    arrived = cast_shadow_rays(emitter, points, below, visibility, RayGrid(16, is_spread=True), pattern)
    assert len(below) > 2
    np.testing.assert_allclose(arrived.clear_share, 0.5, atol=0.06)
    np.testing.assert_allclose(arrived.light / arrived.unshadowed, 0.5, atol=0.06)


@pytest.mark.parametrize("light", [BULB, PANEL], ids=["bulb", "panel"])
def test_points_that_face_away_are_not_reachable(light: Light) -> None:
    points, _, visibility = open_floor()
    rows = np.arange(len(points))
    facing_away = points.take(rows)
    facing_away.normals[:] = -facing_away.normals
    for emitter in emitters(light, visibility):
        assert len(reachable(emitter, points, rows)) == len(points)
        assert len(reachable(emitter, facing_away, rows)) == 0


def test_wide_emitters_need_more_rays_than_narrow_ones_and_points_need_one() -> None:
    points_m = np.zeros((1, 3), np.float32)
    visibility = open_floor()[2]
    sides = []
    for distance_m in (0.3, 3.0, 300.0):
        panel = ceiling_light("panel", np.array([0, 0, distance_m]), (0.5, 0.5), power_lm=1)
        (emitter,) = emitters(panel, visibility)
        sides.append(int(first_sides(emitter, points_m, 8)[0]))
    assert sides == [12, 4, 4]
    (bulb,) = emitters(BULB, visibility)
    assert first_sides(bulb, points_m, 8).tolist() == [1]


def test_the_unshadowed_light_of_a_panel_is_a_formula_that_sampling_agrees_with() -> None:
    points, _, visibility = open_floor()
    (emitter,) = emitters(PANEL, visibility)
    rows = np.arange(len(points))
    exact_lx, is_sampled = unshadowed_light(emitter, points, rows, 4)
    assert not is_sampled.any()
    sampled_lx = cast_shadow_rays(emitter, points, rows, visibility, RayGrid(16)).light
    np.testing.assert_allclose(sampled_lx, exact_lx, rtol=0.01)
