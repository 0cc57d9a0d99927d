"""Pictures and sockets hang on the walls."""

import numpy as np

from tests.asset.rooms import home, kinds, room_layout
from vobench.asset import fitting
from vobench.asset.placed_piece import vertices_of
from vobench.asset.wall_decoration import add_pictures, add_sockets, framed_print


def test_the_first_picture_hangs_above_the_furniture() -> None:
    layout = room_layout()
    add_pictures(layout, home(), 1, [layout.spot("south", 0.5), None])
    first = vertices_of(layout.placed[0].parts)
    assert abs(first[:, 0].mean() - 0.5) < 0.01
    assert first[:, 2].min() > 1.0
    assert len(layout.placed) <= 2


def test_sockets_are_low_on_the_walls() -> None:
    layout = room_layout()
    add_sockets(layout, 2)
    assert kinds(layout) == ["socket", "socket"]
    for piece in layout.placed:
        assert 0.2 < vertices_of(piece.parts)[:, 2].mean() < 0.4


def test_a_framed_print_is_as_large_as_that_of_fitting_with_fewer_faces() -> None:
    options = {"style": "hills", "width_m": 0.5, "height_m": 0.7, "seed": 1, "frame": "#262b30"}
    rng = np.random.default_rng(0)
    plain = framed_print(rng, **options)  # type: ignore[arg-type]
    rounded = fitting.framed(rng, **options)  # type: ignore[arg-type]
    for axis in (1, 2):
        extents_m = [np.ptp(vertices_of(parts)[:, axis]) for parts in (plain, rounded)]
        assert abs(extents_m[0] - extents_m[1]) < 0.005
    faces = [sum(len(part.arrays.faces) for part in parts) for parts in (plain, rounded)]
    assert faces[0] < faces[1]
