"""At most two small lamps of a room shine."""

import pytest

from tests.asset.rooms import home, room_layout
from vobench.asset.small_lamp import FLOOR_LAMP_LM, add_floor_lamp, light_small_lamps
from vobench.scene.light import AreaLight


@pytest.mark.parametrize(("is_on", "count"), [(True, 2), (False, 0)])
def test_the_first_two_lamps_shine_if_they_are_on(is_on: bool, count: int) -> None:
    layout = room_layout(size_m=6.0)
    for _ in range(3):
        add_floor_lamp(layout)
    assert len(layout.placed) == 3
    light_small_lamps(layout, home(), is_on=is_on)
    assert len(layout.lights) == count
    for light in layout.lights:
        assert isinstance(light, AreaLight)
        assert light.power_lm == FLOOR_LAMP_LM
        assert 1.0 < light.mesh.bounds[0, 2] < light.mesh.bounds[1, 2] < 1.7
