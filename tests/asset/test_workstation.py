"""Workstations have a chair each, stand face to face in blocks, and leave aisles."""

import numpy as np

from tests.asset.rooms import kinds, office, room_layout
from vobench.asset.furniture import WHITE
from vobench.asset.placed_piece import vertices_of
from vobench.asset.workstation import add_desk_blocks, add_wall_workstation


def test_every_desk_of_a_block_has_a_chair_and_a_computer() -> None:
    layout = room_layout("open", size_m=8.0)
    count = add_desk_blocks(layout, office(), WHITE)
    found = kinds(layout)
    assert count >= 4
    assert found.count("desk") == found.count("chair") == count
    assert found.count("monitor") + found.count("laptop") == count


def test_desks_do_not_overlap() -> None:
    layout = room_layout("open", size_m=8.0)
    add_desk_blocks(layout, office(), WHITE)
    boxes = [vertices_of(piece.parts)[:, :2] for piece in layout.placed if ".desk_" in piece.name]
    lows = [box.min(axis=0) for box in boxes]
    highs = [box.max(axis=0) for box in boxes]
    for one in range(len(boxes)):
        for other in range(one):
            depth_m = np.minimum(highs[one], highs[other]) - np.maximum(lows[one], lows[other])
            assert depth_m.min() < 0.001


def test_a_workstation_at_a_wall_covers_the_wall_behind_it() -> None:
    layout = room_layout("cell")
    add_wall_workstation(layout, office(), WHITE)
    assert kinds(layout)[:2] == ["desk", "chair"]
    assert layout.floor.free_share() < 0.95


def test_a_room_that_is_too_small_has_no_workstation() -> None:
    layout = room_layout("cell", size_m=1.3)
    add_wall_workstation(layout, office(), WHITE)
    assert add_desk_blocks(layout, office(), WHITE) == 0
    assert layout.placed == []
