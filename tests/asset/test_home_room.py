"""Rooms of a home hold what they are for."""

from tests.asset.flats import SEEDS, flat
from vobench.asset.home_room import FURNISH


def test_rooms_hold_what_they_are_for() -> None:
    needed = {"kitchen": "kitchen_row", "bath": "washbasin", "bedroom": "bed", "study": "desk"}
    found = dict.fromkeys(needed, 0)
    rooms = dict.fromkeys(needed, 0)
    for seed in SEEDS:
        interior = flat(seed)
        for room in interior.plan.rooms:
            if room.use in needed:
                rooms[room.use] += 1
                found[room.use] += any(f"{room.name}.{needed[room.use]}_" in piece.name for piece in interior.pieces)
    for use, count in rooms.items():
        assert found[use] >= 0.9 * count, use


def test_every_use_of_a_room_can_be_furnished() -> None:
    for seed in SEEDS:
        assert {room.use for room in flat(seed).plan.rooms} <= set(FURNISH)


def test_a_bathroom_has_a_tub_or_a_shower_and_never_both() -> None:
    for seed in SEEDS:
        interior = flat(seed)
        for room in interior.plan.rooms:
            if room.use == "bath":
                names = [piece.name for piece in interior.pieces if piece.room == room.name]
                assert sum(".bathtub_" in name or ".shower_" in name for name in names) <= 1


def test_shoes_lie_below_coats_alone() -> None:
    for seed in SEEDS:
        interior = flat(seed)
        rooms_with_coats = {piece.room for piece in interior.pieces if ".coat_rack_" in piece.name}
        assert {piece.room for piece in interior.pieces if ".shoes_" in piece.name} <= rooms_with_coats
