"""Furniture that many rooms have: beds of things on surfaces, displays that are dark, rugs of several kinds."""

from itertools import pairwise

import numpy as np
import pytest

from vobench.asset import furnishing
from vobench.asset.floor_plan import FloorPlan, Rect, Room, Window
from vobench.asset.palette import home_style
from vobench.asset.room_layout import RoomLayout
from vobench.scene.material import emitted_cd_m2

ROOM = Room("study_1", "study", Rect(-2, -2, 2, 2))
WINDOW = Window("study_1", Rect(-0.6, 2, 0.6, 2.2), 0.9, 2.2)
ENTRANCE = Window("study_1", Rect(-2.12, -1.5, -2, -0.6), 0.0, 2.05)
PLAN = FloorPlan((ROOM,), (), (WINDOW,), ENTRANCE, 2.6)


def layout(seed: int = 0) -> RoomLayout:
    return RoomLayout(PLAN, ROOM, seed, np.random.default_rng(seed))


def test_things_on_a_surface_lie_side_by_side_within_its_width() -> None:
    for seed in range(20):
        room = layout(seed)
        spot = room.spot("south", 0.0)
        furnishing.scatter(room, "a", spot, ("mug", "pens", "plant", "bottle"), x_m=0.3, width_m=1.0, z_m=0.7)
        spans = []
        for piece in room.placed:
            corners = np.concatenate([part.arrays.vertices_m for part in piece.parts])
            assert corners[:, 2].min() == pytest.approx(0.7, abs=0.002)
            spans.append((corners[:, 0].min(), corners[:, 0].max()))
        spans.sort()
        assert len(spans) >= 3
        assert spans[0][0] > -0.53
        assert spans[-1][1] < 0.53
        for (_, end_m), (start_m, _) in pairwise(spans):
            assert start_m > end_m - 0.02


def test_a_display_that_is_off_emits_nothing() -> None:
    rng = np.random.default_rng(0)
    shining = furnishing.monitor(rng, width_m=0.5, seed=0, is_on=True)
    dark = furnishing.monitor(rng, width_m=0.5, seed=0, is_on=False)
    assert max(emitted_cd_m2(part.material).max() for part in shining) > 1
    assert max(emitted_cd_m2(part.material).max() for part in dark) == 0
    assert len(dark) == len(shining)


def test_a_radiator_stands_below_a_window_and_keeps_its_place_free() -> None:
    room = layout()
    furnishing.dress_windows(room, home_style(np.random.default_rng(0)))
    names = [piece.name for piece in room.placed]
    assert "study_1.radiator_1" in names
    assert "study_1.window_frame_1" in names
    assert not room.fits([Rect(-0.4, 1.7, 0.4, 1.95)])


@pytest.mark.parametrize("seed", range(4))
def test_rugs_of_all_kinds_are_flat_and_as_large_as_asked(seed: int) -> None:
    parts = furnishing.rug(np.random.default_rng(0), 1.8, 1.2, seed)
    corners = np.concatenate([part.arrays.vertices_m for part in parts])
    np.testing.assert_allclose(np.ptp(corners, axis=0)[:2], [1.2, 1.8], atol=0.002)
    assert corners[:, 2].max() < 0.01


def test_the_outward_direction_is_that_of_a_window() -> None:
    assert furnishing.outward_deg(PLAN, np.random.default_rng(0)) == pytest.approx(90)


def test_a_desk_has_its_chair_in_front_and_its_display_on_top() -> None:
    room = layout()
    spot = furnishing.desk(room, home_style(np.random.default_rng(0)))
    assert spot is not None
    kinds = {piece.name.split(".")[1].rsplit("_", 1)[0]: piece for piece in room.placed}
    assert kinds["chair"].beside == (kinds["desk"].name,)
    assert kinds["monitor"].support == kinds["desk"].name
