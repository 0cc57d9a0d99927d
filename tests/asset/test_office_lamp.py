"""Office lamps hang in a grid, and share the light of a room."""

import pytest

from tests.asset.rooms import office, room_layout
from vobench.asset.office_lamp import LM_PER_M2, SIZES_M, add_office_lamps
from vobench.scene.light import AreaLight


@pytest.mark.parametrize("kind", SIZES_M)
def test_the_lamps_of_a_room_share_its_light(kind: str) -> None:
    layout = room_layout("open", size_m=9.0)
    add_office_lamps(layout, office(), kind, is_on=True)
    lamps = [light for light in layout.lights if isinstance(light, AreaLight)]
    assert len(lamps) == 4
    assert sum(lamp.power_lm for lamp in lamps) == pytest.approx(LM_PER_M2 * 81)
    assert all(lamp.mesh.bounds[1, 2] < layout.plan.height_m for lamp in lamps)
    assert all(lamp.mesh.face_normals[:, 2].max() < -0.99 for lamp in lamps)


def test_a_pantry_has_one_lamp_close_to_the_ceiling() -> None:
    layout = room_layout("pantry", size_m=9.0)
    add_office_lamps(layout, office(), "hanging", is_on=True)
    (lamp,) = layout.lights
    assert isinstance(lamp, AreaLight)
    assert lamp.mesh.bounds[0, 2] > layout.plan.height_m - 0.1


def test_lamps_that_are_off_are_pieces() -> None:
    layout = room_layout("open", size_m=9.0)
    add_office_lamps(layout, office(), "bars", is_on=False)
    assert layout.lights == []
    assert sum(".lamp_" in piece.name for piece in layout.placed) == 4
