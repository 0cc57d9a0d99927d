"""Lamps for models without light: below ceilings, in no thing, and so that all of the free floor sees some."""

import numpy as np
import pytest

from vobench.asset.shape import at, block
from vobench.rendering.geometry import RayCaster
from vobench.scene.material import Material
from vobench.scene.mesh import flipped, moved, quad, two_sided
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Thing
from vobench.suite.default_light import ENOUGH_LIGHT, LAMP_SIDE, MOST_LAMPS, ROOM_LX, DefaultLight, default_light
from vobench.suite.scene_spec import PanelLamp

GREY = {"grey": Material(colour=(0.5, 0.5, 0.5))}
ABSORPTION = 0.5


def light_of(*things: Thing) -> DefaultLight:
    return default_light(Scene("place", things, GREY, ()), np.full(len(things), ABSORPTION))


def hall(length_m: float, width_m: float, height_m: float = 2.5) -> Thing:
    """A closed hall, seen from inside."""
    walls = flipped(block((length_m, width_m, height_m), bevel_m=0))
    return Thing("hall", moved(walls, at(z_m=height_m / 2)), "grey")


def box(x_m: float, y_m: float, size_m: tuple[float, float, float], *, z_m: float = 0.0) -> Thing:
    return Thing("box", moved(block(size_m, bevel_m=0), at(x_m, y_m, z_m + size_m[2] / 2)), "grey")


def corners_of(lamp: PanelLamp) -> np.ndarray:
    half_m = np.array([*lamp.size_m, 0]) / 2
    signs = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return np.array(lamp.center_m) + signs * half_m


def test_a_small_room_gets_one_lamp_close_to_the_middle_of_its_ceiling() -> None:
    (lamp,) = light_of(hall(4, 4)).lamps
    assert np.abs(lamp.center_m[:2]).max() < 1
    assert 2.3 < lamp.center_m[2] < 2.5


def test_where_nothing_is_near_a_lamp_its_size_follows_from_the_height_above_the_floor() -> None:
    lamps = light_of(hall(20, 20, 2.5)).lamps
    middle = min(lamps, key=lambda lamp: float(np.hypot(*lamp.center_m[:2])))
    assert middle.size_m == pytest.approx([LAMP_SIDE * 2.5] * 2, abs=0.01)


def test_the_power_gives_the_illuminance_of_a_closed_room() -> None:
    light = light_of(hall(4, 4))
    area_m2 = 2 * 4 * 4 + 4 * 4 * 2.5
    assert light.absorption_m2 == pytest.approx(area_m2 * ABSORPTION)
    assert light.lamps[0].power_lm == pytest.approx(ROOM_LX * area_m2 * ABSORPTION, rel=0.01)


def test_faces_that_nobody_sees_take_no_light() -> None:
    buried = [box(0, 0.03 * nth, (2, 0.01, 2), z_m=-3) for nth in range(50)]
    assert light_of(hall(4, 4), *buried).absorption_m2 == light_of(hall(4, 4)).absorption_m2


@pytest.mark.parametrize(("length_m", "width_m", "height_m"), [(20, 12, 2.5), (60, 40, 8)])
def test_all_of_a_halls_floor_is_below_some_lamp_or_near_one(length_m: float, width_m: float, height_m: float) -> None:
    lamps = light_of(hall(length_m, width_m, height_m)).lamps
    assert 4 <= len(lamps) <= MOST_LAMPS
    assert [lamp.name for lamp in lamps] == [f"lamp_{number}" for number in range(1, len(lamps) + 1)]
    places_m = np.random.default_rng(0).uniform(-0.45, 0.45, (500, 2)) * [length_m, width_m]
    lamps_m = np.array([lamp.center_m for lamp in lamps])
    across_m2 = ((places_m[:, None] - lamps_m[None, :, :2]) ** 2).sum(-1)
    up_m2 = (lamps_m[:, 2] - 0.6) ** 2
    cosine2 = up_m2 / (up_m2 + across_m2)
    light = (cosine2**2).sum(1)
    assert light.mean() > ENOUGH_LIGHT
    assert np.percentile(light, 5) > ENOUGH_LIGHT / 4


def test_each_of_two_rooms_gets_a_lamp() -> None:
    wall = Thing("wall", two_sided(quad((0, -2, 0), (0, 4, 0), (0, 0, 2.5))), "grey")
    lamps = light_of(hall(8, 4), wall).lamps
    sides = {lamp.center_m[0] > 0 for lamp in lamps}
    assert sides == {True, False}


def test_no_lamp_is_in_a_shelf_or_below_a_table() -> None:
    shelves = [box(x_m, 0, (1.0, 6, 3.5)) for x_m in (-4.5, -1.5, 1.5, 4.5)]
    table = Thing("table", moved(block((1.2, 3, 0.05), bevel_m=0), at(0, 0, 0.8)), "grey")
    scene = Scene("place", (hall(14, 10, 4), *shelves, table), GREY, ())
    lamps = default_light(scene, np.full(6, ABSORPTION)).lamps
    assert lamps
    faces = triangles(scene)
    caster = RayCaster(faces)
    for lamp in lamps:
        assert 3.5 < lamp.center_m[2] < 4
        corners_m = corners_of(lamp)
        middle_m = np.broadcast_to(lamp.center_m, corners_m.shape)
        assert not caster.occluded(middle_m, corners_m).any()


def test_a_lamp_between_two_high_shelves_is_as_narrow_as_the_aisle() -> None:
    shelves = [box(x_m, 0, (4.2, 9.9, 3.99)) for x_m in (-2.6, 2.6)]
    lamps = light_of(hall(10, 10, 4), *shelves).lamps
    assert all(lamp.size_m[0] <= 1.0 for lamp in lamps if abs(lamp.center_m[0]) < 0.5)


@pytest.mark.parametrize(("covered_m", "is_indoors"), [(2.0, False), (7.9, True)])
def test_a_place_of_which_less_than_half_has_a_ceiling_gets_daylight(covered_m: float, is_indoors: bool) -> None:
    floor = Thing("floor", quad((-4, -3, 0), (8, 0, 0), (0, 6, 0)), "grey")
    roof = Thing("roof", quad((-4, 3, 2.5), (covered_m, 0, 0), (0, -6, 0)), "grey")
    assert bool(light_of(floor, roof).lamps) is is_indoors


def test_a_hall_with_a_window_has_windows_and_a_closed_one_has_not() -> None:
    assert not light_of(hall(6, 5)).has_windows
    floor = Thing("floor", quad((-3, -3, 0), (6, 0, 0), (0, 6, 0)), "grey")
    roof = Thing("roof", quad((-3, 3, 2.5), (6, 0, 0), (0, -6, 0)), "grey")
    light = light_of(floor, roof)
    assert light.lamps
    assert light.has_windows


def test_an_object_gets_daylight() -> None:
    assert light_of(Thing("box", block((0.5, 0.5, 0.5), bevel_m=0), "grey")).lamps == ()
    wall = Thing("wall", quad((0, -1, 0), (0, 2, 0), (0, 0, 2)), "grey")
    assert light_of(wall).lamps == ()
