"""The faces of each thing in one plane are one patch."""

from dataclasses import replace

import numpy as np

from tests.rendering.rectangles import box, rectangle
from vobench.geometry.triangle import areas_m2
from vobench.rendering.planar_patch import PlanarPatch, planar_patches
from vobench.scene.triangles import Thing, Triangles, triangle_table

X, Y, Z = np.eye(3)
BOX = box(np.array([2.0, -0.5, 0.4]), (0.8, 0.6, 0.8), yaw_deg=30, material="a", name="box")


def table(*things: Thing) -> Triangles:
    return triangle_table(list(things), [-1] * len(things), [-1] * len(things))


def patches_of(*things: Thing, at_least_m2: float = 0.0) -> list[PlanarPatch]:
    faces = table(*things)
    return planar_patches(faces, np.arange(len(faces)), at_least_m2=at_least_m2)


def test_a_box_has_six_patches_whose_areas_are_its_sides() -> None:
    patches = patches_of(*BOX)
    areas = sorted(round(areas_m2(patch.corners_m).sum(), 9) for patch in patches)
    assert areas == [0.48, 0.48, 0.48, 0.48, 0.64, 0.64]
    assert all(np.abs(patch.height_m(patch.corners_m)).max() < 1e-9 for patch in patches)


def test_small_patches_are_left_out() -> None:
    assert [len(patch.faces) for patch in patches_of(*BOX, at_least_m2=0.5)] == [2, 2]


def test_heights_are_positive_in_front_of_the_patch() -> None:
    (patch,) = patches_of(rectangle(Z, X, Y, "a"))
    np.testing.assert_allclose(patch.height_m(np.array([[0, 0, 3.0], [5.0, 1.0, 0.5]])), [2.0, -0.5])


def test_two_sides_of_a_sheet_coincide_and_two_sheets_do_not() -> None:
    front, back = patches_of(rectangle(Z, X, Y, "a"), rectangle(Z, Y, X, "a"))
    (other,) = patches_of(rectangle(1.1 * Z, Y, X, "a"))
    assert front.coincides(back)
    assert back.coincides(front)
    assert not front.coincides(front)
    assert not front.coincides(other)


def test_faces_of_different_things_in_one_plane_are_different_patches() -> None:
    tile = rectangle(0 * Z, X, Y, "a", "tile")
    assert len(patches_of(tile, replace(tile, name="other"))) == 2
