"""What belongs to windows keeps its place at the wall and on the floor."""

from dataclasses import replace

import pytest

from tests.asset.rooms import home, kinds, room_layout
from vobench.asset.floor_plan import Rect
from vobench.asset.placed_piece import vertices_of
from vobench.asset.window_dressing import dress_windows


def test_a_radiator_stands_below_a_window_and_keeps_its_place_free() -> None:
    layout = room_layout()
    dress_windows(layout, home())
    assert {"radiator", "window_frame"} <= set(kinds(layout))
    assert not layout.floor.fits([Rect(-0.4, 1.7, 0.4, 1.95)])


@pytest.mark.parametrize("use", ["bath", "kitchen"])
def test_wet_rooms_have_neither_radiators_nor_curtains(use: str) -> None:
    layout = room_layout(use)
    dress_windows(layout, replace(home(), window_dressing="curtains"))
    assert not {"radiator", "curtain", "rod"} & set(kinds(layout))


def test_curtains_hang_at_both_sides_of_a_window() -> None:
    layout = room_layout()
    dress_windows(layout, replace(home(), window_dressing="curtains"))
    curtains = [piece for piece in layout.placed if ".curtain_" in piece.name]
    middles_m = sorted(vertices_of(piece.parts)[:, 0].mean() for piece in curtains)
    assert len(middles_m) == 2
    assert middles_m[0] < -0.6
    assert middles_m[1] > 0.6


def test_a_blind_covers_a_part_of_the_window_from_above() -> None:
    layout = room_layout()
    dress_windows(layout, replace(home(), window_dressing="blinds"))
    blind = next(piece for piece in layout.placed if ".blind_" in piece.name)
    z_m = vertices_of(blind.parts)[:, 2]
    assert z_m.max() <= 2.2 + 0.05
    assert z_m.min() > 0.9
