"""The checks of sites find what is wrong: overlaps, what floats or blocks the way, and darkness."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset import site_check
from vobench.asset.furniture import matt, stood
from vobench.asset.site import Area, LevelAreas, Site, SitePiece
from vobench.scene.light import Sky

ROAD = Area(np.array([[0.0, -2.0], [20.0, -2.0], [20.0, 2.0], [0.0, 2.0]]), 0.0)


def box(name: str, x_m: float, y_m: float = 0.0, z_m: float = 0.0, width_m: float = 1.0) -> SitePiece:
    return SitePiece(name, (stood((1.0, width_m, 1.0), matt(), x_m, y_m, z_m, bevel=0),), 0.1)


def site(*pieces: SitePiece) -> Site:
    return Site(
        structures=(),
        pieces=pieces,
        lights=(Sky("sky", 10000.0),),
        ground=LevelAreas((ROAD,)),
        roads=(ROAD,),
        stations_m=np.array([[2.0, 0.0], [18.0, 0.0]]),
        body_radius_m=0.6,
        walls=(np.array([[5.0, 2.0], [9.0, 2.0], [9.0, 6.0], [5.0, 6.0]]),),
    )


def test_nothing_is_wrong_with_a_box_beside_the_way() -> None:
    assert site_check.complaints(site(box("one", 10.0, 1.4))) == []


@pytest.mark.parametrize(
    ("pieces", "complaint"),
    [
        ((box("one", 10.0, 1.4), box("two", 10.8, 1.4)), "one and two overlap by 0.20 m"),
        ((box("one", 7.0, 1.8),), "one reaches 0.30 m into a wall"),
        ((box("one", 10.0, 1.4, 0.1),), "one stands 0.100 m above the ground"),
        ((box("wall", 10.0, 0.0, 0.0, 3.9),), r"a body of radius 0.6 m does not get to \[18.0, 0.0\]"),
    ],
)
def test_what_is_wrong_is_said(pieces: tuple[SitePiece, ...], complaint: str) -> None:
    (found,) = site_check.complaints(site(*pieces))
    assert found.startswith(complaint.replace("\\", ""))


def test_what_stands_on_another_piece_has_to_touch_it() -> None:
    table = box("table", 10.0, 1.4)
    cup = replace(box("cup", 10.0, 1.4, 1.0), support="table")
    assert site_check.complaints(site(table, cup)) == []
    floating = replace(box("cup", 10.0, 1.4, 1.2), support="table")
    assert site_check.complaints(site(table, floating)) == ["cup is not on table (gap 0.20 m)"]


def test_a_dark_place_is_a_complaint() -> None:
    dark = replace(site(), lights=(Sky("sky", 1.0),))
    assert site_check.complaints(dark) == ["no lamp is on, and it is dark"]
