"""Faces are grouped into meshes by material and mover, as Mitsuba needs them."""

import numpy as np
import pytest

from tests.rendering.rectangles import box, rectangle
from vobench.rendering.mitsuba_description import mesh_groups, textured_material
from vobench.scene.light import PointLight
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import two_sided
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light, triangles
from vobench.scene.triangles import Thing

MATERIALS = {"grey": Material(), "red": Material(colour=(0.7, 0.1, 0.1)), "glow": Material(emission_cd_m2=(1, 1, 1))}
X, Y, Z = np.eye(3)
FLOOR = rectangle(0 * Z, X, Y, "grey", "floor")
STILL = WaypointMotion(np.array([0.0]), np.zeros((1, 3)), np.zeros(1))
CART = Mover("cart", tuple(box(Z, (0.4, 0.2, 0.6), yaw_deg=0, material="grey")), STILL)
LAMP = ceiling_light("lamp", 2 * Z, (0.4, 0.3), power_lm=500)


def test_faces_of_one_material_and_mover_share_a_mesh_and_lamps_are_left_out() -> None:
    red = rectangle(2 * X, X, Y, "red", "red")
    other = rectangle(4 * X, X, Y, "grey", "other")
    scene = Scene("scene", (FLOOR, red, other), MATERIALS, (LAMP,), (CART,))
    faces = triangles(scene)
    made = mesh_groups(scene, faces)
    assert {(group.material, group.mover) for group in made} == {("grey", -1), ("red", -1), ("grey", 0)}
    assert len({group.key for group in made}) == 3
    members = np.concatenate([group.faces for group in made])
    np.testing.assert_array_equal(np.sort(members), np.flatnonzero(faces.lamp < 0))


@pytest.mark.parametrize(("material", "is_two_sided", "count"), [("grey", True, 2), ("glow", False, 4)])
def test_a_sheet_is_one_mesh_with_two_sides_unless_it_glows(material: str, is_two_sided: bool, count: int) -> None:
    sheet = Thing("sheet", two_sided(FLOOR.mesh), material)
    scene = Scene("scene", (sheet,), MATERIALS, ())
    (group,) = mesh_groups(scene, triangles(scene))
    assert group.two_sided == is_two_sided
    assert len(group.faces) == count


def test_only_a_lamp_whose_material_has_an_emission_texture_has_one() -> None:
    picture = Picture(np.full((2, 2), 0.5, np.float32), 1.0)
    screen = Material(emission_cd_m2=(1, 1, 1), emission_texture=picture)
    shown = ceiling_light("lamp", 2 * Z, (0.4, 0.3), power_lm=500)
    with_look = type(shown)(shown.name, shown.mesh, shown.power_lm, material="screen")
    scene = Scene("scene", (FLOOR,), {**MATERIALS, "screen": screen}, (shown, with_look))
    assert textured_material(scene, shown) is None
    assert textured_material(scene, with_look) is screen
    assert textured_material(scene, PointLight("bulb", Z, 100.0)) is None
