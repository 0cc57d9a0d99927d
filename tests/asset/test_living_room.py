"""Living rooms have what the rest of the home lacks."""

from tests.asset.flats import SEEDS, flat
from tests.asset.rooms import home, kinds, room_layout
from vobench.asset.living_room import furnish_living_room


def test_a_flat_without_bedrooms_has_its_bed_in_the_living_room() -> None:
    for seed in SEEDS:
        interior = flat(seed)
        has_bedroom = any(room.use == "bedroom" for room in interior.plan.rooms)
        living = {room.name for room in interior.plan.rooms if room.use == "living"}
        beds = [piece for piece in interior.pieces if ".bed_" in piece.name and piece.room in living]
        if has_bedroom:
            assert beds == []


def test_a_large_living_room_of_a_home_without_bedrooms_has_a_bed_and_a_dining_table() -> None:
    layout = room_layout("living", size_m=6.0)
    furnish_living_room(layout, home())
    assert {"sofa", "bed", "dining_table", "shelf", "plant"} <= set(kinds(layout))


def test_a_small_living_room_has_no_dining_table() -> None:
    layout = room_layout("living", size_m=4.0)
    furnish_living_room(layout, home())
    assert "dining_table" not in kinds(layout)
