"""Each light has its kind of emitter."""

import numpy as np
import pytest

from tests.rendering.lit_floor import BULB, PANEL, open_floor
from vobench.rendering.area_emitter import Panel
from vobench.rendering.light_emitter import emitters
from vobench.rendering.point_emitter import Bulb, SunDisc
from vobench.rendering.sky_emitter import OpenSky
from vobench.scene.light import Light, Sky, SpotLight, Sun

LIGHTS = [
    (BULB, Bulb),
    (SpotLight("spot", np.array([0.0, 0, 1.0]), np.array([0.0, 0, -1.0]), 300.0, 10.0, 20.0), Bulb),
    (PANEL, Panel),
    (Sun("sun", 1e4, (0.0,), (0.0,), (45.0,)), SunDisc),
    (Sky("sky", 1e4), OpenSky),
]


@pytest.mark.parametrize(("light", "kind"), LIGHTS, ids=[light.name for light, _ in LIGHTS])
def test_a_light_is_one_emitter_of_its_kind(light: Light, kind: type) -> None:
    (emitter,) = emitters(light, open_floor()[2])
    assert type(emitter) is kind
    assert emitter.light is light
