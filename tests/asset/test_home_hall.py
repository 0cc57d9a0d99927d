"""Halls have coats, shoes below coats alone, and more where they are wide."""

from tests.asset.rooms import home, kinds, room_layout
from vobench.asset.home_hall import furnish_hall


def test_shoes_lie_below_coats_alone_and_narrow_halls_have_no_wardrobe() -> None:
    all_kinds = set()
    for seed in range(10):
        layout = room_layout("hall", size_m=3.2, seed=seed)
        furnish_hall(layout, home())
        found = kinds(layout)
        assert "shoes" not in found or "coat_rack" in found
        all_kinds.update(found)
    assert {"shoe_cabinet", "coat_rack", "shoes", "wardrobe", "rug"} <= all_kinds

    narrow = room_layout("hall", size_m=1.65)
    furnish_hall(narrow, home())
    assert "wardrobe" not in kinds(narrow)
