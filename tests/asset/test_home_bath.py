"""Bathrooms have a washbasin, a toilet, and a tub or a shower."""

from tests.asset.rooms import home, kinds, room_layout
from vobench.asset.home_bath import furnish_bath


def test_a_bathroom_has_what_it_needs_and_one_of_tub_and_shower() -> None:
    baths = set()
    for seed in range(8):
        layout = room_layout("bath", size_m=3.0, seed=seed)
        furnish_bath(layout, home())
        found = kinds(layout)
        assert {"washbasin", "toilet"} <= set(found)
        tubs = [kind for kind in found if kind in ("bathtub", "shower")]
        assert len(tubs) == 1
        baths.update(tubs)
    assert baths == {"bathtub", "shower"}
