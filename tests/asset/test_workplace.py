"""Offices by seed: valid, with desks and seats, equal for equal seeds."""

import pytest

from vobench.asset import place_check, workplace
from vobench.asset.daylight import LIGHTINGS
from vobench.scene.light import AreaLight

SEEDS = range(1, 17)
MORE_SEEDS = [pytest.param(seed, marks=pytest.mark.slow) for seed in SEEDS[6:]]


@pytest.mark.parametrize("seed", [*SEEDS[:6], *MORE_SEEDS])
def test_nothing_is_wrong_with_an_office(seed: int) -> None:
    interior = workplace.furnished_office(seed, LIGHTINGS[seed % 4])
    assert place_check.complaints(interior) == []


@pytest.mark.slow
def test_an_office_has_as_many_chairs_as_desks_at_least() -> None:
    for seed in SEEDS:
        names = [piece.name for piece in workplace.furnished_office(seed, "day").pieces]
        desks = sum(".desk_" in name for name in names)
        chairs = sum(".chair_" in name for name in names)
        assert chairs >= desks >= 3


def test_a_seed_gives_the_same_bytes_each_time() -> None:
    first = workplace.furnished_office(4, "overcast").place()
    second = workplace.furnished_office(4, "overcast").place()
    for one, other in zip(first.things, second.things, strict=True):
        assert one.name == other.name
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()


@pytest.mark.slow
def test_an_office_is_lit_at_night() -> None:
    for seed in SEEDS:
        lights = workplace.furnished_office(seed, "night").lights
        assert sum(isinstance(light, AreaLight) for light in lights) >= 3


def test_lamps_hang_below_the_ceiling_within_their_room() -> None:
    interior = workplace.furnished_office(2, "night")
    for light in interior.lights:
        if isinstance(light, AreaLight) and ".lamp_" in light.name:
            room = interior.plan.room(light.name.split(".")[0])
            low_m, high_m = light.mesh.bounds
            assert room.rect.holds(low_m[0], low_m[1])
            assert room.rect.holds(high_m[0], high_m[1])
            assert high_m[2] < interior.plan.height_m
