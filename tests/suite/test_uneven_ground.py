"""Uneven ground is the largest gentle thing of many heights, with others like it; its height is found at any place."""

import numpy as np
import pytest

from vobench.asset.shape import at, block, sheet
from vobench.scene.material import Material
from vobench.scene.mesh import moved, quad
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Thing, Triangles
from vobench.suite.uneven_ground import ground_heights_m, is_under_sheet, uneven_ground

GREY = {"grey": Material(colour=(0.5, 0.5, 0.5))}


def hill_m(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.4 * np.sin(0.4 * x) + 0.3 * np.cos(0.3 * y)


def hills(name: str, side_m: float, *, x_m: float = 0.0) -> Thing:
    """A square of uneven ground."""
    steps_m = np.arange(-side_m / 2, side_m / 2 + 0.01, 0.5)
    x, y = np.meshgrid(x_m + steps_m, steps_m)
    return Thing(name, sheet(np.stack([x, y, hill_m(x, y)], axis=-1)), "grey")


def level(side_m: float) -> Thing:
    return Thing("floor", quad((-side_m / 2, -side_m / 2, 0), (side_m, 0, 0), (0, side_m, 0)), "grey")


def faces_of(*things: Thing) -> Triangles:
    return triangles(Scene("park", things, GREY, ()), t_ns=0)


def things_of_ground(*things: Thing) -> set[int]:
    faces = faces_of(*things)
    return set(faces.thing[uneven_ground(faces)].tolist())


def test_hills_are_ground_and_a_level_thing_on_them_is_not() -> None:
    assert things_of_ground(hills("hills", 20), level(6)) == {0}


def test_a_level_floor_with_a_larger_area_leaves_no_uneven_ground() -> None:
    assert things_of_ground(level(40), hills("hills", 10)) == set()


def test_another_wide_thing_belongs_to_the_ground_and_a_narrow_one_does_not() -> None:
    assert things_of_ground(hills("west", 20), hills("east", 10, x_m=15)) == {0, 1}
    assert things_of_ground(hills("west", 20), hills("mound", 4, x_m=12)) == {0}


def test_a_scene_without_a_gentle_face_has_none() -> None:
    wall = Thing("wall", quad((0, -1, 0), (0, 2, 0), (0, 0, 2)), "grey")
    assert things_of_ground(wall) == set()


def test_heights_are_those_of_the_ground_and_nan_beside_it() -> None:
    faces = faces_of(hills("hills", 20), level(30))
    is_hills = faces.thing == 0
    places_m = np.array([[0.0, 0.0], [4.2, -3.3], [14.0, 0.0]])
    heights_m = ground_heights_m(faces, is_hills, places_m)
    assert heights_m[:2] == pytest.approx(hill_m(places_m[:2, 0], places_m[:2, 1]), abs=0.02)
    assert np.isnan(heights_m[2])


def test_points_below_a_sheet_are_found_and_those_below_a_box_are_not() -> None:
    water = Thing("water", quad((-2, -2, 0), (4, 0, 0), (0, 4, 0)), "grey")
    roof = Thing("roof", moved(block((1, 1, 1)), at(5, 0, 2)), "grey")
    points_m = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [3.0, 0.0, -1.0], [5.0, 0.0, 0.0]])
    assert is_under_sheet(faces_of(water, roof), points_m).tolist() == [True, False, False, False]
    assert is_under_sheet(faces_of(roof), points_m).tolist() == [False] * 4
