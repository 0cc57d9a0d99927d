"""Floor plans by seed: rooms that fill the storey, holes in the right walls, and a way to every room."""

from itertools import combinations

import numpy as np
import pytest

from vobench.asset import floor_plan
from vobench.asset.floor_plan import FloorPlan, Rect, Room, Symmetry

SEEDS = range(60)
MAKERS = {"flat": floor_plan.flat_plan, "office": floor_plan.office_plan}
PLANS = [(name, seed) for name in MAKERS for seed in SEEDS]


def plan_of(name: str, seed: int) -> FloorPlan:
    return MAKERS[name](np.random.default_rng(seed))


@pytest.mark.parametrize("name", MAKERS)
def test_rooms_do_not_overlap_and_walls_between_them_have_one_thickness(name: str) -> None:
    for seed in SEEDS:
        plan = plan_of(name, seed)
        for one, other in combinations(plan.rooms, 2):
            assert not one.rect.grown(floor_plan.WALL_M / 2 - 1e-6).overlaps(
                other.rect.grown(floor_plan.WALL_M / 2 - 1e-6)
            )


@pytest.mark.parametrize("name", MAKERS)
def test_every_room_is_reached_through_walkable_passages(name: str) -> None:
    for seed in SEEDS:
        plan = plan_of(name, seed)
        reached = {plan.entrance.room}
        while True:
            before = len(reached)
            for passage in plan.passages:
                if passage.is_walkable and reached & set(passage.rooms):
                    reached |= set(passage.rooms)
            if len(reached) == before:
                break
        assert reached == {room.name for room in plan.rooms}, (name, seed)


@pytest.mark.parametrize("name", MAKERS)
def test_a_passage_reaches_from_the_face_of_one_wall_to_that_of_the_other(name: str) -> None:
    for seed in SEEDS:
        plan = plan_of(name, seed)
        for passage in plan.passages:
            assert min(passage.rect.width_m, passage.rect.depth_m) == pytest.approx(floor_plan.WALL_M)
            for room_name in passage.rooms:
                room = plan.room(room_name)
                side = room.side_at(passage.rect)
                first_m, last_m = room.span_m(side)
                start_m, end_m = floor_plan.along_m(side, passage.rect)
                assert first_m - 1e-6 <= start_m
                assert end_m <= last_m + 1e-6


@pytest.mark.parametrize("name", MAKERS)
def test_holes_in_walls_do_not_overlap(name: str) -> None:
    for seed in SEEDS:
        plan = plan_of(name, seed)
        holes = [*(passage.rect for passage in plan.passages), *(window.rect for window in plan.windows)]
        holes.append(plan.entrance.rect)
        for one, other in combinations(holes, 2):
            assert not one.overlaps(other), (name, seed)


def test_rooms_to_live_in_have_windows_and_doors_leave_the_asked_width() -> None:
    for seed in SEEDS:
        plan = plan_of("flat", seed)
        for room in plan.rooms:
            if room.use in ("living", "bedroom", "study", "kitchen"):
                assert any(plan.windows_of(room)), (seed, room.name)
        widths = [max(passage.rect.width_m, passage.rect.depth_m) for passage in plan.passages]
        assert min(widths) >= floor_plan.DOOR_M - 1e-9


def test_a_flat_has_the_rooms_of_a_flat_and_a_moderate_size() -> None:
    areas = [plan_of("flat", seed).area_m2 for seed in SEEDS]
    assert min(areas) > 35
    assert max(areas) < 95
    for seed in SEEDS:
        uses = {room.use for room in plan_of("flat", seed).rooms}
        assert {"hall", "bath", "kitchen", "living"} <= uses


@pytest.mark.parametrize("name", MAKERS)
def test_seeds_give_different_plans_and_a_seed_always_the_same(name: str) -> None:
    assert plan_of(name, 3) == plan_of(name, 3)
    assert len({plan_of(name, seed) for seed in SEEDS}) == len(SEEDS)


def test_a_row_is_divided_into_rooms_of_at_least_their_width() -> None:
    rng = np.random.default_rng(0)
    uses = ["bath", "kitchen", "bedroom"]
    cells = floor_plan.divided(rng, Rect(1.0, 0.0, 10.0, 3.0), uses)
    assert [cell.use for cell in cells] == uses
    assert cells[0].rect.x0 == 1.0
    assert cells[-1].rect.x1 == 10.0
    for cell in cells:
        assert cell.rect.width_m >= floor_plan.LEAST_WIDTH_M[cell.use] - 0.011


def test_the_wall_between_rooms_is_found_across_either_axis_and_not_where_they_are_apart() -> None:
    room = Room("a", "study", Rect(0, 0, 2, 2))
    beside = Room("b", "study", Rect(2 + floor_plan.WALL_M, 1, 4, 3))
    above = Room("c", "study", Rect(1, 2 + floor_plan.WALL_M, 3, 4))
    far = Room("d", "study", Rect(5, 5, 6, 6))
    assert floor_plan.shared_wall(room, beside) == Rect(2, 1, 2 + floor_plan.WALL_M, 2)
    assert floor_plan.shared_wall(room, above) == Rect(1, 2, 2, 2 + floor_plan.WALL_M)
    assert floor_plan.shared_wall(room, far) is None


def test_a_symmetry_keeps_areas_and_which_end_of_a_hole_its_leaf_is_at() -> None:
    plan = plan_of("flat", 1)
    mirrored = Symmetry(exchanges=True, x_sign=-1, y_sign=1).plan(plan)
    assert mirrored.area_m2 == pytest.approx(plan.area_m2)
    for before, after in zip(plan.passages, mirrored.passages, strict=True):
        if before.kind != "door":
            continue
        # The leaf stays as near to a corner of its room as it was.
        assert _to_corner_m(mirrored, after) == pytest.approx(_to_corner_m(plan, before))


def _to_corner_m(plan: FloorPlan, passage: floor_plan.Passage) -> float:
    room = plan.room(passage.opens_into)
    side = room.side_at(passage.rect)
    hinge_m = floor_plan.along_m(side, passage.rect)[passage.leaf_end]
    return min(abs(hinge_m - end_m) for end_m in room.span_m(side))


def test_a_door_has_no_leaf_where_it_would_stand_before_another_door() -> None:
    room = Room("a", "study", Rect(0, 0, 3, 3))
    door = floor_plan.Passage(("a", "b"), Rect(0.2, 3, 1.2, 3.12), "door", opens_into="a")
    near = floor_plan.Passage(("a", "c"), Rect(-0.12, 1.9, 0, 2.9), "door", opens_into="c")
    far = floor_plan.Passage(("a", "c"), Rect(1.9, -0.12, 2.9, 0), "door", opens_into="c")
    assert not floor_plan.without_obstructing_leaves([room], [door, near])[0].has_leaf
    assert floor_plan.without_obstructing_leaves([room], [door, far])[0].has_leaf
