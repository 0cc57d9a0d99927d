"""Rooms of an office hold what they are for."""

import pytest

from tests.asset.rooms import kinds, office, room_layout
from vobench.asset.furniture import WHITE
from vobench.asset.office_room import FURNISH

NEEDED = {"open": "desk", "cell": "desk", "meeting": "meeting_table", "pantry": "kitchen_row", "hall": "cabinet"}


@pytest.mark.parametrize("use", FURNISH)
def test_rooms_hold_what_they_are_for(use: str) -> None:
    layout = room_layout(use, size_m=6.0)
    FURNISH[use](layout, office(), WHITE)
    assert NEEDED[use] in kinds(layout)


def test_a_meeting_table_has_as_many_chairs_at_one_side_as_at_the_other() -> None:
    layout = room_layout("meeting", size_m=5.0)
    FURNISH["meeting"](layout, office(), WHITE)
    chairs = kinds(layout).count("chair")
    assert chairs >= 4
    assert chairs % 2 == 0
