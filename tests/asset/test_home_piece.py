"""Bins stand in their space, and walls get a socket and up to two pictures."""

import numpy as np

from tests.asset.rooms import home, kinds, room_layout
from vobench.asset.home_piece import add_bin, decorate_walls
from vobench.asset.placed_piece import vertices_of


def test_a_bin_is_as_large_as_asked_and_in_the_room() -> None:
    layout = room_layout()
    add_bin(layout, width_m=0.28, height_m=0.38, back_m=0.16)
    vertices_m = vertices_of(layout.placed[0].parts)
    assert 0.26 < np.ptp(vertices_m[:, 0]) < 0.33
    assert np.abs(vertices_m[:, :2]).max() < 2.0


def test_walls_get_a_socket_and_pictures() -> None:
    layout = room_layout()
    decorate_walls(layout, home(), above=layout.spot("south", 0.0))
    found = kinds(layout)
    assert found.count("socket") == 1
    assert 1 <= found.count("picture") <= 3
