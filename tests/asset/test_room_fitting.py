"""Skirting boards run along the walls of a room, except at its doors; each door has a lining and a leaf."""

import numpy as np
import pytest

from tests.asset.floor_plans import HALL, PLAN, STUDY
from vobench.asset.floor_plan import Room
from vobench.asset.furniture import WHITE
from vobench.asset.placed_piece import vertices_of
from vobench.asset.room_fitting import ENTRANCE_MARGIN_M, door_fittings, skirtings
from vobench.asset.room_layout import CASING_M, RoomLayout


def layout(room: Room) -> RoomLayout:
    return RoomLayout(PLAN, room, 0, np.random.default_rng(0))


def length_m(room: Room) -> float:
    """The length of all skirting boards of a room."""
    furnished = layout(room)
    skirtings(furnished)
    extents_m = [np.ptp(vertices_of(piece.parts), axis=0) for piece in furnished.placed]
    return float(sum(max(extent_m[0], extent_m[1]) for extent_m in extents_m))


@pytest.mark.parametrize(
    ("room", "doors_m"),
    [
        (STUDY, 1.0 + 2 * (CASING_M - 0.02)),  # the window is too high to interrupt a board
        (HALL, 1.0 + 2 * (CASING_M - 0.02) + 0.9 + 2 * ENTRANCE_MARGIN_M),
    ],
    ids=["study", "hall"],
)
def test_skirting_boards_are_as_long_as_the_walls_without_the_doorways(room: Room, doors_m: float) -> None:
    around_m = 2 * (room.rect.width_m + room.rect.depth_m)
    assert length_m(room) == pytest.approx(around_m - doors_m, abs=0.02)


def test_each_door_has_a_lining_and_a_leaf_in_the_room_that_it_opens_into_and_the_entrance_is_closed() -> None:
    layouts = {room.name: layout(room) for room in PLAN.rooms}
    door_fittings(PLAN, layouts, WHITE, panels=True)
    assert [piece.name for piece in layouts["study_1"].placed] == ["study_1.lining_1", "study_1.leaf_1"]
    assert [piece.name for piece in layouts["hall_1"].placed] == ["hall_1.entrance_1"]


def test_an_open_leaf_stands_in_the_room_at_its_hinge() -> None:
    layouts = {room.name: layout(room) for room in PLAN.rooms}
    door_fittings(PLAN, layouts, WHITE, panels=False)
    leaf = vertices_of(layouts["study_1"].placed[1].parts)
    door = PLAN.passages[0].rect
    assert leaf[:, 1].min() >= STUDY.rect.y0 - 0.1
    assert np.ptp(leaf[:, 1]) > 0.8
    hinge_x = (door.x0, door.x1)[PLAN.passages[0].leaf_end]
    assert abs(leaf[:, 0].mean() - hinge_x) < 0.2
