"""Lights have names, strengths and emitters, as Mitsuba needs them."""

from types import SimpleNamespace

import numpy as np
import pytest

from vobench.rendering.mitsuba_light import STRENGTH_PARAMETERS, emitter_plugin, light_key, nominal_strength
from vobench.scene.light import PointLight, Sky, Sun
from vobench.scene.scene import ceiling_light

Z = np.array([0.0, 0.0, 1.0])
LAMP = ceiling_light("lamp", 2 * Z, (0.4, 0.3), power_lm=500)


def test_lights_have_the_strength_of_their_unit_and_colour() -> None:
    np.testing.assert_allclose(nominal_strength(PointLight("bulb", Z, 4 * np.pi, colour=(1, 2, 3))), [1, 2, 3])
    np.testing.assert_allclose(nominal_strength(LAMP), LAMP.luminance_cd_m2 * np.ones(3))
    np.testing.assert_allclose(nominal_strength(Sun("sun", 1e4, (0.0,), (0.0,), (30.0,))), 1e4 * np.ones(3))
    np.testing.assert_allclose(nominal_strength(Sky("sky", 1e4)), np.ones(3))
    assert {type(LAMP), PointLight, Sun, Sky} <= STRENGTH_PARAMETERS.keys()
    assert light_key(0) != light_key(1)


def test_the_picture_of_a_sky_begins_at_the_zenith_and_has_no_row_on_the_horizon() -> None:
    transform = SimpleNamespace(rotate=lambda axis, degrees: (axis, degrees))
    mi = SimpleNamespace(Bitmap=lambda values: values, ScalarTransform4f=lambda: transform)
    sky = Sky("sky", 1e4)
    plugin = emitter_plugin(mi, sky)
    picture = plugin["bitmap"]
    rows = len(picture)
    assert rows % 2 == 0
    np.testing.assert_allclose(picture[0], np.broadcast_to(sky.seen_cd_m2(Z[None]), picture[0].shape), rtol=1e-6)
    assert plugin["to_world"] == ([1, 0, 0], 90)


def test_a_lamp_has_no_emitter_without_its_faces() -> None:
    with pytest.raises(ValueError, match="no faces"):
        emitter_plugin(None, LAMP)
