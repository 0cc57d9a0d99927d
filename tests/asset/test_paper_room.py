"""Variants of the paper's room by seed: valid, equal for equal seeds, different for others."""

import numpy as np
import pytest

from vobench.asset import paper_room, place_check
from vobench.asset.daylight import LIGHTINGS
from vobench.asset.interior import Interior
from vobench.scene.light import AreaLight

SEEDS = range(1, 17)


@pytest.fixture(scope="module")
def rooms() -> dict[int, Interior]:
    return {seed: paper_room.generated_paper_room(seed, LIGHTINGS[seed % 4]) for seed in SEEDS}


def test_nothing_is_wrong_with_rooms(rooms: dict[int, Interior]) -> None:
    assert [complaint for room in rooms.values() for complaint in place_check.complaints(room)] == []


def test_a_seed_gives_the_same_bytes_each_time(rooms: dict[int, Interior]) -> None:
    first = rooms[3].place()
    second = paper_room.generated_paper_room(3, LIGHTINGS[3]).place()
    assert [thing.name for thing in first.things] == [thing.name for thing in second.things]
    for one, other in zip(first.things, second.things, strict=True):
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
    assert first.materials == second.materials


def test_lamps_shine_by_day_and_by_night_and_the_lighting_moves_nothing() -> None:
    by_day = paper_room.generated_paper_room(5, "day")
    by_night = paper_room.generated_paper_room(5, "night")
    powers_lm = [
        sum(light.power_lm for light in room.lights if isinstance(light, AreaLight)) for room in (by_day, by_night)
    ]
    assert powers_lm[0] == powers_lm[1] > 0
    assert [piece.name for piece in by_day.pieces] == [piece.name for piece in by_night.pieces]


def test_plans_differ_in_size_alcoves_and_windows() -> None:
    plans = [paper_room.paper_room_plan(np.random.default_rng([seed, 30])) for seed in range(40)]
    assert len({plan.rooms[0].rect for plan in plans}) == len(plans)
    assert {len(plan.rooms) for plan in plans} == {1, 2}
    assert {bool(plan.windows) for plan in plans} == {False, True}
    assert len({plan.height_m for plan in plans}) >= 3


def test_some_floors_are_mirrors_and_most_are_not() -> None:
    etas = [paper_room._floor(np.random.default_rng(seed)).eta for seed in range(60)]
    mirrors = [eta for eta in etas if eta is not None and eta > 1.5]
    assert 0 < len(mirrors) < 20


def test_much_of_the_floor_stays_free(rooms: dict[int, Interior]) -> None:
    for room in rooms.values():
        free_m2 = len(place_check.free_places(room)) * place_check.CELL_M**2
        assert free_m2 > 0.12 * room.plan.area_m2
