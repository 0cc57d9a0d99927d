"""Regions of walls are free until something is on them."""

from vobench.asset.wall_space import WallRegion, WallSpace, region_around


def test_a_region_is_occupied_on_its_own_wall_alone() -> None:
    walls = WallSpace()
    walls.occupy("north", WallRegion(1.0, 2.0, 0.5, 1.5))
    assert not walls.is_free("north", WallRegion(1.9, 3.0, 1.4, 2.0))
    assert walls.is_free("south", WallRegion(1.9, 3.0, 1.4, 2.0))


def test_regions_that_touch_do_not_overlap() -> None:
    region = WallRegion(1.0, 2.0, 0.5, 1.5)
    assert not region.overlaps(WallRegion(2.0, 3.0, 0.5, 1.5)), "beside it"
    assert not region.overlaps(WallRegion(1.0, 2.0, 1.5, 2.0)), "above it"
    assert region.overlaps(WallRegion(1.2, 1.4, 0.0, 2.0))


def test_walls_of_two_rooms_are_apart() -> None:
    first = WallSpace()
    first.occupy("east", WallRegion(0, 1, 0, 1))
    assert WallSpace().is_free("east", WallRegion(0, 1, 0, 1))


def test_a_region_is_centred_at_its_coordinate() -> None:
    assert region_around(3.0, width_m=1.0, bottom_m=0.2, top_m=0.8) == WallRegion(2.5, 3.5, 0.2, 0.8)
