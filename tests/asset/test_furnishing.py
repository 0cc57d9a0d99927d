"""Furniture that rooms of several uses have stands as it is used."""

import numpy as np
import pytest

from tests.asset.rooms import home, kinds, room_layout
from vobench.asset import furnishing
from vobench.asset.placed_piece import PlacedPiece, vertices_of


def middle_m(piece: PlacedPiece) -> np.ndarray:
    return vertices_of(piece.parts)[:, :2].mean(axis=0)


def test_a_desk_has_its_chair_in_front_and_its_display_on_top() -> None:
    layout = room_layout()
    spot = furnishing.add_desk(layout, home())
    assert spot is not None
    pieces = dict(zip(kinds(layout), layout.placed, strict=True))
    assert pieces["chair"].may_overlap == (pieces["desk"].name,)
    assert pieces["monitor"].support == pieces["desk"].name
    wall_m = np.array(spot.point(0))
    assert np.linalg.norm(middle_m(pieces["chair"]) - wall_m) > np.linalg.norm(middle_m(pieces["desk"]) - wall_m)


@pytest.mark.parametrize("seats", [2, 4, 6])
def test_a_dining_table_has_as_many_chairs_as_seats_half_of_them_at_each_side(seats: int) -> None:
    layout = room_layout(size_m=5.0)
    assert furnishing.add_dining_table(layout, home(), seats)
    table = layout.placed[0]
    chairs = [piece for piece in layout.placed if ".dining_chair_" in piece.name]
    assert len(chairs) == seats
    offsets_m = np.array([middle_m(chair) - middle_m(table) for chair in chairs])
    across = int(np.argmax(np.abs(offsets_m).min(axis=0)))
    assert (offsets_m[:, across] > 0).sum() == seats // 2


def test_there_is_no_table_where_there_is_no_space_for_it() -> None:
    layout = room_layout(size_m=1.6)
    assert not furnishing.add_dining_table(layout, home(), 4)
    assert layout.placed == []


def test_cartons_are_stacked() -> None:
    layout = room_layout()
    furnishing.add_cartons(layout)
    lower, upper = layout.placed
    assert upper.support == lower.name
    assert vertices_of(upper.parts)[:, 2].min() == pytest.approx(vertices_of(lower.parts)[:, 2].max(), abs=0.002)


def test_only_low_shelves_have_things_on_top() -> None:
    for seed in range(12):
        layout = room_layout(seed=seed)
        furnishing.add_shelf(layout, home())
        height_m = vertices_of(layout.placed[0].parts)[:, 2].max()
        assert (len(layout.placed) > 1) == (height_m < 1.3)


def test_a_plant_and_an_armchair_stand_within_the_room() -> None:
    for seed in range(6):
        layout = room_layout(seed=seed)
        furnishing.add_floor_plant(layout)
        furnishing.add_armchair(layout, home())
        assert kinds(layout) == ["plant", "armchair"]
        for piece in layout.placed:
            assert np.abs(vertices_of(piece.parts)[:, :2]).max() < 2.0
