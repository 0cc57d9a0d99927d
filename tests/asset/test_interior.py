"""Interiors: closed shells with holes, and rules by which furniture finds its place."""

import numpy as np
import pytest

from vobench.asset import furniture, home, workplace
from vobench.asset.floor_plan import FloorPlan, Passage, Rect, Room, Window
from vobench.asset.furniture import WHITE
from vobench.asset.interior import FLOOR, Interior, PlacedPiece, RoomFinish, RoomLayout, Spot, shell, without_excess

HALL = Room("hall_1", "hall", Rect(0, 0, 4, 2))
STUDY = Room("study_1", "study", Rect(0, 2.12, 4, 5))
DOOR = Passage(("study_1", "hall_1"), Rect(0.2, 2, 1.2, 2.12), "door", opens_into="study_1", leaf_end=0)
WINDOW = Window("study_1", Rect(1.5, 5, 2.5, 5.2), 0.9, 2.1)
ENTRANCE = Window("hall_1", Rect(-0.12, 0.5, 0, 1.4), 0.0, 2.05)
PLAN = FloorPlan((HALL, STUDY), (DOOR,), (WINDOW,), ENTRANCE, 2.6)


def finishes() -> dict[str, RoomFinish]:
    plain = RoomFinish(WHITE, WHITE, dict.fromkeys(("east", "north", "west", "south"), WHITE))
    return {room.name: plain for room in PLAN.rooms}


def layout(room: Room = STUDY, seed: int = 0) -> RoomLayout:
    return RoomLayout(PLAN, room, seed, np.random.default_rng(seed))


def _escapes(interior: Interior, count: int = 20000) -> int:
    """How many rays from inside the rooms hit nothing."""
    embree = pytest.importorskip("embreex.mesh_construction")
    scenes = pytest.importorskip("embreex.rtcore_scene")
    parts = [part for _, parts in interior.shell for part in parts]
    corners = np.concatenate([part.arrays.corners_m for part in parts])
    scene = scenes.EmbreeScene()
    embree.TriangleMesh(scene, corners.astype(np.float32))
    rng = np.random.default_rng(0)
    rects = [room.rect.grown(-0.05) for room in interior.plan.rooms]
    chosen = rng.integers(len(rects), size=count)
    low_m = np.array([[rect.x0, rect.y0, 0.05] for rect in rects])[chosen]
    high_m = np.array([[rect.x1, rect.y1, interior.plan.height_m - 0.05] for rect in rects])[chosen]
    origins_m = rng.uniform(low_m, high_m)
    directions = rng.standard_normal((count, 3))
    hits = scene.run(origins_m.astype(np.float32), directions.astype(np.float32))
    return int((hits < 0).sum())


def test_no_ray_leaves_the_shell_of_a_plan_with_doors_and_windows() -> None:
    instances = tuple(shell(PLAN, finishes(), thresholds=WHITE))
    assert _escapes(Interior(PLAN, instances, (), ())) == 0


@pytest.mark.parametrize("make", [home.furnished_flat, workplace.furnished_office])
def test_no_ray_leaves_the_shell_of_a_generated_place(make) -> None:  # type: ignore[no-untyped-def]
    for seed in (1, 2, 3):
        assert _escapes(make(seed, "day")) == 0


def test_rays_leave_a_shell_whose_ceiling_is_missing() -> None:
    instances = tuple(each for each in shell(PLAN, finishes(), thresholds=WHITE) if "ceiling" not in each[0])
    assert _escapes(Interior(PLAN, instances, (), ())) > 1000


def test_a_body_fits_where_it_is_free_and_not_over_another_one_a_door_or_a_wall() -> None:
    room = layout()
    body = Rect(2.5, 3.0, 3.2, 3.8)
    assert room.fits([body])
    room.take(body, 1.0)
    assert not room.fits([Rect(3.0, 3.5, 3.8, 4.2)])
    assert not room.fits([Rect(3.5, 3.0, 4.3, 3.6)]), "beyond the wall"
    assert not room.fits([Rect(0.4, 2.3, 1.0, 2.7)]), "where the door swings"


def test_a_body_must_leave_a_path_to_the_door() -> None:
    room = layout(HALL)
    assert room.fits([Rect(2.0, 0.03, 2.6, 0.4)])
    assert not room.fits([Rect(1.9, 0.03, 2.5, 1.97)]) or layout(HALL).fits([Rect(1.9, 0.03, 2.5, 1.0)])
    assert not layout(HALL).fits([Rect(0.03, 0.9, 3.97, 1.3)]), "it would cut the entrance from the door"


def test_places_at_walls_leave_doors_and_low_windows_free() -> None:
    for seed in range(20):
        room = layout(seed=seed)
        for spot in room.spots(1.0, 0.4, 2.0):
            body = spot.body(0.4, 1.0, 0.025)
            assert STUDY.rect.contains(body)
            if spot.side == "north":
                assert not (body.x0 < 2.5 and body.x1 > 1.5), "a tall body before the window"


def test_a_low_body_may_stand_below_a_window() -> None:
    sides = [spot for seed in range(30) for spot in layout(seed=seed).spots(1.2, 0.4, 0.7, sides=("north",))]
    assert any(abs(spot.x_m - 2.0) < 0.6 for spot in sides)


def test_the_frame_of_a_spot_points_into_the_room() -> None:
    for side, face in (("west", (0.5, 3.0)), ("east", (3.5, 3.0)), ("south", (2.0, 2.62)), ("north", (2.0, 4.5))):
        along = 3.0 if side in ("west", "east") else 2.0
        spot = layout().spot(side, along)  # type: ignore[arg-type]
        np.testing.assert_allclose(spot.at(0.5), face, atol=1e-9)


def test_what_hangs_leaves_windows_and_tall_furniture_free() -> None:
    for seed in range(20):
        room = layout(seed=seed)
        room.take(Rect(0, 3, 0.4, 5), 2.0)
        spot = room.hang("board", lambda _: [furniture.stood((0.02, 1, 0.5), WHITE)], (1.0, 0.5))
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


def test_optional_pieces_are_left_out_until_the_faces_are_few_enough() -> None:
    block = furniture.stood((1, 1, 1), WHITE)
    names = ["a.table_1", "a.mug_1", "a.mug_2", "a.plant_1"]
    pieces = [PlacedPiece(name, "a", (block,), FLOOR) for name in names]
    count = len(block.arrays.faces)
    kept = without_excess(pieces, 2 * count, ("mug", "plant"))
    assert [piece.name for piece in kept] == ["a.table_1", "a.plant_1"]
    assert without_excess(pieces, 4 * count, ("mug",)) == tuple(pieces)


def test_a_spot_turns_rectangles_with_it() -> None:
    spot = Spot(1.0, 2.0, 90.0, "south")
    assert spot.rect(0, 1, -0.5, 0.5) == Rect(0.5, 2.0, 1.5, 3.0)
