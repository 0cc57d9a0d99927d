"""Rules by which furniture finds its place in a room."""

import numpy as np

from tests.asset.floor_plans import HALL, PLAN, STUDY
from vobench.asset import furniture
from vobench.asset.floor_plan import Rect, Room
from vobench.asset.furniture import WHITE
from vobench.asset.room_layout import RoomLayout


def layout(room: Room = STUDY, seed: int = 0) -> RoomLayout:
    return RoomLayout(PLAN, room, seed, np.random.default_rng(seed))


def test_a_body_fits_where_it_is_free_and_not_over_another_one_a_door_or_a_wall() -> None:
    room = layout()
    body = Rect(2.5, 3.0, 3.2, 3.8)
    assert room.floor.fits([body])
    room.floor.occupy(body, 1.0)
    assert not room.floor.fits([Rect(3.0, 3.5, 3.8, 4.2)])
    assert not room.floor.fits([Rect(3.5, 3.0, 4.3, 3.6)]), "beyond the wall"
    assert not room.floor.fits([Rect(0.4, 2.3, 1.0, 2.7)]), "where the door swings"


def test_a_body_must_leave_a_path_to_the_door() -> None:
    room = layout(HALL)
    assert room.floor.fits([Rect(2.0, 0.03, 2.6, 0.4)])
    assert not room.floor.fits([Rect(1.9, 0.03, 2.5, 1.97)]) or layout(HALL).floor.fits([Rect(1.9, 0.03, 2.5, 1.0)])
    assert not layout(HALL).floor.fits([Rect(0.03, 0.9, 3.97, 1.3)]), "it would cut the entrance from the door"


def test_places_at_walls_leave_doors_and_low_windows_free() -> None:
    for seed in range(20):
        room = layout(seed=seed)
        for spot in room.free_spots_at_walls((0.4, 1.0, 2.0)):
            body = spot.footprint(0.4, 1.0, 0.025)
            assert STUDY.rect.contains(body)
            if spot.side == "north":
                assert not (body.x0 < 2.5 and body.x1 > 1.5), "a tall body before the window"


def test_a_low_body_may_stand_below_a_window() -> None:
    size_m = (0.4, 1.2, 0.7)
    spots = [spot for seed in range(30) for spot in layout(seed=seed).free_spots_at_walls(size_m, sides=("north",))]
    assert any(abs(spot.x_m - 2.0) < 0.6 for spot in spots)


def test_what_hangs_leaves_windows_and_tall_furniture_free() -> None:
    for seed in range(20):
        room = layout(seed=seed)
        room.floor.occupy(Rect(0, 3, 0.4, 5), 2.0)
        spot = room.add_on_wall("board", lambda _: [furniture.stood((0.02, 1, 0.5), WHITE)], (1.0, 0.5))
        assert spot is not None
        assert spot.side != "north" or abs(spot.x_m - 2.0) > 0.9
        assert spot.side != "west"


def test_a_piece_depends_on_its_name_and_the_seed_alone() -> None:
    few = layout()
    few.add("mug", furniture.mug, (1, 4))
    more = layout()
    more.add("shelf", furniture.shelf, (3, 4))
    more.add("mug", furniture.mug, (1, 4))
    (mug,) = few.placed
    same = next(piece for piece in more.placed if ".mug_" in piece.name)
    for one, other in zip(mug.parts, same.parts, strict=True):
        assert one.arrays.vertices_m.tobytes() == other.arrays.vertices_m.tobytes()
