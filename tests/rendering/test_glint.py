"""Lamps that are too small to be seen have glints, the brightest ones first."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.rendering.glint import glints
from vobench.rendering.uniform_block import MOST_GLINTS
from vobench.scene.light import Flicker, PointLight, Sky, SpotLight, Sun

SKY = Sky("sky", 1000.0)


def test_lamps_without_size_have_glints_with_their_levels_and_cones() -> None:
    flicker = Flicker(depth=0.5)
    point = PointLight("point", np.array([0, 0, 2.0]), 4 * np.pi * 100, flicker, (1.0, 0.5, 0.2))
    spot = SpotLight("spot", np.array([1.0, 0, 2]), np.array([0, 0, -1.0]), 500.0, 20.0, 30.0)
    sun = Sun("sun", 5e4, (0.0,), (0.0,), (90.0,))
    found = glints((point, spot, sun, SKY), np.zeros(3), 0, 1_000_000)
    assert found.shape == (3, 3, 4)
    np.testing.assert_allclose(found[0, 1, :3], 100 * flicker.mean(0, 1_000_000) * np.array([1, 0.5, 0.2]))
    assert found[1, 1, 3] == pytest.approx(np.deg2rad(30))
    np.testing.assert_allclose(found[2, 0], [0, 0, 1, 0], atol=1e-12)
    many = [replace(point, name=str(n), position_m=np.array([n, 0, 0.5])) for n in range(20, 0, -1)]
    assert glints(many, np.zeros(3), 0, 0)[:, 0, 0].tolist() == list(range(1, 5))


def test_the_sun_outshines_a_bulb_unless_that_is_next_to_the_eye() -> None:
    bulbs = [PointLight(str(n), np.array([5.0 + n, 0, 0]), 1000.0) for n in range(MOST_GLINTS)]
    sun = Sun("sun", 5e4, (0.0,), (0.0,), (90.0,))
    assert glints([*bulbs, sun], np.zeros(3), 0, 0)[0, 0, 3] == 0
    assert glints([*bulbs, sun], np.array([5.01, 0, 0]), 0, 0)[0, 0].tolist() == [5.0, 0, 0, 1]


def test_without_lamps_there_is_no_glint() -> None:
    assert glints([SKY], np.zeros(3), 0, 0).shape == (0, 3, 4)
