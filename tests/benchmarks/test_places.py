"""The benchmark of places measures the share of the surface that another seed changes, and compares bytes."""

from dataclasses import replace
from types import ModuleType

import pytest

from tests.benchmarks.loading import load
from vobench.asset.shape import at, block
from vobench.scene.generated_place import GeneratedPlace
from vobench.scene.material import Material
from vobench.scene.mesh import moved
from vobench.scene.triangles import Thing

WOOD = Material(colour=(0.5, 0.4, 0.3))
CRATE = Thing("crate", block((1.0, 1.0, 1.0), bevel_m=0), "wood")
SHELF = Thing("shelf", moved(block((1.0, 1.0, 1.0), bevel_m=0), at(5.0, 0.0, 0.0)), "wood")
PLACE = GeneratedPlace((CRATE, SHELF), {"wood": WOOD})


@pytest.fixture(scope="module")
def places() -> ModuleType:
    """The benchmark as a module."""
    return load("places")


def test_the_same_place_has_no_changed_surface(places: ModuleType) -> None:
    surface = places._surface(PLACE)
    assert surface.areas_m2.sum() == pytest.approx(12.0)
    assert surface.share_not_in(places._surface(PLACE)) == 0


def test_a_crate_that_moved_changes_half_of_the_surface(places: ModuleType) -> None:
    elsewhere = replace(CRATE, mesh=moved(CRATE.mesh, at(0.5, 0.0, 0.0)))
    other = GeneratedPlace((elsewhere, SHELF), {"wood": WOOD})
    assert places._surface(other).share_not_in(places._surface(PLACE)) == pytest.approx(0.5)


def test_another_colour_changes_the_whole_surface(places: ModuleType) -> None:
    painted = replace(PLACE, materials={"wood": Material(colour=(0.5, 0.4, 0.2))})
    assert places._surface(painted).share_not_in(places._surface(PLACE)) == 1


def test_a_place_whose_material_is_missing_is_unreadable(places: ModuleType) -> None:
    assert places._unreadable(PLACE) == []
    assert places._unreadable(replace(PLACE, materials={})) == ["returns things without materials: wood"]
