"""The floor of a room keeps clearances and a path from door to door."""

import pytest

from vobench.asset.floor_plan import Rect
from vobench.asset.floor_space import FloorSpace


def floor() -> FloorSpace:
    """A floor of 4 m × 2 m with a doorway at either end."""
    space = FloorSpace(Rect(0, 0, 4, 2))
    space.keep_reachable((0.4, 1.0))
    space.keep_reachable((3.6, 1.0))
    return space


def test_a_footprint_must_be_inside_and_out_of_clearances() -> None:
    space = floor()
    space.keep_clear(Rect(1.0, 0.0, 1.5, 0.5))
    assert not space.fits([Rect(1.4, 0.0, 1.8, 0.4)])
    assert space.fits([Rect(1.6, 0.0, 2.0, 0.4)])
    assert not space.fits([Rect(3.8, 0.0, 4.2, 0.4)])


def test_the_front_of_a_piece_stays_free() -> None:
    space = floor()
    space.occupy(Rect(1.0, 0.0, 1.4, 0.4), 1.0)
    assert space.fits([Rect(2.0, 0.0, 2.4, 0.4)], [Rect(1.5, 0.0, 2.0, 0.4)])
    assert not space.fits([Rect(2.0, 0.0, 2.4, 0.4)], [Rect(1.2, 0.0, 2.0, 0.4)])


@pytest.mark.parametrize(("length_m", "is_passable"), [(0.8, True), (1.5, False), (2.0, False)])
def test_a_body_passes_between_the_doorways(length_m: float, is_passable: bool) -> None:
    assert floor().fits([Rect(1.8, 0.0, 2.2, length_m)]) == is_passable


def test_the_free_share_and_the_footprints_above_a_height_count_what_stands_there() -> None:
    space = floor()
    space.occupy(Rect(0, 0, 1, 1), 0.5)
    space.occupy(Rect(3, 0, 4, 1), 2.0)
    assert space.free_share() == pytest.approx(0.75)
    assert space.footprints_above(1.0) == [Rect(3, 0, 4, 1)]
