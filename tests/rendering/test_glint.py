"""Lamps have glints: bulbs, which are too small to be seen, and the parts of area lights."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from vobench.rendering.glint import COSINE, glints, lamp_parts
from vobench.rendering.uniform_block import MOST_GLINTS
from vobench.scene.light import AreaLight, Flicker, PointLight, Sky, SpotLight, Sun
from vobench.scene.mesh import quad

X, Y, _ = np.eye(3)
SKY = Sky("sky", 1000.0)


def test_lamps_without_size_have_glints_with_their_levels_and_cones() -> None:
    flicker = Flicker(depth=0.5)
    point = PointLight("point", np.array([0, 0, 2.0]), 4 * np.pi * 100, flicker, (1.0, 0.5, 0.2))
    spot = SpotLight("spot", np.array([1.0, 0, 2]), np.array([0, 0, -1.0]), 500.0, 20.0, 30.0)
    sun = Sun("sun", 5e4, (0.0,), (0.0,), (90.0,))
    found = glints((point, spot, sun, SKY), (), np.zeros(3), 0, 1_000_000)
    assert found.shape == (3, 4, 4)
    np.testing.assert_allclose(found[0, 1, :3], 100 * flicker.mean(0, 1_000_000) * np.array([1, 0.5, 0.2]))
    assert found[1, 1, 3] == pytest.approx(np.deg2rad(30))
    np.testing.assert_allclose(found[2, 0], [0, 0, 1, 0], atol=1e-12)
    many = [replace(point, name=str(n), position_m=np.array([n, 0, 0.5])) for n in range(20, 0, -1)]
    assert glints(many, (), np.zeros(3), 0, 0)[:, 0, 0].tolist() == list(range(1, MOST_GLINTS + 1))


def test_the_sun_outshines_a_bulb_unless_that_is_next_to_the_eye() -> None:
    bulbs = [PointLight(str(n), np.array([5.0 + n, 0, 0]), 1000.0) for n in range(MOST_GLINTS)]
    sun = Sun("sun", 5e4, (0.0,), (0.0,), (90.0,))
    assert glints([*bulbs, sun], (), np.zeros(3), 0, 0)[0, 0, 3] == 0
    assert glints([*bulbs, sun], (), np.array([5.01, 0, 0]), 0, 0)[0, 0].tolist() == [5.0, 0, 0, 1]


def test_without_lamps_there_is_no_glint() -> None:
    assert glints([SKY], (), np.zeros(3), 0, 0).shape == (0, 4, 4)


def panel(name: str, *centres_m: tuple[float, float, float], power_lm: float = 1000.0) -> AreaLight:
    """Panels of 0.4 x 0.6 m that shine downwards."""
    meshes = [quad(np.array(centre) - [0.2, 0.3, 0], 0.6 * Y, 0.4 * X) for centre in centres_m]
    return AreaLight(name, trimesh.util.concatenate(meshes), power_lm)


def test_each_panel_of_an_area_light_has_a_glint_with_its_intensity() -> None:
    light = panel("panels", (0, 0, 2), (3, 0, 2))
    parts = lamp_parts([light])
    assert len(parts) == 2
    found = glints([light], parts, np.zeros(3), 0, 0)
    np.testing.assert_allclose(np.sort(found[:, 0, 0]), [0, 3], atol=1e-9)
    np.testing.assert_allclose(found[:, 1, :3], 500 / np.pi)  # a Lambertian emitter of 500 lm: 500 / π cd ahead
    np.testing.assert_allclose(found[:, 2], [[0, 0, -1, COSINE]] * 2, atol=1e-9)
    np.testing.assert_allclose(found[:, 3, :2], [[np.sqrt(0.24 / np.pi), 1]] * 2)


def test_a_lamp_that_shines_all_around_has_the_mean_intensity_of_its_power() -> None:
    ball = AreaLight("ball", trimesh.creation.icosphere(subdivisions=3, radius=0.1), 1000.0)
    (part,) = lamp_parts([ball])
    (found,) = glints([ball], [part], np.ones(3), 0, 0)
    np.testing.assert_allclose(found[1, :3], 1000 / (4 * np.pi), rtol=1e-6)
    assert found[2].tolist() == [0, 0, 0, 1]


def test_lights_whose_parts_are_too_many_are_left_to_the_probe() -> None:
    many = panel("many", *((float(x), 0, 2) for x in range(MOST_GLINTS)))
    few = panel("few", (0, 5, 2), (1, 5, 2))
    point = PointLight("point", np.zeros(3), 100.0)
    assert {part.light for part in lamp_parts([many])} == {0}
    assert {part.light for part in lamp_parts([point, many, few])} == {2}
