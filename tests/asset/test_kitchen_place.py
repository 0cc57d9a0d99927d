"""A row of kitchen units stands at a wall, with its ends away from windows."""

import numpy as np

from tests.asset.rooms import home, room_layout
from vobench.asset.kitchen_place import add_kitchen_row, middle_of_free_floor
from vobench.asset.placed_piece import vertices_of
from vobench.asset.room_layout import RoomLayout


def furnished(seed: int) -> RoomLayout:
    layout = room_layout("kitchen", seed=seed)
    assert add_kitchen_row(layout, home()) is not None
    return layout


def test_the_longest_row_that_fits_stands_at_a_wall() -> None:
    for seed in range(5):
        (row,) = furnished(seed).placed
        vertices_m = vertices_of(row.parts)
        extents_m = np.ptp(vertices_m, axis=0)[:2]
        assert max(extents_m) > 2.3
        assert abs(vertices_m[:, :2]).max() < 2.012


def test_the_middle_of_the_free_floor_moves_away_from_the_row() -> None:
    assert middle_of_free_floor(room_layout("kitchen")) == (0.0, 0.0)
    for seed in range(5):
        layout = furnished(seed)
        row_m = vertices_of(layout.placed[0].parts)[:, :2]
        row_middle_m = (row_m.min(axis=0) + row_m.max(axis=0)) / 2
        assert row_middle_m @ np.array(middle_of_free_floor(layout)) < -0.2


def test_a_kitchen_that_is_too_small_has_no_row() -> None:
    layout = room_layout("kitchen", size_m=1.7)
    assert add_kitchen_row(layout, home()) is None
    assert layout.placed == []
