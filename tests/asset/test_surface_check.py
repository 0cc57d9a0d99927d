"""The check of surfaces finds faces without an area, reversed normals, implausible materials and repeated lights."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset import surface_check
from vobench.asset.shape import block_arrays
from vobench.scene.generated_place import GeneratedPlace
from vobench.scene.light import PointLight
from vobench.scene.material import Material
from vobench.scene.mesh import as_mesh
from vobench.scene.mesh_arrays import MeshArrays
from vobench.scene.triangles import Thing

CRATE = block_arrays((1.0, 1.0, 1.0), bevel_m=0)
WOOD = Material(colour=(0.5, 0.4, 0.3))
LAMP = PointLight("lamp", np.array([0.0, 0.0, 2.0]), power_lm=500.0)


def place(
    mesh: MeshArrays = CRATE, material: Material = WOOD, lights: tuple[PointLight, ...] = (LAMP,)
) -> GeneratedPlace:
    return GeneratedPlace((Thing("crate", as_mesh(mesh), "wood"),), {"wood": material}, lights)


def test_nothing_is_wrong_with_a_wooden_crate() -> None:
    assert surface_check.complaints(place()) == []


def test_a_face_without_an_area_is_a_complaint() -> None:
    faces = CRATE.faces.copy()
    faces[0, 1] = faces[0, 0]
    assert surface_check.complaints(place(replace(CRATE, faces=faces))) == ["crate has 1 faces without an area"]


def test_a_mesh_without_faces_is_a_complaint() -> None:
    assert surface_check.complaints(place(replace(CRATE, faces=CRATE.faces[:0]))) == ["crate has no faces"]


def test_faces_that_are_shaded_from_behind_are_a_complaint() -> None:
    inside_out = replace(CRATE, normals=-CRATE.normals)
    (complaint,) = surface_check.complaints(place(inside_out))
    assert complaint == f"crate has {len(CRATE.faces)} faces whose normals point to their back"


@pytest.mark.parametrize(
    ("material", "complaint"),
    [
        (
            replace(WOOD, colour=(0.99, 0.5, 0.5)),
            "material wood has the colour [0.99, 0.5, 0.5], where 0 to 0.95 is right",
        ),
        (
            replace(WOOD, colour=(-0.1, 0.5, 0.5)),
            "material wood has the colour [-0.1, 0.5, 0.5], where 0 to 0.95 is right",
        ),
        (replace(WOOD, emission_cd_m2=(-1.0, 0.0, 0.0)), "material wood emits (-1.0, 0.0, 0.0) cd/m2"),
    ],
)
def test_a_material_that_nothing_real_has_is_a_complaint(material: Material, complaint: str) -> None:
    assert complaint in surface_check.complaints(place(material=material))


def test_a_missing_material_is_a_complaint() -> None:
    bare = replace(place(), materials={})
    assert surface_check.complaints(bare) == ["there is no material wood"]


def test_two_lights_of_one_name_are_a_complaint() -> None:
    assert surface_check.complaints(place(lights=(LAMP, LAMP))) == ["2 lights are called lamp"]
